"""How often a canvas shows what, as places are judged by it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from toposeam.texture.atlas import Atlas, Floats32, Ints32
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.kinds import Kinds
from toposeam.texture.search import box_sum


class Use:
    """Of the canvas as it is: what it says of places of one shape is kept, as all of a wave ask the same.

    Parameters
    ----------
    canvas : IndexCanvas
    atlas : Atlas
    average, limit : (AH, 1) arrays, the limits int32
        How often pixels should show, and may at most, by the atlas's row.
    variety : float
        How much dearer a place is that shows as often as it should.
    kinds : Kinds, optional
        What kinds of pixels there are, each to show on its share.
    """

    def __init__(
        self,
        canvas: IndexCanvas,
        atlas: Atlas,
        average: npt.NDArray[np.float64],
        limit: Ints32,
        variety: float,
        kinds: Kinds | None = None,
    ) -> None:
        self._usage, self._average = canvas.usage.reshape(atlas.usable.shape), average
        self._limit, self._variety, self._kinds = limit, variety, kinds
        self._kept: dict[tuple[tuple[int, ...], ...], tuple[Floats32, Floats32 | None]] = {}

    def of_places(
        self, shape: tuple[int, int], grid: tuple[int, int], size: tuple[int, ...]
    ) -> tuple[Floats32, Floats32 | None]:
        """How much dearer places are for showing often, themselves or their kind, and what share of their
        pixels is used up, None where nothing is. Neither may be written to.

        Parameters
        ----------
        shape : (int, int)
            Height and width of the patch.
        grid : (int, int)
            First row, and column, of the places, and how far they are apart.
        size : (int, int)
            How many rows and columns of places there are.
        """
        if (shape, grid, size) not in self._kept:
            self._kept[shape, grid, size] = self._found(shape, grid, size)
        return self._kept[shape, grid, size]

    def _found(
        self, shape: tuple[int, int], grid: tuple[int, int], size: tuple[int, ...]
    ) -> tuple[Floats32, Floats32 | None]:
        pixels, on_grid = shape[0] * shape[1], (slice(grid[0], None, grid[1]),) * 2
        average = (pixels * self._average[on_grid[0]][: size[0]]).astype(np.float32)
        shown = box_sum(self._usage, shape)[on_grid][: size[0], : size[1]]
        dearer: Floats32 = np.divide(shown, average, dtype=np.float32)
        np.square(dearer, out=dearer)
        dearer *= np.float32(self._variety)
        dearer += np.float32(1)
        if self._kinds is not None:
            dearer *= self._kinds.dearer(self._usage, self._variety, shape, grid, size)
        over = self._usage >= self._limit
        if not over.any():
            return dearer, None
        used_up: Floats32 = box_sum(over, shape)[on_grid][: size[0], : size[1]].astype(np.float32)
        used_up /= np.float32(pixels)
        return dearer, used_up
