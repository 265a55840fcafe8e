"""Light that dark and bright parts of a sample share.

A surface through a sample's values explains part of their variance by chance alone, the more the fewer
elements it has: where half a dozen objects lie mostly to one side, that side is brighter. But light falls on
all alike. So the sample is divided into blocks, and a surface goes through the logarithms of the dark, the
middle and the bright pixels of the blocks, each robustly: objects give one of them a surface, only light
gives the same to all.
"""

from __future__ import annotations

import numpy as np

from toposeam.arrays import Floats, Floats32, Mask

#: Number of blocks along each side, and the quantiles of their pixels.
_BLOCKS, _QUANTILES = 6, (0.25, 0.5, 0.75)
#: Share of white that is added to values before their logarithm is taken, so that black has one.
_FLOOR = 0.05
#: Least share of a block that may be copied for it to count, and number of blocks that count for a surface to
#: be told.
_LEAST_USABLE, _LEAST_BLOCKS = 0.25, 12
#: Number of steps of the robust fit, and the distance, in standard deviations, at which a block counts half.
_STEPS, _HALF_WEIGHT = 15, 2.0


def quadratic_terms(shape: tuple[int, ...]) -> Floats:
    """Compute the terms of a quadratic surface, (H, W, 6)."""
    y, x = (np.linspace(-1, 1, length) for length in shape)
    y, x = y[:, np.newaxis], x[np.newaxis]
    return np.stack([np.ones(shape), y + 0 * x, x + 0 * y, y * x, y * y + 0 * x, x * x + 0 * y], axis=2)


def shared_light(gray: Floats32, usable: Mask) -> float:
    """Estimate how much light changes over a sample: a standard deviation of the logarithm of values.

    Parameters
    ----------
    gray : (H, W) float32 array
        Brightness as a share of white.
    usable : (H, W) bool array

    Returns
    -------
    float
        0.1, of light that falls by about a quarter from one side to the other, is clearly seen.

    Examples
    --------
    >>> rng, light = np.random.default_rng(0), np.linspace(0.6, 1, 96, dtype=np.float32)
    >>> even, everywhere = rng.uniform(0.2, 0.9, (96, 96)).astype(np.float32), np.ones((96, 96), bool)
    >>> shared_light(even, everywhere) < 0.05, shared_light(even * light, everywhere) > 0.1
    (True, True)
    """
    values = np.log(_FLOOR + np.maximum(gray, 0))
    rows, columns = (np.linspace(0, length, _BLOCKS + 1).astype(int) for length in gray.shape)
    quantiles = np.zeros((_BLOCKS, _BLOCKS, len(_QUANTILES)))
    counts = np.zeros((_BLOCKS, _BLOCKS), bool)
    for i, j in np.ndindex(counts.shape):
        block = np.s_[rows[i] : rows[i + 1], columns[j] : columns[j + 1]]
        some = values[block][usable[block]]
        counts[i, j] = len(some) > _LEAST_USABLE * usable[block].size
        if counts[i, j]:
            quantiles[i, j] = np.quantile(some, _QUANTILES)
    if np.count_nonzero(counts) < _LEAST_BLOCKS:
        return 0.0
    basis = quadratic_terms(counts.shape)[counts]
    surfaces = [_surface(basis, quantile) for quantile in quantiles[counts].T]
    alike = [float((one * two).mean()) for k, one in enumerate(surfaces) for two in surfaces[:k]]
    return float(np.sqrt(max(0.0, min(alike))))


def _surface(basis: Floats, values: Floats) -> Floats:
    """Fit a surface, (n,), to the values of n blocks, on which outliers hardly weigh; its mean is 0."""
    weight = np.ones(len(values))
    surface = np.zeros(len(values))
    for _ in range(_STEPS):
        root = np.sqrt(weight)
        factors = np.linalg.lstsq(basis * root[:, np.newaxis], values * root, rcond=None)[0]
        surface = basis @ factors
        rest = values - surface
        deviation = 1.48 * float(np.median(np.abs(rest))) + 1e-3
        weight = 1 / (1 + np.square(rest / (_HALF_WEIGHT * deviation)))
    return np.asarray(surface - surface.mean())
