"""Levelling of loops: differences of light across a jump become gradual.

The surface is found between stretches whose slowly varying difference of light was removed. The remaining
steps along it, of light or of form, are then spread over the frames and pixels around, by Poisson's equation
in time and space (:mod:`toposeam.heat.poisson`): the wider a step, the more gradual. Pictures are not mixed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Mask, Volume
from toposeam.heat.bricks import HIGH, LOW, along
from toposeam.heat.poisson import add_steps, spread_in_cycle
from toposeam.images import full_scale, in_dtype
from toposeam.volume.clip.period import Jump
from toposeam.volume.problem.arrays import as_shares

#: Standard deviation of the blur that gives slow light, as a share of the frame's longer side.
_LIGHT_BLUR = 0.15
#: Difference, as a share of white, beyond which pixels are taken to show different things and lose weight.
_MAX_LIGHT_DIFFERENCE = 0.05


def remove_light_difference(a: Volume, b: Volume, data_range: float | None) -> tuple[Volume, Volume]:
    """Remove the slow difference of light between two stretches of a clip; each is changed by half of it.

    Parameters
    ----------
    a, b : (D, H, W, C) arrays
        Of one dtype.
    data_range : float or None
        As for :func:`toposeam.find_surface`.
    """
    one, other = (as_shares(part, "frames", data_range).mean(axis=0) for part in (a, b))
    apart = one - other
    likeness = 1 / (1 + np.square(apart / _MAX_LIGHT_DIFFERENCE).sum(axis=2, keepdims=True)) ** 2
    reach = _LIGHT_BLUR * max(a.shape[1:3])
    light, share = (
        ndimage.gaussian_filter(part, (reach, reach, 0), mode="nearest")
        for part in (apart * likeness, likeness)
    )
    white = float(full_scale(a.dtype)) if data_range is None else data_range
    half = light / share * (white / 2)
    return add_change(a, -half), add_change(b, half)


def level_loop(
    frames: Volume,
    clip: Volume,
    jumps: Sequence[Jump],
    labels: Mapping[Jump, Mask],
    transition: int,
    moving: Mask,
) -> Volume:
    """Level a loop: spread the steps along its surfaces over the pixels around, except on still pixels.

    Parameters
    ----------
    frames : (P, H, W, C) array
        The loop.
    clip : (T, H, W, C) array
        The clip of which the loop was made.
    jumps : sequence of Jump
        The jumps in order; the first one's transition begins with the loop.
    labels : mapping from Jump to (D, H, W) bool arrays
        True where the entered stretch shows, within each transition of D frames.
    transition : int
        Number of frames D.
    moving : (H, W) bool array
        False on pixels that stand still.
    """
    # With this stiffness a step as wide as the frame fades within a transition.
    stiffness = (max(frames.shape[1:3]) / (2 * np.pi * transition)) ** 2
    result = np.empty_like(frames)
    for channel in range(frames.shape[3]):
        source = np.zeros(frames.shape[:3], np.float32)
        at = 0
        for jump, after in zip(jumps, [*jumps[1:], jumps[0]], strict=True):
            a, b = (clip[first:][:transition, ..., channel] for first in (jump.leaves, jump.enters))
            apart = np.where(moving, b.astype(np.float32) - a, np.float32(0))
            _add_surface(source[at : at + transition], labels[jump], apart, moving, stiffness)
            at += after.leaves - jump.enters
        correction = spread_in_cycle(source, stiffness)
        correction[:, ~moving] = 0
        for index, one in enumerate(correction):
            result[index, ..., channel] = add_change(frames[index, ..., channel], one)
    return result


def _add_surface(
    source: npt.NDArray[np.float32],
    label: Mask,
    apart: npt.NDArray[np.float32],
    moving: Mask,
    stiffness: float,
) -> None:
    """Add the steps across one surface to the source term of Poisson's equation.

    A step is the entered stretch minus the left one, in the mean of the two neighbours.
    """
    for axis, weight in enumerate((1.0, stiffness, stiffness)):
        low, high = along(axis, LOW), along(axis, HIGH)
        side = label[high].astype(np.int8) - label[low]
        add_steps(source, low, high, side * (apart[low] + apart[high]) / 2, weight)


def add_change(values: Volume, change: npt.NDArray[np.floating]) -> Volume:
    """Add a change to values, in the values' dtype."""
    sums: Volume = values + change
    return sums > 0.5 if values.dtype.kind == "b" else in_dtype(sums, values.dtype)
