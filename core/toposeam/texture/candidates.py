"""What could be laid over an object: others that have room there, or ground."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from toposeam.images import Mask, box_of
from toposeam.texture.atlas import Atlas, Floats32, Ints32, values_at
from toposeam.texture.objects import At, Key, Objects
from toposeam.texture.search import Ints

#: px between the places beside a middle that are tried.
STEP = 3
#: So many places are compared, about, where ground replaces what is left of an object.
_GROUNDS = 400


def diamond_dilation(mask: Mask, steps: int = 1) -> Mask:
    """What is at most so many steps from where a mask is True, its dilation by a diamond: on small masks
    sooner than :func:`scipy.ndimage.binary_dilation`.

    Examples
    --------
    >>> diamond_dilation(np.eye(1, 5, 2, dtype=bool)).astype(int).tolist()
    [[0, 1, 1, 1, 0]]
    """
    for _ in range(steps):
        grown = mask.copy()
        grown[1:] |= mask[:-1]
        grown[:-1] |= mask[1:]
        grown[:, 1:] |= mask[:, :-1]
        grown[:, :-1] |= mask[:, 1:]
        mask = grown
    return mask


@dataclass(frozen=True, eq=False)
class Window:
    """What a canvas shows round a place."""

    top: int
    left: int
    known: Ints32
    inside: Mask
    #: What has to go, how many pixels of which objects that is, and where others are.
    goes: Mask
    gone: dict[Key, int]
    busy: Mask

    @cached_property
    def beside_others(self) -> Mask:
        """Where other objects are, or next to it: flat."""
        return diamond_dilation(self.busy).ravel()

    @cached_property
    def ground(self) -> Mask:
        """What shows ground that stays: flat."""
        ground: Mask = self.inside.ravel() & ~self.goes.ravel() & ~self.beside_others
        return ground


class Fit(NamedTuple):
    """Something that could be laid there."""

    error: float
    #: Which object; -1 for ground.
    number: int
    #: Place of the window's first pixel on the atlas.
    place: At


class Candidates:
    """Finds what could be laid in a window.

    Parameters
    ----------
    features : (AH, AW, F) float32 array
    atlas : Atlas
    objects : Objects
    """

    def __init__(self, features: Floats32, atlas: Atlas, objects: Objects) -> None:
        self._features, self._atlas, self._objects = features, atlas, objects
        self._bare = atlas.copied & ~diamond_dilation(objects.marks > 0)

    def rooms(self, window: Window, numbers: list[int], aside: int) -> Iterator[tuple[int, Ints]]:
        """Which of some objects have room in the middle of a window, or beside it, and where their middles
        may lie then: flat indices of the window.
        """
        side, busy = len(window.known), window.beside_others
        line = side // 2 + STEP * np.arange(-aside, aside + 1)
        middles = (line[:, np.newaxis] * side + line).ravel()
        for number in numbers:
            one = self._objects.all[number]
            if one.whole:
                taken = busy.take(middles[:, np.newaxis] + (one.pixels[:, 0] * side + one.pixels[:, 1])).any(
                    axis=1
                )
                if not taken.all():
                    yield number, middles[~taken]

    def fits(self, window: Window, numbers: list[int], aside: int) -> list[Fit]:
        """Where in the middle of a window, or beside it, some objects have room, and how well they fit."""
        found, features = [], self._features.reshape(self._atlas.usable.size, -1)
        side, known = len(window.known), None
        for number, middles in self.rooms(window, numbers, aside):
            known = values_at(self._features, window.known.ravel()) if known is None else known
            one = self._objects.all[number]
            at = middles[:, np.newaxis] + (one.ring[:, 0] * side + one.ring[:, 1])
            counts = window.ground.take(at)
            apart = known.take(at, axis=0)
            apart -= features.take((one.ring + one.middle) @ (self._atlas.width, 1), axis=0)
            errors = np.einsum("mrc,mrc,mr->m", apart, apart, counts.astype(np.float32))
            errors /= np.maximum(np.count_nonzero(counts, axis=1), 1)
            for error, middle in zip(errors.tolist(), middles.tolist(), strict=True):
                place = one.middle[0] - middle // side, one.middle[1] - middle % side
                found.append(Fit(error, number, place))
        return found

    def grounds(self, window: Window) -> list[Fit]:
        """Ground for what has to go in a window."""
        width, features = self._atlas.width, self._features
        box = box_of(window.goes)
        rows, columns = (
            max(limit - side.stop + side.start, 0) for limit, side in zip(self._bare.shape, box, strict=True)
        )
        step = max(1, round((rows * columns / _GROUNDS) ** 0.5))
        grid = np.mgrid[step // 2 : rows : step, step // 2 : columns : step].reshape(2, -1).T
        places = grid - (box[0].start, box[1].start)
        y, x = np.nonzero(window.goes)
        covers = self._bare.ravel()[(places @ (width, 1))[:, np.newaxis] + y * width + x].all(axis=1)
        places = places[covers]
        rim = diamond_dilation(window.goes, 2) & ~window.goes & ~window.busy & window.inside
        y, x = np.nonzero(rim)
        at = (places @ (width, 1))[:, np.newaxis] + y * width + x
        free = (at >= 0) & (at < self._bare.size)
        free &= self._bare.ravel()[at * free]
        off = values_at(features, at * free) - values_at(features, window.known[y, x])
        error = (np.square(off).sum(axis=2) * free).sum(axis=1) / np.maximum(free.sum(axis=1), 1)
        few = 2 * free.sum(axis=1) < len(y)  # hardly anything to go by
        return [
            Fit(one, -1, (row, column))
            for one, (row, column) in zip((error + few).tolist(), places.tolist(), strict=True)
        ]
