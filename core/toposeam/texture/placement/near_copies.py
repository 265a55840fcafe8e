"""Penalties on what shows near a window already, so that landmarks do not repeat near by."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.canvas.places import PlaceGrid
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.patch_search import box_sum

#: Distance within which two copies are near each other, as a share of an exemplar's shorter side.
NEAR = 0.5
#: Approximate number of pixels of the canvas that are sampled along each axis.
_SAMPLES = 64
#: Least number of samples along each axis of the reach where repeats are counted by their shifts.
_LEAST_SAMPLES = 12
#: Largest number of cells of the atlas, which bounds the time of that count.
_MOST_CELLS = 10_000
#: px², more than the square of any reach: marks places without room. Twice that still fits into 32 bits.
_TOO_FAR = np.int32(1 << 29)


def near_reach(atlas: Atlas) -> int:
    """Compute the distance within which two copies are near each other, px."""
    return round(NEAR * int(atlas.shapes.min(axis=1).max()))


class NearCopyPenalty:
    """Penalise places whose pixels show within reach of the window but not in it.

    The factor is 1 + strength × variety × share.

    Parameters
    ----------
    atlas : Atlas
    canvas : IndexCanvas
    variety : float
    """

    #: Per unit of variety.
    STRENGTH = 1.0

    def __init__(self, atlas: Atlas, canvas: IndexCanvas, variety: float) -> None:
        self._atlas, self._canvas, self._reach = atlas, canvas, near_reach(atlas)
        self.strength = self.STRENGTH * variety

    def factor(self, places: PlaceGrid) -> Floats32:
        """Compute the factor on the error of places, (n, m) float32."""
        factor = self.share(places)
        factor *= np.float32(self.strength)
        factor += np.float32(1)
        return factor

    def share(self, places: PlaceGrid) -> Floats32:
        """Compute the share of each place's pixels that show near by, (n, m) float32."""
        canvas, (top, left), (height, width) = self._canvas, places.at, places.shape
        step = max(1, (2 * self._reach + max(height, width)) // _SAMPLES)
        y, x = canvas.around(places.at, places.shape, self._reach, step)
        index = canvas.index.take(
            (y % canvas.shape[0])[:, np.newaxis] * canvas.shape[1] + x % canvas.shape[1]
        )
        shown = index >= 0
        shown[np.ix_((y >= top) & (y < top + height), (x >= left) & (x < left + width))] = False
        row, column = np.divmod(index[shown], np.int32(self._atlas.width))
        cells = np.zeros([-(-length // step) for length in self._atlas.usable.shape], bool)
        cells[row // step, column // step] = True
        box = max(1, height // step), max(1, width // step)
        return places.from_blocks(box_sum(cells, box).astype(np.float32) / np.float32(box[0] * box[1]), step)


class ObjectRepeatPenalty(NearCopyPenalty):
    """Penalise places of which much would show a second time near by, where landmarks stand out.

    A pixel of an exemplar that shows in two copies shows at two pixels of the canvas, as far from each other
    as the copies' shifts. So the part of a patch that would repeat near by follows, for every place at once,
    from the shifts of the copies round it and from the pixels that each of them shows.

    Parameters
    ----------
    atlas : Atlas
    canvas : IndexCanvas
    weight : (AH, AW) float32 array
        Weight of each pixel of the atlas.
    variety : float
    """

    STRENGTH = 2.0

    def __init__(self, atlas: Atlas, canvas: IndexCanvas, weight: Floats32, variety: float) -> None:
        super().__init__(atlas, canvas, variety)
        self._step = step = max(1, self._reach // _LEAST_SAMPLES, math.isqrt(weight.size // _MOST_CELLS))
        rows, columns = (-(-length // step) for length in weight.shape)
        room = ((0, rows * step - weight.shape[0]), (0, columns * step - weight.shape[1]))
        cells = np.pad(weight, room).reshape(rows, step, columns, step).mean(axis=(1, 3))
        self._shape = cells.shape
        #: Weight of each pixel of the atlas, flat, and at the end that of none: 0.
        self._weight = np.zeros(weight.size + 1, np.float32)
        wide = cells.repeat(step, axis=0).repeat(step, axis=1)
        self._weight[:-1] = wide[: weight.shape[0], : weight.shape[1]].ravel()

    def share(self, places: PlaceGrid) -> Floats32:
        """Compute the weight of the pixels that each place would bring to the window's empty pixels and that
        show within reach already, per px of the box round these: (n, m) float32.
        """
        (down, bottom), (right, end) = places.empty
        (top, left), (height, width) = (
            (places.at[0] + down, places.at[1] + right),
            (bottom - down, end - right),
        )
        step, long = self._step, np.int32
        index, y, x = self._seen(top, left, height, width)
        row, column = np.divmod(index, long(self._atlas.width))
        # For each pixel that shows: the places whose box holds it, and how far it would be from its copy.
        size, boxes, apart = [], [], []
        for at, shift, start, length, most in zip(
            (row, column), (row - y, column - x), (top, left), (height, width), self._shape, strict=True
        ):
            box = min(max(1, length // step), most)
            place = (at // long(step))[:, np.newaxis] - np.arange(box, dtype=long)
            away = place * long(step) - (shift + long(start))[:, np.newaxis]
            size.append(most - box + 1)
            apart.append(np.where((place >= 0) & (place < size[-1]), np.square(away), _TOO_FAR))
            boxes.append(place)
        distance = apart[0][:, :, np.newaxis] + apart[1][:, np.newaxis]
        # Pixels nearer than a step continue the copy, or nearly so.
        counts = (distance < self._reach**2) & (distance >= step**2)
        where = (boxes[0] * long(size[1]))[:, :, np.newaxis] + boxes[1][:, np.newaxis]
        weight = self._weight.take(index) / np.float32(counts.shape[1] * counts.shape[2])
        weighed = weight.repeat(np.count_nonzero(counts, axis=(1, 2)))
        total = np.bincount(where[counts], weighed, size[0] * size[1]).reshape(size).astype(np.float32)
        return places.from_blocks(total, step, (down + step // 2, right + step // 2))

    def _seen(
        self, top: int, left: int, height: int, width: int
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        """Find the pixels of weight round a window: flat indices, and their rows and columns on the canvas,
        which are counted on across its borders.
        """
        canvas = self._canvas
        y, x = canvas.around((top, left), (height, width), self._reach, self._step)
        index = canvas.index.take(
            (y % canvas.shape[0])[:, np.newaxis] * canvas.shape[1] + x % canvas.shape[1]
        )
        shown = self._weight.take(index, mode="wrap") > 0  # the last one where nothing shows
        shown[np.ix_((y >= top) & (y < top + height), (x >= left) & (x < left + width))] = False
        at = np.flatnonzero(shown)
        i, j = np.divmod(at, len(x))
        return index.ravel().take(at), y.take(i), x.take(j)
