"""A penalty on what would show a second time near by, for textures with objects on a ground.

A pixel of an exemplar that shows in two copies shows at two pixels of the canvas, as far from each other as
the copies' shifts: what of a patch would come twice near by follows, for every place at once, from the shifts
of the copies round it and from what each of them shows.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.canvas.places import PlaceGrid
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.placement.near_copies import Nearby

#: Least number of samples of the canvas in the reach along one axis.
_SAMPLED = 12
#: Largest number of cells of the atlas.
_PIXELS = 10_000
#: More than the square of any reach; twice that is no more than 32 bits hold.
_FAR = np.int32(1 << 29)


class Repeats(Nearby):
    """Penalise places of which much would show a second time near by.

    Parameters
    ----------
    atlas : Atlas
    canvas : IndexCanvas
    weight : (AH, AW) float32 array
        How much each pixel of the atlas counts.
    variety : float
    """

    STRENGTH = 2.0

    def __init__(self, atlas: Atlas, canvas: IndexCanvas, weight: Floats32, variety: float) -> None:
        super().__init__(atlas, canvas, variety)
        self._step = step = max(1, self._reach // _SAMPLED, math.isqrt(weight.size // _PIXELS))
        rows, columns = (-(-length // step) for length in weight.shape)
        room = ((0, rows * step - weight.shape[0]), (0, columns * step - weight.shape[1]))
        cells = np.pad(weight, room).reshape(rows, step, columns, step).mean(axis=(1, 3))
        self._shape = cells.shape
        #: What each pixel of the atlas weighs, flat, and at the end what none does.
        self._weight = np.zeros(weight.size + 1, np.float32)
        wide = cells.repeat(step, axis=0).repeat(step, axis=1)
        self._weight[:-1] = wide[: weight.shape[0], : weight.shape[1]].ravel()

    def share(self, places: PlaceGrid) -> Floats32:
        """Compute the weight of what would show at the window's empty pixels and shows within reach already,
        per px of their box, for each place: (n, m) float32.
        """
        (down, bottom), (right, end) = places.empty
        (top, left), (height, width) = (
            (places.at[0] + down, places.at[1] + right),
            (bottom - down, end - right),
        )
        step, long = self._step, np.int32
        index, y, x = self._seen(top, left, height, width)
        row, column = np.divmod(index, long(self._atlas.width))
        # The boxes of places that have each pixel, and how far it is then from where it shows.
        size, boxes, apart = [], [], []
        for at, shift, start, length, most in zip(
            (row, column), (row - y, column - x), (top, left), (height, width), self._shape, strict=True
        ):
            box = min(max(1, length // step), most)
            place = (at // long(step))[:, np.newaxis] - np.arange(box, dtype=long)
            away = place * long(step) - (shift + long(start))[:, np.newaxis]
            size.append(most - box + 1)
            apart.append(np.where((place >= 0) & (place < size[-1]), np.square(away), _FAR))
            boxes.append(place)
        distance = apart[0][:, :, np.newaxis] + apart[1][:, np.newaxis]
        # Nearer ones continue the copy, or nearly so.
        counts = (distance < self._reach**2) & (distance >= step**2)
        where = (boxes[0] * long(size[1]))[:, :, np.newaxis] + boxes[1][:, np.newaxis]
        weight = self._weight.take(index) / np.float32(counts.shape[1] * counts.shape[2])
        weighed = weight.repeat(np.count_nonzero(counts, axis=(1, 2)))
        total = np.bincount(where[counts], weighed, size[0] * size[1]).reshape(size).astype(np.float32)

        return places.from_blocks(total, step, (down + step // 2, right + step // 2))

    def _seen(
        self, top: int, left: int, height: int, width: int
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        """Find what weighs of what shows round a window: flat indices, and their rows and columns, which go
        on across borders.
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
