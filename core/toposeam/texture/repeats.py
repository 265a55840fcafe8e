"""How much of a patch would show a second time near by, for textures with objects on a ground.

A pixel of an exemplar that shows in two copies shows at two pixels of the canvas, as far from each other as
the copies' shifts: what of a patch would come twice near by follows, for every place at once, from the shifts
of the copies round it and from what each of them shows.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from toposeam.texture.atlas import Atlas, Floats32
from toposeam.texture.canvas import IndexCanvas

#: Within this share of an exemplar's shorter side two copies are near each other.
_REACH = 0.5
#: So many times in the reach, at least, the canvas is looked at along one axis.
_SAMPLED = 12
#: Of so many pixels of the atlas, at most, each is looked at.
_PIXELS = 10_000
#: More than the square of any reach; twice that is no more than 32 bits hold.
_FAR = np.int32(1 << 29)


class Repeats:
    """Tells how much of a patch would show a second time near by.

    Parameters
    ----------
    atlas : Atlas
    canvas : IndexCanvas
    weight : (AH, AW) float32 array
        How much each pixel of the atlas counts.
    """

    def __init__(self, atlas: Atlas, canvas: IndexCanvas, weight: Floats32) -> None:
        self._atlas, self._canvas = atlas, canvas
        #: Within so many px two copies are near each other.
        self.reach = round(_REACH * int(atlas.shapes.min(axis=1).max()))
        self._step = step = max(1, self.reach // _SAMPLED, math.isqrt(weight.size // _PIXELS))
        rows, columns = (-(-length // step) for length in weight.shape)
        room = ((0, rows * step - weight.shape[0]), (0, columns * step - weight.shape[1]))
        cells = np.pad(weight, room).reshape(rows, step, columns, step).mean(axis=(1, 3))
        self._shape = cells.shape
        #: What each pixel of the atlas weighs, flat, and at the end what none does.
        self._weight = np.zeros(weight.size + 1, np.float32)
        wide = cells.repeat(step, axis=0).repeat(step, axis=1)
        self._weight[:-1] = wide[: weight.shape[0], : weight.shape[1]].ravel()

    def share(
        self, top: int, left: int, height: int, width: int
    ) -> Callable[[int, int, int, tuple[int, ...]], Floats32]:
        """For places of the atlas, how much of what would show in a window shows within reach already.

        Parameters
        ----------
        top, left, height, width : int
            The window, canvas px; what it shows now does not count.

        Returns
        -------
        callable
            For the row and column of the atlas that the window's first pixel shows at the first place, a
            factor and a shape, the (n, m) weights on a grid of places, per px of the window.
        """
        step, long = self._step, np.int32
        index, y, x = self._seen(top, left, height, width)
        row, column = np.divmod(index, long(self._atlas.width))
        # The boxes of places that have each pixel, and how far it is then from where it shows.
        size, places, apart = [], [], []
        for at, shift, start, length, most in zip(
            (row, column), (row - y, column - x), (top, left), (height, width), self._shape, strict=True
        ):
            box = min(max(1, length // step), most)
            place = (at // long(step))[:, np.newaxis] - np.arange(box, dtype=long)
            away = place * long(step) - (shift + long(start))[:, np.newaxis]
            size.append(most - box + 1)
            apart.append(np.where((place >= 0) & (place < size[-1]), np.square(away), _FAR))
            places.append(place)
        distance = apart[0][:, :, np.newaxis] + apart[1][:, np.newaxis]
        # Nearer ones continue the copy, or nearly so.
        counts = (distance < self.reach**2) & (distance >= step**2)
        where = (places[0] * long(size[1]))[:, :, np.newaxis] + places[1][:, np.newaxis]
        weight = self._weight.take(index) / np.float32(counts.shape[1] * counts.shape[2])
        weighed = weight.repeat(np.count_nonzero(counts, axis=(1, 2)))
        total = np.bincount(where[counts], weighed, size[0] * size[1]).reshape(size).astype(np.float32)

        def on_grid(row: int, column: int, factor: int, shape: tuple[int, ...]) -> Floats32:
            rows, columns = (
                np.minimum((first + factor * np.arange(n) + step // 2) // step, limit - 1)
                for first, n, limit in zip((row, column), shape, total.shape, strict=True)
            )
            result: Floats32 = total.take(rows, axis=0).take(columns, axis=1)
            return result

        return on_grid

    def _seen(
        self, top: int, left: int, height: int, width: int
    ) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], npt.NDArray[np.int32]]:
        """What weighs of what shows round a window: flat indices, and their rows and columns, which go on
        across borders.
        """
        canvas, lines = self._canvas, []
        for start, length, limit, wraps in zip(
            (top, left), (height, width), canvas.shape, canvas.wrap, strict=True
        ):
            # The opposite side of a small torus is not near twice.
            most = min(self.reach, max((limit - length) // 2, 0)) if wraps else self.reach
            line = np.arange(start - most, start + length + most, self._step, dtype=np.int32)
            lines.append(line if wraps else line[(line >= 0) & (line < limit)])
        y, x = lines
        index = canvas.index.take(
            (y % canvas.shape[0])[:, np.newaxis] * canvas.shape[1] + x % canvas.shape[1]
        )
        shown = self._weight.take(index, mode="wrap") > 0  # the last one where nothing shows
        shown[np.ix_((y >= top) & (y < top + height), (x >= left) & (x < left + width))] = False
        at = np.flatnonzero(shown)
        i, j = np.divmod(at, len(x))
        return index.ravel().take(at), y.take(i), x.take(j)
