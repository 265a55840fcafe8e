"""What shows near a place of the canvas, so that the same landmark does not come twice within sight."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from toposeam.texture.atlas import Atlas, Floats32
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.search import box_sum

#: Within this share of an exemplar's shorter side two copies are near each other.
_REACH = 0.5
#: Pixels of the canvas, about, that are looked at along one axis.
_SAMPLED = 64


class Nearby:
    """Tells which part of a patch shows near by already.

    Parameters
    ----------
    atlas : Atlas
    canvas : IndexCanvas
    """

    def __init__(self, atlas: Atlas, canvas: IndexCanvas) -> None:
        self._atlas, self._canvas = atlas, canvas
        #: Within so many px two copies are near each other.
        self.reach = round(_REACH * int(atlas.shapes.min(axis=1).max()))

    def share(
        self, top: int, left: int, height: int, width: int
    ) -> Callable[[int, int, tuple[int, ...]], Floats32]:
        """The share of each place's pixels that show within reach of a window but not in it.

        Parameters
        ----------
        top, left, height, width : int
            The window, canvas px.

        Returns
        -------
        callable
            For a margin, a factor and a shape, the (n, m) shares on the grid of the search.
        """
        canvas, reach = self._canvas, self.reach
        step = max(1, (2 * reach + max(height, width)) // _SAMPLED)
        axes = []
        for start, length, limit, wraps in zip(
            (top, left), (height, width), canvas.shape, canvas.wrap, strict=True
        ):
            # The opposite side of a small torus is not near twice.
            most = min(reach, max((limit - length) // 2, 0)) if wraps else reach
            line = np.arange(start - most, start + length + most, step)
            axes.append(line % limit if wraps else line[(line >= 0) & (line < limit)])
        index = canvas.index[np.ix_(*axes)]
        inside = np.ix_(
            *(
                (line - start) % limit < length
                for line, start, length, limit in zip(
                    axes, (top, left), (height, width), canvas.shape, strict=True
                )
            )
        )
        shown = index >= 0
        shown[inside] = False
        row, column = np.divmod(index[shown], np.int32(self._atlas.width))
        size = tuple(-(-length // step) for length in self._atlas.usable.shape)
        cells = np.zeros(size, bool)
        cells[row // step, column // step] = True
        box = max(1, height // step), max(1, width // step)
        sums = box_sum(cells, box).astype(np.float32) / np.float32(box[0] * box[1])

        def on_grid(margin: int, factor: int, shape: tuple[int, ...]) -> Floats32:
            rows, columns = (
                np.minimum((margin + factor * np.arange(n)) // step, limit - 1)
                for n, limit in zip(shape, sums.shape, strict=True)
            )
            result: Floats32 = sums.take(rows, axis=0).take(columns, axis=1)
            return result

        return on_grid


def average_use(atlas: Atlas, area: int, shares: npt.NDArray[np.float64] | None) -> npt.NDArray[np.float64]:
    """(AH, 1): how often a usable pixel shows on average, by the atlas's row."""
    usable = atlas.usable.sum(axis=1)
    if shares is None:
        return np.full((len(usable), 1), max(area / max(int(usable.sum()), 1), 1.0))
    each = np.add.reduceat(usable, atlas.corners[:, 0])
    return np.maximum(area * shares / np.maximum(each, 1), 1.0)[atlas.owner_of_rows, np.newaxis]
