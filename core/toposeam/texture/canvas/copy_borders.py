"""Borders between copies: neighbouring pixels of a texture that are no neighbours in the exemplar."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Ints32

#: Number of rows of a canvas that are searched, lit or rendered at a time: all of a large one would take
#: gigabytes.
ROWS = 256


def joints(
    index: Ints32, stride: int, wraps: tuple[bool, bool]
) -> Iterator[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], int]]:
    """Find the neighbours on the canvas that show pixels of two copies, by flat places.

    Parameters
    ----------
    index : (H, W) int32 array
        Flat index into the atlas, or -1.
    stride : int
        Width of the atlas.
    wraps : (bool, bool)
        Whether rows and columns continue at the opposite border.

    Yields
    ------
    first, second : (n,) int arrays
        A pixel, and the one below it or to its right.
    step : int
        From a pixel of the atlas to its neighbour in that direction.
    """
    height, width = index.shape
    empty = index.min(initial=0) < 0
    for top in range(0, height, ROWS):
        here = index[top : top + ROWS]
        rows = np.arange(top, top + len(here))
        below = (rows + 1) % height
        under = index[below] if below[-1] == 0 else index[top + 1 : top + 1 + len(here)]
        for axis, (step, beside) in enumerate(((stride, under), (1, np.roll(here, -1, axis=1)))):
            apart = beside - here != step
            if empty:
                apart &= (here >= 0) & (beside >= 0)
            if not wraps[axis]:
                apart[(below == 0) if axis == 0 else (slice(None), -1)] = False
            y, x = np.nonzero(apart)
            second = below[y] * width + x if axis == 0 else rows[y] * width + (x + 1) % width
            yield rows[y] * width + x, second, step
