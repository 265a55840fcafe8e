"""Find objects, or ground, that fit where an object of a finished texture has to go."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from toposeam.arrays import Indices, Ints32, Mask
from toposeam.images import box_of
from toposeam.texture.exemplar.atlas import values_at
from toposeam.texture.objects.object_catalog import At, Key, ObjectCatalog
from toposeam.texture.placement.patch_placer import PatchPlacer

#: Distance, px, between neighbouring places that are tried for an object's middle.
PLACE_STEP = 3
#: Distance, px, from an object within which a cut one touches it and may go with it.
_TOUCHING = 3
#: Approximate number of places of the atlas that are compared where ground replaces an object.
_GROUND_PLACES = 400
#: Width, px, of the rim round an object by which ground is compared.
_GROUND_RIM = 2


def diamond_dilation(mask: Mask, steps: int = 1) -> Mask:
    """Dilate a mask by a diamond of some steps; on small masks this is faster than
    :func:`scipy.ndimage.binary_dilation`.

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
class ObjectWindow:
    """A square of the canvas round an object that has to go."""

    #: First row and column on the canvas.
    top: int
    left: int
    #: (n, n) int32 flat indices of what it shows, -1 off the canvas; and where it is on the canvas.
    known: Ints32
    inside: Mask
    #: (n, n) bool: pixels that have to go, and pixels of objects that stay.
    goes: Mask
    busy: Mask
    #: Number of pixels that go, by object.
    gone: dict[Key, int]

    @cached_property
    def beside_others(self) -> Mask:
        """(n²,) bool: pixels of objects that stay, and pixels next to them."""
        return diamond_dilation(self.busy).ravel()

    @cached_property
    def ground(self) -> Mask:
        """(n²,) bool: ground that stays."""
        return np.asarray(self.inside.ravel() & ~self.goes.ravel() & ~self.beside_others)


class ObjectFit(NamedTuple):
    """An object, or ground, that could be laid over a window."""

    #: Mean squared difference from the ground round it, in units of the features.
    error: float
    #: Number of the object; -1 for ground.
    number: int
    #: Place of the window's first pixel on the atlas.
    place: At


class ObjectFits:
    """Finds what fits over windows of a placer's canvas, without changing it.

    Parameters
    ----------
    placer : PatchPlacer
    catalog : ObjectCatalog
        Of the placer's atlas and canvas.
    """

    def __init__(self, placer: PatchPlacer, catalog: ObjectCatalog) -> None:
        self._features, self._atlas, self._catalog = placer.features, placer.atlas, catalog
        self._bare = placer.atlas.copied & ~diamond_dilation(catalog.marks > 0)

    def window(self, key: Key, around: int, with_touching: bool = False) -> ObjectWindow:
        """Read the canvas within some px of an object's middle.

        Parameters
        ----------
        key : (int, int, int)
            The object that has to go.
        around : int
            px to each side of its middle.
        with_touching : bool
            Whether cut objects that touch it have to go as well.
        """
        catalog = self._catalog
        top, left, side = key[1] - around, key[2] - around, 2 * around + 1
        known = catalog.canvas.read(top, left, side, side)
        inside = known >= 0
        shown = (catalog.marks.ravel()[np.maximum(known, 0)] > 0) & inside
        goes = catalog.mask_of(key, known, top, left)
        gone = {key: int(np.count_nonzero(goes & shown))}
        if with_touching:
            y, x = np.nonzero(diamond_dilation(goes, _TOUCHING) & shown & ~goes)
            for other in catalog.at(y + top, x + left, known[y, x]):
                if catalog.is_cut(other):
                    seen = catalog.mask_of(other, known, top, left)
                    gone[other] = int(np.count_nonzero(seen & shown))
                    goes |= seen
        return ObjectWindow(top, left, known, inside, goes, shown & ~goes, gone)

    def rooms(
        self, window: ObjectWindow, numbers: list[int], steps_aside: int
    ) -> Iterator[tuple[int, Indices]]:
        """Yield each whole object for which a window has room, and where its middle may lie: flat indices of
        the window, up to some steps from its middle.
        """
        side, busy = len(window.known), window.beside_others
        line = side // 2 + PLACE_STEP * np.arange(-steps_aside, steps_aside + 1)
        middles = (line[:, np.newaxis] * side + line).ravel()
        for number in numbers:
            one = self._catalog.all[number]
            if one.whole:
                at = middles[:, np.newaxis] + one.pixels @ (side, 1)
                taken = busy.take(at).any(axis=1)
                if not taken.all():
                    yield number, middles[~taken]

    def objects(self, window: ObjectWindow, numbers: list[int], steps_aside: int) -> list[ObjectFit]:
        """List the fits of some objects: the ground round each is compared with that of the window."""
        found, features = [], self._features.reshape(self._atlas.usable.size, -1)
        side, known = len(window.known), None
        for number, middles in self.rooms(window, numbers, steps_aside):
            known = values_at(self._features, window.known.ravel()) if known is None else known
            one = self._catalog.all[number]
            at = middles[:, np.newaxis] + (one.ring[:, 0] * side + one.ring[:, 1])
            counts = window.ground.take(at)
            apart = known.take(at, axis=0)
            apart -= features.take((one.ring + one.middle) @ (self._atlas.width, 1), axis=0)
            errors = np.einsum("mrc,mrc,mr->m", apart, apart, counts.astype(np.float32))
            errors /= np.maximum(np.count_nonzero(counts, axis=1), 1)
            for error, middle in zip(errors.tolist(), middles.tolist(), strict=True):
                place = one.middle[0] - middle // side, one.middle[1] - middle % side
                found.append(ObjectFit(error, number, place))
        return found

    def grounds(self, window: ObjectWindow) -> list[ObjectFit]:
        """List the fits of bare ground over what has to go."""
        width = self._atlas.width
        box = box_of(window.goes)
        rows, columns = (
            max(limit - side.stop + side.start, 0) for limit, side in zip(self._bare.shape, box, strict=True)
        )
        step = max(1, round((rows * columns / _GROUND_PLACES) ** 0.5))
        grid = np.mgrid[step // 2 : rows : step, step // 2 : columns : step].reshape(2, -1).T
        places = grid - (box[0].start, box[1].start)
        y, x = np.nonzero(window.goes)
        covers = self._bare.ravel()[(places @ (width, 1))[:, np.newaxis] + y * width + x].all(axis=1)
        places = places[covers]
        rim = diamond_dilation(window.goes, _GROUND_RIM) & ~window.goes & ~window.busy & window.inside
        y, x = np.nonzero(rim)
        at = (places @ (width, 1))[:, np.newaxis] + y * width + x
        free = (at >= 0) & (at < self._bare.size)
        free &= self._bare.ravel()[at * free]
        apart = values_at(self._features, at * free) - values_at(self._features, window.known[y, x])
        error = (np.square(apart).sum(axis=2) * free).sum(axis=1) / np.maximum(free.sum(axis=1), 1)
        unsure = 2 * free.sum(axis=1) < len(y)  # less than half of the rim can be compared: error + 1
        return [
            ObjectFit(one, -1, (row, column))
            for one, (row, column) in zip((error + unsure).tolist(), places.tolist(), strict=True)
        ]
