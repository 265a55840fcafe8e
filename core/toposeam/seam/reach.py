"""Differences that a wide blend would mix in at a pixel, though they lie some way off.

A seam along the very edge of something that moved costs nothing on a plain background, and shows nothing as a
hard cut. Blended over a wide band it shows: the object's edge is mixed with ground that has none. So for wide
blends the match cost looks as far as they do: besides their difference D = A - B at a pixel it counts, band
by band, how much D has of detail of about 4, 8, 16, … px near the pixel. Each band of D is the difference of
two sizes of its pyramid, as in multiband blending; from level to level it is seen twice as far, and fades::

    R = Σ over levels k:  expand^k( max over 3 × 3 of |G_k - expand(G_k+1)| )

Noise averages out in it, and what differs evenly (the exposure), which blending takes away, is in no band.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import reduce

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.images import Mask
from toposeam.seam.pyramid import expand, gaussian

Floats32 = npt.NDArray[np.float32]

#: Side of the cells whose mean difference is looked at, px, and every how many-th row and column of them is.
CELL, STEP = 4, 2
#: Weight of the bands beside the difference at the pixel itself.
_WEIGHT = 1.0
#: Cells of which so few pixels are known count as unknown.
_KNOWN = 1e-3
#: Rows of about so many pixels are looked at at once.
_BLOCK_PIXELS = 1 << 16


class Reach:
    """R above on a window, kept by cells.

    Parameters
    ----------
    shape : (int, int)
        Height and width of the window, px.
    blocks : iterable of (int, (k, w, C) float32 array, (k, w) bool array)
        Every `STEP`-th row and column of it from top to bottom: the number of the first row, a multiple of
        `CELL`, the difference of the two pictures, and where both have pixels.
    reach : float
        How far the blend reaches, px.

    Examples
    --------
    >>> difference = np.zeros((64, 64, 1), np.float32)
    >>> difference[20:40, 20:40] = 0.5
    >>> reach = Reach((64, 64), [(0, difference[::2, ::2], np.ones((32, 32), bool))], 32)
    >>> near = reach.on(slice(30, 31), slice(0, 20))[0]
    >>> bool((np.diff(near) >= 0).all()), near[-1] > 4 * near[0] > 0
    (True, np.True_)
    """

    def __init__(
        self, shape: tuple[int, int], blocks: Iterable[tuple[int, Floats32, Mask]], reach: float
    ) -> None:
        levels = max(1, round(np.log2(max(reach, 1.0) / CELL)))
        step = 2**levels
        cells = tuple(-(-side // (CELL * step)) * step for side in shape)
        sums, counts = None, np.zeros((1, *cells), np.float32)
        for first, difference, known in blocks:
            row = first // CELL
            here = _by_cells(np.moveaxis(difference, 2, 0), known)
            if sums is None:
                sums = np.zeros((len(here), *cells), np.float32)
            at = np.s_[:, row : row + here.shape[1], : here.shape[2]]
            sums[at] += here
            counts[at] += _by_cells(known[np.newaxis], known)
        self._values = np.zeros(cells, np.float32) if sums is None else _bands(sums, counts, levels)
        self._values.setflags(write=False)

    @classmethod
    def by_rows(
        cls, shape: tuple[int, int], part: Callable[[slice], tuple[Floats32, Mask] | None], reach: float
    ) -> Reach:
        """R of a window that is looked at some rows at a time, so that the pictures are never held as float32
        as a whole.

        Parameters
        ----------
        shape : (int, int)
            Height and width of the window, px.
        part : callable
            Gives for some rows the difference and where it is known, as in `blocks` above; None where it is
            known nowhere.
        reach : float
            As above.
        """
        height, width = shape
        rows_of = max(1, _BLOCK_PIXELS // width // CELL) * CELL

        def blocks() -> Iterator[tuple[int, Floats32, Mask]]:
            for first in range(0, height, rows_of):
                found = part(slice(first, min(first + rows_of, height)))
                if found is not None:
                    yield first, *found

        return cls(shape, blocks(), reach)

    def on(self, rows: slice, columns: slice) -> Floats32:
        """R in some rows and columns of the window, which may lie beyond it."""
        values = _between(self._values, rows.start, rows.stop, 0)
        return _between(values, columns.start, columns.stop, 1)


def _by_cells(planes: npt.NDArray[np.generic], known: Mask) -> Floats32:
    """(C, k, w) to (C, k', w'): sums over what is known of cells."""
    count = CELL // STEP
    channels, height, width = planes.shape
    whole = np.zeros((channels, -(-height // count) * count, -(-width // count) * count), np.float32)
    np.copyto(whole[:, :height, :width], planes, where=known)
    sums = reduce(np.add, (whole[:, at::count] for at in range(count)))
    return reduce(np.add, (sums[:, :, at::count] for at in range(count)))


def _largest_beside(values: Floats32) -> Floats32:
    """The largest value among each pixel and those that touch it, at corners too."""
    for _ in range(2):  # along one axis, then the other
        wide = values.copy()
        np.maximum(wide[1:], values[:-1], out=wide[1:])
        np.maximum(wide[:-1], values[1:], out=wide[:-1])
        values = wide.T
    return values


def _bands(sums: Floats32, counts: Floats32, levels: int) -> Floats32:
    pyramid = gaussian(np.concatenate([sums, counts]), levels)
    known = [planes[-1] > _KNOWN for planes in pyramid]
    means: list[Floats32] = [planes[:-1] / np.maximum(planes[-1], np.float32(_KNOWN)) for planes in pyramid]
    coarser = means[-1]
    if not known[-1].all():
        nearest = scipy.ndimage.distance_transform_edt(
            ~known[-1], return_distances=False, return_indices=True
        )
        coarser = coarser[:, *nearest]
    result = np.zeros((1, *coarser.shape[1:]), np.float32)
    for level in reversed(range(levels)):
        both = expand(np.concatenate([coarser, result]))
        coarser, result = both[:-1], both[-1:]
        band = np.where(known[level], means[level] - coarser, np.float32(0))
        result += _largest_beside(np.sqrt(np.einsum("chw,chw->hw", band, band)))
        coarser += band
    weighed: Floats32 = result[0] * np.float32(_WEIGHT)
    return weighed


def _between(values: Floats32, start: int, stop: int, axis: int) -> Floats32:
    """Values of pixels from those of cells along one axis, in between by straight lines."""
    at = (np.arange(start, stop, dtype=np.float32) + np.float32(0.5)) / CELL - np.float32(0.5)
    at = np.clip(at, 0, values.shape[axis] - 1)
    low = at.astype(np.intp)
    high = np.minimum(low + 1, values.shape[axis] - 1)
    share = (at - low).astype(np.float32)[(slice(None), np.newaxis)[:: 1 if axis == 0 else -1]]
    first: Floats32 = values.take(low, axis)
    second: Floats32 = values.take(high, axis)
    second -= first
    second *= share
    second += first
    return second
