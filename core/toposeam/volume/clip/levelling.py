"""Light of loops levelled: what is lighter or darker after a jump than before it comes about smoothly.

The surface is found between stretches from which slow light has been taken. What steps are left along it, of
light or of form, are then spread over the frames and pixels around, by Poisson's equation in time and space
(:mod:`toposeam.heat.poisson`): the more gently the wider they are. No picture is laid over another one.
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

#: Light is the same within this share of the longer side, ...
_LIGHT = 0.15
#: ... and where pixels differ by more than this share of white, they show something else.
_OTHER = 0.05


def without_light(a: Volume, b: Volume, data_range: float | None) -> tuple[Volume, Volume]:
    """Remove from two stretches of a clip the slow light by which they differ on the whole, for finding a
    surface between them: half of the difference is taken from either.

    Parameters
    ----------
    a, b : (D, H, W, C) arrays
        Of one dtype.
    data_range : float or None
        As for :func:`toposeam.find_surface`.
    """
    one, other = (as_shares(part, "frames", data_range).mean(axis=0) for part in (a, b))
    apart = one - other
    likeness = 1 / (1 + np.square(apart / _OTHER).sum(axis=2, keepdims=True)) ** 2
    reach = _LIGHT * max(a.shape[1:3])
    light, share = (
        ndimage.gaussian_filter(part, (reach, reach, 0), mode="nearest")
        for part in (apart * likeness, likeness)
    )
    white = float(full_scale(a.dtype)) if data_range is None else data_range
    half = light / share * (white / 2)
    return added(a, -half), added(b, half)


def levelled(
    frames: Volume,
    clip: Volume,
    jumps: Sequence[Jump],
    labels: Mapping[Jump, Mask],
    transition: int,
    moving: Mask,
) -> Volume:
    """Return a loop with the steps along its surfaces spread around them, wherever it moves.

    Parameters
    ----------
    frames : (P, H, W, C) array
        The loop.
    clip : (T, H, W, C) array
        What it was made of.
    jumps : sequence of Jump
        In their order; the first one's transition begins with the loop.
    labels : mapping from Jump to (D, H, W) bool arrays
        Within each transition of D frames, where what it enters shows.
    transition : int
    moving : (H, W) bool array
    """
    # What is as wide as the frame fades within a transition.
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
            result[index, ..., channel] = added(frames[index, ..., channel], one)
    return result


def _add_surface(
    source: npt.NDArray[np.float32],
    label: Mask,
    apart: npt.NDArray[np.float32],
    moving: Mask,
    stiffness: float,
) -> None:
    """Add the steps across one surface to a source: by how much what is entered is lighter, in the mean of
    the two neighbours.
    """
    for axis, weight in enumerate((1.0, stiffness, stiffness)):
        low, high = along(axis, LOW), along(axis, HIGH)
        side = label[high].astype(np.int8) - label[low]
        add_steps(source, low, high, side * (apart[low] + apart[high]) / 2, weight)


def added(values: Volume, change: npt.NDArray[np.floating]) -> Volume:
    """Add a change to values, in the values' dtype."""
    sums: Volume = values + change
    return sums > 0.5 if values.dtype.kind == "b" else in_dtype(sums, values.dtype)
