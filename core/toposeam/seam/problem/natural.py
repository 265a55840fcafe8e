"""Masking and things: the parts of the match cost that model what eyes notice of a seam.

Everything here is computed on *cells* of two pixels along every axis: the mean of each picture over the
pixels that both have. With σ_A, σ_B their local standard deviations (over windows of 3 cells)::

    masking      m = ε + κ min(σ_A, σ_B, 0.2)           texture of both pictures hides a seam; ε is 0.02
                                                        between pixels, 0.03 in what follows
    mismatch     v = min(|A - B| / m, 12)
    foreign      o = min(|A - [B]| / ε, 12)             distance of A's colours from the range of B's within
                                                        5 × 5 cells, or of B's from A's: the larger one
    things       W = T(v) C(v - 1) + T(o) C(o - 1)      with T(x) = ‖x‖₄ / ‖x‖₁

C closes (dilates, then erodes) the positive part over 5 cells, so that the inside of a thing costs as
much as its outline; norms are power means over windows of 7 cells, and their quotient T grows where something
is thin, so that a post costs as much to cut as a wall. Edges that lie a few pixels apart in the two pictures,
and leaves that moved, are mismatches but not foreign; a head before trees, a lamp before a wall are both.

In volumes the surface is not looked at, but biological cells are counted: W is larger by
min(σ_A, σ_B, 0.2) / 2 ε, so that where two stacks agree the surface runs through smooth ground rather than
through a cell.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toposeam.arrays import Floats32, Mask

#: Side of a cell, px.
CELL = 2
#: Largest distance, px, from an interface's two pixels to others on which its cost depends.
LOOK = 14
#: ε, in units of the pictures' range: of cells, and of pixels: steps on smooth ground are noticed sooner.
_CELL_EPSILON, _PIXEL_EPSILON = np.float32(0.03), np.float32(0.02)
#: κ; and the standard deviation, in units of the pictures' range, above which texture hides no more.
_MASKING, _MOST_TEXTURE = np.float32(0.7), np.float32(0.2)
#: Cost of structure in volumes where both stacks agree, as a share of that of an equally large mismatch.
_STRUCTURE = np.float32(0.5)
#: Largest mismatch that counts; and largest mismatch that is no thing. In units of m, or of ε.
LARGEST_MISMATCH, _LARGEST_UNSEEN = np.float32(12.0), np.float32(1.0)
#: Sides of windows, in cells: of standard deviations, of ranges of colours, of the closing, of power means.
_DEVIATION_CELLS, _RANGE_CELLS, _CLOSING_CELLS, _MEAN_CELLS = 3, 5, 5, 7
#: Least denominator.
_TINY = np.float32(1e-6)


def perceived(
    a: Floats32, b: Floats32, shared: Mask | None, start: Sequence[int]
) -> tuple[Floats32, Floats32]:
    """Compute m and W on every pixel of a window.

    Parameters
    ----------
    a, b : (C, h, w) or (C, d, h, w) float32 arrays
    shared : (h, w) or (d, h, w) bool array, optional
        Where both have pixels; everywhere by default.
    start : sequence of int
        Index of the window's first pixel on the canvas: cells begin at even ones.

    Returns
    -------
    masking, thing : float32 arrays of one value per pixel

    Examples
    --------
    A post that only one picture has, before a wall without pattern:

    >>> a = np.full((1, 40, 40), 0.5, np.float32)
    >>> b = a.copy()
    >>> b[:, :, 18:22] = 1.0
    >>> masking, thing = perceived(a, b, None, (0, 0))
    >>> thing[20, 20] > 20, float(thing[20, 0]), float(masking[20, 0])
    (np.True_, 0.0, 0.019999999552965164)
    """
    shape = a.shape[1:]
    offset = tuple(place % CELL for place in start)
    known = None if shared is None or shared.all() else _cell_sums(shared[None].astype(np.float32), offset)[0]
    if known is None and (any(offset) or any(side % CELL for side in shape)):
        known = _cell_sums(np.ones((1, *shape), np.float32), offset)[0]
    first, second = (_cell_means(planes, shared, known, offset) for planes in (a, b))
    there = None if known is None else known > 0
    busy = np.minimum(_variance(first, there), _variance(second, there))
    np.minimum(np.sqrt(busy, out=busy), _MOST_TEXTURE, out=busy)
    masking: Floats32 = np.add(busy * _MASKING, _CELL_EPSILON, dtype=np.float32)
    difference = first - second
    mismatch = _norm(difference)
    mismatch /= masking
    np.minimum(mismatch, LARGEST_MISMATCH, out=mismatch)
    foreign = np.maximum(_outside(first, second, there), _outside(second, first, there))
    foreign /= _CELL_EPSILON
    np.minimum(foreign, LARGEST_MISMATCH, out=foreign)
    if there is not None:
        mismatch *= there
        foreign *= there
    thing = _thinness(mismatch, there) * _closed(mismatch)
    thing += _thinness(foreign, there) * _closed(foreign)
    if len(shape) == 3:
        thing += busy * (_STRUCTURE / _CELL_EPSILON)
    masking -= _CELL_EPSILON - _PIXEL_EPSILON
    return _on_pixels(masking, offset, shape), _on_pixels(thing, offset, shape)


def _norm(planes: Floats32) -> Floats32:
    squares: Floats32 = np.einsum("c...,c...->...", planes, planes)
    return np.sqrt(squares, out=squares)


def _cell_sums(planes: Floats32, offset: Sequence[int]) -> Floats32:
    """Add up the pixels of every cell; those beyond the window count 0."""
    padding = [(0, 0)] + [
        (before, -(length + before) % CELL) for before, length in zip(offset, planes.shape[1:], strict=True)
    ]
    if any(map(any, padding)):
        planes = np.pad(planes, padding)
    for axis in range(1, planes.ndim):
        before = (slice(None),) * axis
        planes = planes[(*before, slice(0, None, CELL))] + planes[(*before, slice(1, None, CELL))]
    return planes


def _cell_means(
    planes: Floats32, shared: Mask | None, known: Floats32 | None, offset: Sequence[int]
) -> Floats32:
    if shared is not None and known is not None:
        planes = planes * shared
    count = np.float32(CELL ** (planes.ndim - 1)) if known is None else np.maximum(known, np.float32(1))
    means: Floats32 = _cell_sums(planes, offset) / count
    return means


def _on_pixels(cells: Floats32, offset: Sequence[int], shape: Sequence[int]) -> Floats32:
    for axis in range(cells.ndim):
        cells = np.repeat(cells, CELL, axis)
    return np.ascontiguousarray(
        cells[tuple(slice(first, first + side) for first, side in zip(offset, shape, strict=True))]
    )


def _widened(values: Floats32, axis: int, half: int, beyond: float) -> Floats32:
    """Put `half` entries `beyond` on either side along an axis; :func:`numpy.pad` takes long to begin."""
    shape = list(values.shape)
    shape[axis] += 2 * half
    result = np.full(shape, beyond, values.dtype)
    result[(*(slice(None),) * axis, slice(half, half + values.shape[axis]))] = values
    return result


def _sums(values: Floats32, size: int) -> Floats32:
    """Sum windows of an odd number of cells round every cell, on all axes but the first."""
    half = size // 2
    for axis in range(1, values.ndim):
        before = (slice(None),) * axis
        length = values.shape[axis]
        part = _widened(values, axis, half, 0.0)  # sums of `width` cells from each place on
        width = at = 1
        total = part[(*before, slice(length))].copy()
        while 2 * width <= size:
            part = part[(*before, slice(None, -width))] + part[(*before, slice(width, None))]
            width *= 2
            if size & width:
                total += part[(*before, slice(at, at + length))]
                at += width
        values = total
    return values


def _mean(values: Floats32, there: Mask | None, size: int) -> Floats32:
    """Average values over the known cells of windows; values of unknown cells are 0."""
    many = np.ones(values.shape, np.float32) if there is None else there.astype(np.float32)
    both = _sums(np.stack([values, many]), size)
    mean: Floats32 = both[0] / np.maximum(both[1], 1)
    return mean


def _power_mean(values: Floats32, there: Mask | None) -> Floats32:
    fourth = np.square(np.square(values))
    return np.sqrt(np.sqrt(_mean(fourth, there, _MEAN_CELLS)))


def _thinness(values: Floats32, there: Mask | None) -> Floats32:
    """Compute ‖x‖₄ / ‖x‖₁ of windows: 1 where values are even, more where few cells hold most of them."""
    thin: Floats32 = _power_mean(values, there)
    thin /= np.maximum(_mean(values, there, _MEAN_CELLS), _TINY)
    return thin


def _variance(planes: Floats32, there: Mask | None) -> Floats32:
    """Compute the variance over windows, summed over the channels."""
    squares = np.einsum("c...,c...->...", planes, planes)
    many = np.ones(squares.shape, np.float32) if there is None else there.astype(np.float32)
    *sums, total, count = _sums(np.concatenate([planes, squares[None], many[None]]), _DEVIATION_CELLS)
    np.maximum(count, 1, out=count)
    variance: Floats32 = total / count
    for one in sums:
        variance -= np.square(one / count)
    return np.maximum(variance, 0, out=variance)


def _extreme(operation: np.ufunc, values: Floats32, size: int, beyond: float) -> Floats32:
    """Return the extreme of windows of an odd number of cells round every cell, on all axes but the first."""
    half = size // 2
    for axis in range(1, values.ndim):
        before = (slice(None),) * axis
        values = _widened(values, axis, half, beyond)
        width = 1
        while width < size:
            step = min(width, size - width)
            values = operation(values[(*before, slice(None, -step))], values[(*before, slice(step, None))])
            width += step
    return values


def _closed(values: Floats32) -> Floats32:
    """Close the mismatch above the unseen, so that holes in things are part of them."""
    above = np.maximum(values - _LARGEST_UNSEEN, 0)[None]
    closed: Floats32 = _extreme(
        np.minimum, _extreme(np.maximum, above, _CLOSING_CELLS, 0.0), _CLOSING_CELLS, np.inf
    )[0]
    return closed


def _outside(planes: Floats32, others: Floats32, there: Mask | None) -> Floats32:
    """Compute how far colours lie outside of the range of the other picture's colours nearby."""
    low, high = (
        _extreme(
            operation,
            others if there is None else np.where(there, others, np.float32(beyond)),
            _RANGE_CELLS,
            beyond,
        )
        for operation, beyond in ((np.minimum, np.inf), (np.maximum, -np.inf))
    )
    apart = np.maximum(low - planes, planes - high)
    np.maximum(apart, 0, out=apart)
    if there is not None:
        apart[:, ~there] = 0
    return _norm(apart)
