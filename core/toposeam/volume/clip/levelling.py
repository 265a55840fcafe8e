"""Levelling of loops: differences of light across a jump become gradual.

The surface is found between stretches whose slowly varying difference of light was removed. The remaining
steps along it, of light or of form, are then spread over the frames and pixels around, by Poisson's equation
in time and space (:mod:`toposeam.heat.poisson`): the wider a step, the more gradual. Pictures are not mixed.
No place gets lighter or darker by it than the clip has it at some time: what is always black stays black.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats32, Mask
from toposeam.heat.bricks import HIGH, LOW, along
from toposeam.heat.poisson import add_steps, spread_in_cycle

#: Standard deviation of the blur that gives slow light, as a share of the frame's longer side.
_LIGHT_BLUR = 0.15
#: Difference, as a share of white, beyond which pixels are taken to show different things and lose weight.
_MAX_LIGHT_DIFFERENCE = 0.05


def remove_light_difference(a: Floats32, b: Floats32) -> tuple[Floats32, Floats32]:
    """Remove the slow difference of light between two stretches of a clip; each is changed by half of it.

    Parameters
    ----------
    a, b : (D, H, W, C) float32 arrays
        As shares of white.
    """
    apart = a.mean(axis=0) - b.mean(axis=0)
    likeness = 1 / (1 + np.square(apart / _MAX_LIGHT_DIFFERENCE).sum(axis=2, keepdims=True)) ** 2
    reach = _LIGHT_BLUR * max(a.shape[1:3])
    light, share = (
        ndimage.gaussian_filter(part, (reach, reach, 0), mode="nearest")
        for part in (apart * likeness, likeness)
    )
    half = light / share / 2
    return a - half, b + half


def levelling(
    changes: Sequence[tuple[int, Floats32, Mask]], frames: int, moving: Mask
) -> npt.NDArray[np.float32]:
    """Compute the light that levels a loop: the steps along its surfaces, spread over the pixels around.

    Parameters
    ----------
    changes : sequence of (int, (D, H, W, C) float32 array, (D, H, W) bool array)
        Of each transition the loop's frame with which it begins, the entered stretch minus the left one, as
        shares of white, and where the entered stretch shows.
    frames : int
        Number of the loop's frames, P.
    moving : (H, W) bool array
        False on pixels that stand still, which are not changed.

    Returns
    -------
    (P, H, W, C) float32 array
    """
    transition, *_, channels = changes[0][1].shape
    # With this stiffness a step as wide as the frame fades within a transition.
    stiffness = (max(moving.shape) / (2 * np.pi * transition)) ** 2
    result = np.empty((frames, *moving.shape, channels), np.float32)
    for channel in range(channels):
        source = np.zeros(result.shape[:3], np.float32)
        for at, apart, label in changes:
            step = np.where(moving, apart[..., channel], np.float32(0))
            _add_surface(source[at : at + transition], label, step, stiffness)
        result[..., channel] = spread_in_cycle(source, stiffness)
    result[:, ~moving] = 0
    return result


def within(change: Floats32, values: Floats32, low: Floats32, high: Floats32) -> Floats32:
    """Limit a change of values so that it leads no further than the range that they have at some time."""
    result: Floats32 = np.clip(change, np.minimum(low - values, 0), np.maximum(high - values, 0))
    return result


def _add_surface(
    source: npt.NDArray[np.float32], label: Mask, apart: npt.NDArray[np.float32], stiffness: float
) -> None:
    """Add the steps across one surface to the source term of Poisson's equation.

    A step is the entered stretch minus the left one, in the mean of the two neighbours.
    """
    for axis, weight in enumerate((1.0, stiffness, stiffness)):
        low, high = along(axis, LOW), along(axis, HIGH)
        side = label[high].astype(np.int8) - label[low]
        add_steps(source, low, high, side * (apart[low] + apart[high]) / 2, weight)
