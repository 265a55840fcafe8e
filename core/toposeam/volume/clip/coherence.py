"""Patches of a loop that its clip never shows: doubled heads, halved things, leaps of what moves.

Each small patch of two successive frames is looked for in the clip, about the same place, in the two
stretches that overlap and in moments spread over the clip. (Wexler, Shechtman and Irani, "Space-time
completion of video", PAMI 2007, make what has a likeness everywhere; here what has none is told.) The
distance from the nearest likeness is divided by the distance that the clip's own patches have there from
other moments of the clip. So what never repeats, as water, hides much, and a thing that moves does not hide
its own double.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam import _kernels
from toposeam.arrays import Floats32

#: Side of a patch, and how far from its place likenesses are looked for, in reduced px.
_PATCH, _REACH = 5, 1
#: Frames between a patch of the clip and the moments that count as others.
_APART = 3
#: Number of moments, about, among which likenesses are looked for; and for which the clip's own distances are
#: found, over the clip and in each stretch.
MOMENTS, _OWN = 40, (8, 4)
#: Quantile of the clip's own distances that is usual, below half of them, so that a hand that passes now and
#: then does not hide its own cut; and a distance, as a share of white, that nobody sees.
_USUAL, UNSEEN = 0.4, 0.02


def strangeness(made: Floats32, clip: Floats32, leaves: int, enters: int) -> Floats32:
    """Compute how far each place of a transition is from all that the clip shows there.

    Parameters
    ----------
    made : (D + 2, h, w) float32 array
        The frame before the transition, its D frames and the one after it, gray, without slow light.
    clip : (T, h, w) float32 array
        The clip, alike.
    leaves, enters : int
        First frames of the two stretches.

    Returns
    -------
    (D + 1, h, w) float32 array
        Distance of the patches of two successive frames, as a multiple of what is usual there.
    """
    last = len(clip) - 2
    spread = np.linspace(0, last, min(MOMENTS, last + 1)).astype(int)
    around = np.arange(-1, 2)
    places = range(len(made) - 1)
    near = [np.clip([leaves + place - 1 + around, enters + place - 1 + around], 0, last) for place in places]
    found = _distances(made, places, clip, [np.union1d(spread, moments) for moments in near])
    depth = len(made) - 2
    own = np.unique(
        np.concatenate(
            [
                np.linspace(0, last, min(_OWN[0], last + 1)).astype(int),
                *(
                    np.clip(first + np.linspace(0, depth, _OWN[1]).astype(int), 0, last)
                    for first in (leaves, enters)
                ),
            ]
        )
    )
    beside = np.array([-_APART - 1, -_APART, _APART, _APART + 1])
    others = [np.union1d(spread, np.clip(moment + beside, 0, last)) for moment in own]
    apart = [there[np.abs(there - moment) >= _APART] for there, moment in zip(others, own, strict=True)]
    known = [(moment, there) for moment, there in zip(own, apart, strict=True) if len(there)]
    if not known:
        return np.zeros_like(found)
    usual = _distances(clip, [moment for moment, _ in known], clip, [there for _, there in known])
    level = ndimage.maximum_filter(np.quantile(usual, _USUAL, axis=0), 3)
    result: Floats32 = (found / (level + UNSEEN)).astype(np.float32)
    return result


def _distances(
    frames: Floats32, places: Sequence[int], clip: Floats32, moments: Sequence[npt.NDArray[np.int_]]
) -> Floats32:
    """Compute the distance of each patch of two successive frames from its nearest likeness, (K, h, w)."""
    height, width = clip.shape[1:]
    if _kernels.library is not None and min(height, width) >= _PATCH:
        least = np.empty((len(places), height, width), np.float32)
        first = np.cumsum([0, *map(len, moments)], dtype=np.int32)
        frames, clip = np.ascontiguousarray(frames), np.ascontiguousarray(clip)
        numbers = np.concatenate(moments).astype(np.int32)
        sides = (len(places), height, width, _PATCH // 2, _REACH)
        wanted = np.array(places, np.int32)
        if _kernels.library.nearest_patches(*sides, frames, wanted, clip, first, numbers, least):
            raise MemoryError
        least /= 2
        return np.sqrt(least, out=least)
    padded = np.pad(clip, ((0, 0), (_REACH, _REACH), (_REACH, _REACH)), mode="edge")
    size = (0, min(_PATCH, height), min(_PATCH, width))
    least = np.full((len(places), height, width), np.inf, np.float32)
    for index, place in enumerate(places):
        there = moments[index]
        for down in range(2 * _REACH + 1):
            for right in range(2 * _REACH + 1):
                shifted = padded[:, down : down + height, right : right + width]
                squares = np.square(shifted[there] - frames[place])
                squares += np.square(shifted[there + 1] - frames[place + 1])
                means = ndimage.uniform_filter(squares, size, mode="nearest")
                np.minimum(least[index], means.min(axis=0), out=least[index])
    result: Floats32 = np.sqrt(np.maximum(least, 0) / 2)
    return result
