"""The objects of exemplars that are a ground with objects on it, and where a canvas shows each of them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from toposeam.arrays import Floats32, Indices, Ints32, Mask
from toposeam.texture.canvas.copy_borders import ROWS
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.exemplar.atlas import Atlas

#: Width, px, of the ring of ground round an object through which the seam round it may run.
SEAM_RING = 6
#: An object counts as cut if less than this share of its pixels shows; the rest allows for a few of its rim.
WHOLE_SHARE = 0.985
#: Width, px, of the fringe round an object that is replaced with it.
_FRINGE = 2
#: An object touches its exemplar's border, and counts as cut, if at least this many border pixels next to it
#: differ from the ground by half as much as the object's mean: fewer count as noise.
_LEAST_BORDER_PIXELS = 3
#: Width, px, of the rim of exemplars that is left out when their coverage by objects is measured: on many
#: exemplars no object lies there.
_RIM = 4

At = tuple[int, int]
#: Number of an object, and row and column of the canvas where its middle lies.
Key = tuple[int, int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Object:
    """One object of an exemplar."""

    #: Row and column of its middle on the atlas.
    middle: At
    #: (n, 2) its pixels, and those of ground round it, from its middle on.
    pixels: Indices
    ring: Indices
    #: Largest distance of its pixels from its middle along either axis, px.
    reach: int
    #: Whether all of it lies in its exemplar, as far as can be seen.
    whole: bool


class ObjectCatalog:
    """The objects of an atlas, numbered, and where a canvas shows them.

    Parameters
    ----------
    guard : (AH * AW,) float32 array
        Above 0 where there is an object.
    features : (AH, AW, F) float32 array
    atlas : Atlas
    canvas : IndexCanvas
    """

    def __init__(self, guard: Floats32, features: Floats32, atlas: Atlas, canvas: IndexCanvas) -> None:
        self.atlas, self.canvas = atlas, canvas
        # Landmarks are found in a blurred picture, where objects are a little too large.
        core = ndimage.binary_erosion(guard.reshape(atlas.usable.shape) > 0, border_value=1)
        marks = ndimage.label(core)[0].astype(np.int32)
        #: (AH, AW) int32, the number of the object at each pixel, from 1 on, and the same with its fringe.
        self.marks: Ints32 = marks
        self.fringed = np.where(marks > 0, marks, ndimage.grey_dilation(marks, (2 * _FRINGE + 1,) * 2))
        bare = atlas.copied & (marks == 0)
        ground = np.median(features[bare], axis=0) if bare.any() else np.float32(0)
        #: (AH, AW) float32: distance of each pixel's features from the median ground.
        self._unlike = np.sqrt(np.square(features - ground).sum(axis=2))
        #: (AH, AW) bool: pixels on an exemplar's border.
        self._border = atlas.copied & ~ndimage.binary_erosion(atlas.copied)
        self.all = [self._object(number, box) for number, box in enumerate(ndimage.find_objects(marks), 1)]
        self._middles = np.array([one.middle for one in self.all], np.intp).reshape(-1, 2)

    def shown(self) -> Counter[Key]:
        """Count the pixels that show of each object on the canvas."""
        found: Counter[Key] = Counter()
        index = self.canvas.index
        for top in range(0, index.shape[0] if self.all else 0, ROWS):
            part = index[top : top + ROWS]
            y, x = np.divmod(np.arange(part.size), index.shape[1])
            found.update(self.at(y + top, x, part.ravel()))
        return found

    def at(self, y: Indices, x: Indices, index: Ints32) -> Counter[Key]:
        """Count the pixels of each object among some pixels of the canvas, given by rows, columns and flat
        indices, (n,) each.
        """
        number = self.marks.ravel().take(np.maximum(index, 0)) * (index >= 0)
        on = np.flatnonzero(number)
        number = number.take(on) - 1
        far = 1 << 20  # more than any row or column
        both = number.astype(np.int64)
        shown = np.divmod(index.take(on).astype(np.int64), self.atlas.width)
        for axis, (place, limit, wraps) in enumerate(
            zip((y, x), self.canvas.shape, self.canvas.wrap, strict=True)
        ):
            middle = place.take(on) - shown[axis] + self._middles[:, axis].take(number)
            both = both * (2 * far) + far + (middle % limit if wraps else middle)
        found: Counter[Key] = Counter()
        for one, count in zip(*np.unique(both, return_counts=True), strict=True):
            rest, right = divmod(int(one), 2 * far)
            which, down = divmod(rest, 2 * far)
            found[which, down - far, right - far] = int(count)
        return found

    def key(self, number: int, row: int, column: int) -> Key:
        """Make the key of an object whose middle lies at a row and column of the canvas, or beyond a border
        of it.
        """
        height, width = (
            limit if wraps else 0 for limit, wraps in zip(self.canvas.shape, self.canvas.wrap, strict=True)
        )
        return number, row % height if height else row, column % width if width else column

    def room(self, key: Key) -> int:
        """Count the pixels of an object that lie on the canvas, covered or not."""
        one = self.all[key[0]]
        if all(
            wraps or one.reach <= middle < limit - one.reach
            for middle, limit, wraps in zip(key[1:], self.canvas.shape, self.canvas.wrap, strict=True)
        ):
            return len(one.pixels)
        pixels = one.pixels + key[1:]
        inside = np.ones(len(pixels), bool)
        for axis, (limit, wraps) in enumerate(zip(self.canvas.shape, self.canvas.wrap, strict=True)):
            if not wraps:
                inside &= (pixels[:, axis] >= 0) & (pixels[:, axis] < limit)
        return int(inside.sum())

    def density(self) -> float:
        """Compute the share of the exemplars that objects cover, without the exemplars' rims."""
        inner = ndimage.binary_erosion(self.atlas.copied, np.ones((3, 3)), _RIM)
        return float(np.mean(self.marks[inner] > 0)) if inner.any() else 0.0

    def is_cut(self, key: Key) -> bool:
        """Test whether an object is cut on the canvas or by its exemplar's border."""
        one = self.all[key[0]]
        if not one.whole:
            return True
        places = (np.array(one.middle) + one.pixels) @ (self.atlas.width, 1)
        top, left, side = key[1] - one.reach, key[2] - one.reach, 2 * one.reach + 1
        known = self.canvas.read(top, left, side, side)
        shown = np.count_nonzero(known[tuple((one.pixels + one.reach).T)] == places)
        return bool(shown < WHOLE_SHARE * max(self.room(key), 1))

    def mask_of(self, key: Key, known: Ints32, top: int, left: int) -> Mask:
        """Find where a window of the canvas shows an object and its fringe: (h, w) bool.

        Parameters
        ----------
        key : (int, int, int)
        known : (h, w) int32 array
            Flat indices of the pixels that the window shows; -1 where it shows none.
        top, left : int
            First pixel of the window on the canvas.
        """
        y, x = np.arange(known.shape[0])[:, np.newaxis], np.arange(known.shape[1])[np.newaxis]
        lines = []
        for line, first, at, middle, limit, wraps in zip(
            (y, x),
            (top, left),
            key[1:],
            self.all[key[0]].middle,
            self.canvas.shape,
            self.canvas.wrap,
            strict=True,
        ):
            away = (first - at + limit // 2) % limit - limit // 2 if wraps else first - at
            lines.append(middle + away + line)
        seen: Mask = known == lines[0] * self.atlas.width + lines[1]
        seen &= self.fringed.ravel()[np.maximum(known, 0)] == key[0] + 1
        return seen

    def _object(self, number: int, box: tuple[slice, slice]) -> Object:
        top, left = (max(side.start - SEAM_RING, 0) for side in box)
        around = slice(top, box[0].stop + SEAM_RING), slice(left, box[1].stop + SEAM_RING)
        marks = self.marks[around]
        own = marks == number
        ring = ndimage.binary_dilation(own, iterations=SEAM_RING) & (marks == 0)
        unlike = self._unlike[around]
        on_border = unlike[ndimage.binary_dilation(own) & self._border[around]]
        middle = (box[0].start + box[0].stop - 1) // 2, (box[1].start + box[1].stop - 1) // 2
        offset = np.array([top - middle[0], left - middle[1]])
        pixels = np.argwhere(own) + offset
        return Object(
            middle=middle,
            pixels=pixels,
            ring=np.argwhere(ring) + offset,
            reach=int(np.abs(pixels).max()),
            whole=int(np.count_nonzero(on_border > unlike[own].mean() / 2)) < _LEAST_BORDER_PIXELS,
        )
