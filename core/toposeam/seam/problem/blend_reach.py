"""The match cost of wide blends: differences nearby, the exposure and the ends of pictures change it.

A seam along the very edge of something that moved costs nothing on a plain background, and as a hard cut it
does not show. Blended over a wide band it shows: the object's edge is mixed with ground that has none. So for
wide blends the match cost looks as far as the blend reaches. Besides the difference D = A - B at a pixel it
counts, band by band, the detail of D near the pixel at scales of about 4, 8, 16, … px. Each band of D is the
difference of two levels of its pyramid, as in multiband blending; each level counts twice as far as the one
before, and fades::

    R = Σ over levels k:  expand^k( max over 3 × 3 of |G_k - expand(G_k+1)| )

Noise averages out in R. An even difference (the exposure), which blending removes, is in no band: it is the
last level of the pyramid, and the law "natural" subtracts it from the difference at the pixel, too. Where one
picture ends and the other goes on, a blend has nothing to mix: costs rise twofold towards such ends::

    M → M (1 + max(0, 1 - distance to the end / reach))
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import reduce
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats32, Mask
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.seam.problem.pyramid import expand, gaussian

#: Side of the cells over which differences are averaged, px; and distance of the rows and columns of pixels
#: that are sampled, px.
CELL, STEP = 4, 2
#: Weight of R relative to the difference at the pixel itself.
_BANDS_WEIGHT = 1.0
#: Relative rise of costs at the end of a picture.
_END_RISE = 1.0
#: Least number of known pixels, after smoothing, in a cell whose mean counts as known.
_LEAST_KNOWN = 1e-3
#: Pixels of the rows that are converted at a time, to bound the memory.
_BLOCK_PIXELS = 1 << 16


class Reach:
    """R above on a window, stored by cells.

    Parameters
    ----------
    shape : (int, int)
        Height and width of the window, px.
    blocks : iterable of (int, (k, w, C) float32 array, (k, w) bool array, (k, w) bool array)
        Every `STEP`-th row and column of it from top to bottom: the number of the first row, a multiple of
        `CELL`, the difference of the two pictures, where both have pixels, and where only one has.
    reach : float
        Distance over which pictures are blended, px.

    Examples
    --------
    >>> difference = np.zeros((64, 64, 1), np.float32)
    >>> difference[20:40, 20:40] = 0.5
    >>> both = np.ones((32, 32), bool)
    >>> reach = Reach((64, 64), [(0, difference[::2, ::2], both, ~both)], 32)
    >>> near = reach.on(slice(30, 31), slice(0, 20))[0]
    >>> bool((np.diff(near) >= 0).all()), near[-1] > 4 * near[0] > 0
    (True, np.True_)
    """

    def __init__(
        self, shape: tuple[int, int], blocks: Iterable[tuple[int, Floats32, Mask, Mask]], reach: float
    ) -> None:
        levels = max(1, round(np.log2(max(reach, 1.0) / CELL)))
        step = 2**levels
        cells = tuple(-(-side // (CELL * step)) * step for side in shape)
        sums, counts, alone = None, np.zeros((1, *cells), np.float32), np.zeros(cells, bool)
        for first, difference, known, single in blocks:
            row = first // CELL
            here = _by_cells(np.moveaxis(difference, 2, 0), known)
            if sums is None:
                sums = np.zeros((len(here), *cells), np.float32)
            at = np.s_[:, row : row + here.shape[1], : here.shape[2]]
            sums[at] += here
            counts[at] += _by_cells(known[np.newaxis], known)
            alone[at[1:]] = alone[at[1:]] | (_by_cells(single[np.newaxis], single)[0] > 0)
        if sums is None:
            sums = np.zeros((1, *cells), np.float32)
        self._values, self._even = _bands(sums, counts, levels)
        self._step = CELL * step
        self._ends = np.zeros(cells, np.float16)
        if alone.any():
            self._ends[:] = _fading(alone, reach)
        for values in (self._values, self._even, self._ends):
            values.setflags(write=False)

    @classmethod
    def by_rows(
        cls,
        shape: tuple[int, int],
        part: Callable[[slice], tuple[Floats32, Mask, Mask] | None],
        reach: float,
    ) -> Reach:
        """Compute R from blocks of rows, so that the pictures are never stored as float32 as a whole.

        Parameters
        ----------
        shape : (int, int)
            Height and width of the window, px.
        part : callable
            Returns for some rows the difference, a mask of where it is known, and a mask of where only one
            picture has pixels, as in `blocks` above; None where neither picture has any.
        reach : float
            As above.
        """
        height, width = shape
        rows_of = max(1, _BLOCK_PIXELS // width // CELL) * CELL

        def blocks() -> Iterator[tuple[int, Floats32, Mask, Mask]]:
            for first in range(0, height, rows_of):
                found = part(slice(first, min(first + rows_of, height)))
                if found is not None:
                    yield first, *found

        return cls(shape, blocks(), reach)

    def on(self, rows: slice, columns: slice) -> Floats32:
        """Return R in some rows and columns of the window, which may lie beyond it."""
        return _on(self._values, rows, columns, CELL)

    def even(self, rows: slice, columns: slice) -> Floats32:
        """Return the even difference of the pictures, which a blend removes, (C, h, w)."""
        return np.stack([_on(plane, rows, columns, self._step) for plane in self._even])

    def rise(self, rows: slice, columns: slice) -> Floats32:
        """Return the factors by which costs rise near the ends of pictures, (h, w)."""
        factor = _on(self._ends, rows, columns, CELL)
        factor *= np.float32(_END_RISE)
        factor += 1
        return factor


def any_by_steps(mask: Mask) -> Mask:
    """Reduce a mask: True for each square of `STEP` × `STEP` pixels of which any is True."""
    height, width = mask.shape
    whole = np.pad(mask, ((0, -height % STEP), (0, -width % STEP)))
    return np.asarray(whole.reshape(-(-height // STEP), STEP, -(-width // STEP), STEP).any(axis=(1, 3)))


def within_reach(
    reach: Reach, a: Floats32, weight: Floats32 | None, rows: slice, columns: slice, options: MatchCost
) -> tuple[Floats32, Floats32 | None, Floats32]:
    """Prepare the match cost of some rows and columns of the window.

    Returns the first picture, (h, w, C), for the law "natural" without the even difference; the factors,
    (h, w), for that law raised near ends; and R.
    """
    if options.law == "natural":
        a = a - np.moveaxis(reach.even(rows, columns), 0, -1)
        rise = reach.rise(rows, columns)
        weight = rise if weight is None else weight * rise
    return a, weight, reach.on(rows, columns)


def _by_cells(planes: npt.NDArray[np.generic], known: Mask) -> Floats32:
    """Sum the known values of every cell, (C, k, w) to (C, k', w')."""
    count = CELL // STEP
    channels, height, width = planes.shape
    whole = np.zeros((channels, -(-height // count) * count, -(-width // count) * count), np.float32)
    np.copyto(whole[:, :height, :width], planes, where=known)
    sums = reduce(np.add, (whole[:, at::count] for at in range(count)))
    return reduce(np.add, (sums[:, :, at::count] for at in range(count)))


def _largest_beside(values: Floats32) -> Floats32:
    """Return the largest value among each pixel and its eight neighbours."""
    for _ in range(2):  # along one axis, then the other
        wide = values.copy()
        np.maximum(wide[1:], values[:-1], out=wide[1:])
        np.maximum(wide[:-1], values[1:], out=wide[:-1])
        values = wide.T
    return values


def _fading(alone: Mask, reach: float) -> Floats32:
    """Compute a ramp: 1 in some cells, falling to 0 at `reach` px along rows, columns and diagonals alike."""
    values, step = alone.astype(np.float32), np.float32(CELL / max(reach, CELL))
    for _ in range(int(1 / step)):
        np.maximum(values, _largest_beside(values) - step, out=values)
    return values


def _bands(sums: Floats32, counts: Floats32, levels: int) -> tuple[Floats32, Floats32]:
    """Compute R by cells, and the last level of the pyramid, (C, h', w')."""
    pyramid = gaussian(np.concatenate([sums, counts]), levels)
    known = [planes[-1] > _LEAST_KNOWN for planes in pyramid]
    means: list[Floats32] = [
        planes[:-1] / np.maximum(planes[-1], np.float32(_LEAST_KNOWN)) for planes in pyramid
    ]
    coarser = means[-1]
    if not known[-1].all():
        nearest = scipy.ndimage.distance_transform_edt(
            ~known[-1], return_distances=False, return_indices=True
        )
        coarser = coarser[:, *nearest]
    even = coarser.copy()
    result = np.zeros((1, *coarser.shape[1:]), np.float32)
    for level in reversed(range(levels)):
        both = expand(np.concatenate([coarser, result]))
        coarser, result = both[:-1], both[-1:]
        band = np.where(known[level], means[level] - coarser, np.float32(0))
        result += _largest_beside(np.sqrt(np.einsum("chw,chw->hw", band, band)))
        coarser += band
    weighed: Floats32 = result[0] * np.float32(_BANDS_WEIGHT)
    return weighed, even


def _on(values: npt.NDArray[Any], rows: slice, columns: slice, cell: int) -> Floats32:
    across = _between(values, rows.start, rows.stop, 0, cell)
    return _between(across, columns.start, columns.stop, 1, cell)


def _between(values: npt.NDArray[Any], start: int, stop: int, axis: int, cell: int) -> Floats32:
    """Interpolate values of cells linearly to pixels, along one axis."""
    at = (np.arange(start, stop, dtype=np.float32) + np.float32(0.5)) / cell - np.float32(0.5)
    at = np.clip(at, 0, values.shape[axis] - 1)
    low = at.astype(np.intp)
    high = np.minimum(low + 1, values.shape[axis] - 1)
    share = (at - low).astype(np.float32)[(slice(None), np.newaxis)[:: 1 if axis == 0 else -1]]
    # Ends are stored as float16, with which numpy computes eight times as slowly.
    first, second = (values.take(at, axis).astype(np.float32, copy=False) for at in (low, high))
    second -= first
    second *= share
    second += first
    return second
