"""Poisson's equation on grids, solved directly: unwanted steps are spread as smoothly as possible.

The correction c minimises Σ w (c(q) - c(p) + d(p, q))² over neighbours p, q, where d is the unwanted step
between them. The divergence of d is the *source*. Cosine transforms decouple axes that end, Fourier
transforms axes that wrap, so that the solution is exact to rounding, in O(n log n).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

#: Rows that are divided at a time: the divisors of all rows would take more memory than the rows.
_BLOCK_ROWS = 64
#: Error, as a share of the first one in the preconditioned norm, at which conjugate gradients end; and their
#: most steps.
_TOLERANCE, _MOST_STEPS = 1e-4, 300


def add_steps(
    source: npt.NDArray[Any], lower: Any, upper: Any, step: npt.NDArray[Any], weight: float = 1.0
) -> None:
    """Add the divergence of unwanted steps to a source.

    Parameters
    ----------
    source : float array, changed
    lower, upper : indices
        Of the two neighbours of every step; each place occurs at most once in either.
    step : array
        Unwanted height of the upper one above the lower one.
    weight : float
        Weight of these steps relative to those along other axes.
    """
    source[lower] += weight * step
    source[upper] -= weight * step


def spread(
    source: npt.NDArray[Any], width: float | None = None, wraps: tuple[bool, bool] = (False, False)
) -> npt.NDArray[Any]:
    """Compute the correction of a plane, of the same shape and dtype.

    Parameters
    ----------
    source : (H, W) float array
        Overwritten.
    width : float, optional
        Over this distance, px, the correction fades: c² / width² is added for every pixel. Otherwise its mean
        is 0.
    wraps : (bool, bool)
        Whether the last row is followed by the first one, and the last column by the first one.

    Examples
    --------
    A step of 1 in the middle of a row is spread over all of it:

    >>> source = np.zeros((1, 4))
    >>> add_steps(source, (0, 1), (0, 2), np.array(1.0))
    >>> (spread(source) + [0, 0, 1, 1]).round(6).tolist()
    [[0.5, 0.5, 0.5, 0.5]]
    """
    from scipy import fft  # nothing else needs it

    if wraps[0] and not wraps[1]:
        return spread(source.T, width, (False, True)).T
    height, columns = source.shape
    screen = 0.0 if width is None else 1.0 / width**2
    down = _waves(height) if wraps[0] else _cosines(height)
    across = _waves(columns)[: columns // 2 + 1] if wraps[1] else _cosines(columns)
    spectrum = source if wraps[0] else fft.dct(source, axis=0, overwrite_x=True)
    spectrum = fft.rfft(spectrum, axis=1) if wraps[1] else fft.dct(spectrum, axis=1, overwrite_x=True)
    spectrum = fft.fft(spectrum, axis=0, overwrite_x=True) if wraps[0] else spectrum
    if screen == 0.0:
        spectrum[0, 0] = 0.0
        down[0] = np.finfo(float).tiny  # 0 / tiny: the mean stays
    for rows in (slice(top, top + _BLOCK_ROWS) for top in range(0, height, _BLOCK_ROWS)):
        spectrum[rows] /= down[rows, np.newaxis] + across + screen
    spectrum = fft.ifft(spectrum, axis=0, overwrite_x=True) if wraps[0] else spectrum
    values = (
        fft.irfft(spectrum, columns, axis=1) if wraps[1] else fft.idct(spectrum, axis=1, overwrite_x=True)
    )
    result: npt.NDArray[Any] = values if wraps[0] else fft.idct(values, axis=0, overwrite_x=True)
    return result


def spread_within(
    source: npt.NDArray[np.float64], free: npt.NDArray[np.bool_], width: float | None = None
) -> npt.NDArray[np.float64]:
    """Compute the correction of a part of a plane; it is 0 elsewhere.

    Conjugate gradients, preconditioned by :func:`spread` on all of the plane: some sixty steps at most sizes
    of the part, each O(n log n).

    Parameters
    ----------
    source : (H, W) float64 array
    free : (H, W) bool array
        The part, which is not all of the plane unless there is a width.
    width : float, optional
        As for :func:`spread`.

    Examples
    --------
    A step of 1 in the middle of a row, whose first half stays:

    >>> source = np.zeros((1, 4))
    >>> add_steps(source, (0, 1), (0, 2), np.array(1.0))
    >>> free = np.array([[False, False, True, True]])
    >>> (spread_within(source, free) + [0, 0, 1, 1]).round(3).tolist()
    [[0.0, 0.0, 0.0, 0.0]]
    """
    screen = 0.0 if width is None else 1.0 / width**2

    def precondition(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        spread_out = spread(values.copy(), width)
        spread_out[~free] = 0
        return spread_out

    found, residual = np.zeros_like(source), np.where(free, source, 0.0)
    direction = better = precondition(residual)
    error = first = float(np.vdot(residual, better))
    for _ in range(_MOST_STEPS):
        if error <= _TOLERANCE**2 * first:
            break
        pull = _second_differences(direction)
        pull += screen * direction
        pull[~free] = 0
        length = error / float(np.vdot(direction, pull))
        found += length * direction
        residual -= length * pull
        better = precondition(residual)
        before, error = error, float(np.vdot(residual, better))
        direction = better + error / before * direction
    return found


def _second_differences(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Sum each value's differences to its neighbours."""
    result = np.zeros_like(values)
    for axis in (0, 1):
        low, high = ((slice(None),) * axis + (part,) for part in (slice(None, -1), slice(1, None)))
        step = np.diff(values, axis=axis)
        result[low] -= step
        result[high] += step
    return result


def spread_in_cycle(source: npt.NDArray[Any], stiffness: float) -> npt.NDArray[Any]:
    """Compute, in place, the correction of frames of which the last one is followed by the first.

    A correction as wide as a wave of length λ, in px, fades within λ / 2π√stiffness frames of its step; a
    step of whole frames is spread evenly over the cycle.

    Parameters
    ----------
    source : (T, H, W) float array
        Overwritten by the correction, whose mean is 0.
    stiffness : float
        Weight of the steps along rows and columns; 1 is that of the steps from frame to frame.

    Examples
    --------
    The step from the second frame to the third is too much by 1; what closes the cycle stays:

    >>> source = np.zeros((4, 2, 2))
    >>> add_steps(source, 1, 2, np.ones((2, 2)))
    >>> (spread_in_cycle(source, 1.0)[:, 0, 0] + [0, 0, 1, 1]).round(3).tolist()
    [0.125, 0.375, 0.625, 0.875]
    """
    from scipy import fft

    count, height, width = source.shape
    moments = _waves(count)[: count // 2 + 1]
    rows, columns = stiffness * _cosines(height), stiffness * _cosines(width)
    for frame in source:
        frame[...] = fft.dctn(frame)
    for row in range(height):
        spectrum = fft.rfft(source[:, row], axis=0)
        over = (moments[:, np.newaxis] + rows[row] + columns).astype(source.dtype)
        if row == 0:
            spectrum[0, 0], over[0, 0] = 0.0, 1.0  # the mean stays
        spectrum /= over
        source[:, row] = fft.irfft(spectrum, count, axis=0)
    for frame in source:
        frame[...] = fft.idctn(frame)
    return source


def _cosines(length: int) -> npt.NDArray[np.float64]:
    """Compute the eigenvalues of second differences on a line of `length` places: those of its cosines."""
    values: npt.NDArray[np.float64] = 2 - 2 * np.cos(np.pi * np.arange(length) / length)
    return values


def _waves(length: int) -> npt.NDArray[np.float64]:
    """Compute the eigenvalues of second differences on a cycle of `length` places: those of its waves."""
    values: npt.NDArray[np.float64] = 2 - 2 * np.cos(2 * np.pi * np.arange(length) / length)
    return values
