"""Multiband blending: coarse shades mixed over a wide band, fine detail over a narrow one.

Each layer is taken apart into a Laplacian pyramid, its mask into a Gaussian one; the bands are mixed by the
masks of their own level and put together again (Burt and Adelson 1983, doi:10.1145/245.247).

Pyramids are linear, so that the mixture is the hard cut plus the mixture of what each layer differs from it.
These differences are 0 where the layer shows, and nearly constant where only the exposure differs: where a
layer has no pixels its difference, unlike the layer itself, can be continued without inventing anything.
Known pixels are averaged down the pyramid, and what is missing is filled in from the next coarser level.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from toposeam.images import Mask
from toposeam.seam.pyramid import expand, expand_part, gaussian

Floats32 = npt.NDArray[np.float32]

#: Weight of bands that were made up, and what keeps sums of weights from being 0.
_MADE_UP, _LEAST = 1e-3, 1e-9


def multiband(
    differences: Sequence[Floats32], present: Sequence[Mask], shows: Sequence[Mask], levels: int
) -> tuple[Floats32, Floats32]:
    """What the mixture of some layers differs from their hard cut.

    Parameters
    ----------
    differences : sequence of (C, h, w) float32 arrays
        Per layer, its colours minus those of the hard cut; height and width are multiples of 2 ** levels.
    present : sequence of (h, w) bool arrays
        Where each difference is known.
    shows : sequence of (h, w) bool arrays
        Where each layer shows; nowhere two, and where none does the mixture is arbitrary.
    levels : int
        Halvings of the resolution. The coarsest band is mixed over about 2 ** levels px on either side of the
        seam.

    Returns
    -------
    mixture : (C, h, w) float32 array
    share : (h, w) float32 array
        How much of the coarsest band is that of the layer that shows.
    """
    mixed: list[Floats32] = []
    total: list[Floats32] = []
    own = np.zeros(shows[0].shape, np.float32)
    sums = np.zeros(shows[0].shape, np.float32)
    for difference, known, mask in zip(differences, present, shows, strict=True):
        weights = gaussian(mask[np.newaxis].astype(np.float32), levels)
        knowns = None if known.all() else gaussian(known[np.newaxis].astype(np.float32), levels)
        for level, band in enumerate(_laplacian(_continued(difference, known, knowns), levels)):
            weight = weights[level]
            if level == len(mixed):
                mixed.append(np.zeros_like(band))
                total.append(np.full_like(weight, _LEAST))
            if knowns is not None:
                # What was made up counts next to nothing, unless nobody knows better.
                weight = weight * np.maximum(2 * knowns[level] - 1, np.float32(_MADE_UP))
            band *= weight
            mixed[level] += band
            total[level] += weight
        share = weights[levels]
        for _ in range(levels):
            share = expand(share)
        np.copyto(own, share[0], where=mask)
        sums += share[0]
    result = np.zeros(0, np.float32)
    for level in reversed(range(levels + 1)):
        mixed[level] /= total[level]
        if level < levels:
            mixed[level] += expand(result)
        result = mixed[level]
    return result, np.divide(own, sums, out=own, where=sums > 0)


def _laplacian(planes: Floats32, levels: int) -> list[Floats32]:
    """The bands, finest first; the image itself is not needed any more."""
    pyramid = gaussian(planes, levels)
    for fine, coarse in pairwise(pyramid):
        fine -= expand(coarse)
    return pyramid


def _continued(planes: Floats32, known: Mask, weights: list[Floats32] | None) -> Floats32:
    """The image with smooth values where it has none; `weights` is the pyramid of `known`."""
    if weights is None:
        return planes
    levels = len(weights) - 1
    sums = gaussian(np.where(known, planes, np.float32(0)), levels)
    filled = _ratio(sums[-1], weights[-1])
    for level in reversed(range(1, levels)):
        share = weights[level]
        # Averages of few pixels give way to the coarser level.
        trust = np.minimum(share, 1)
        coarser = expand(filled)
        filled = _ratio(sums[level], share)
        filled -= coarser
        filled *= trust
        filled += coarser
    result = planes.copy()
    missing = ~known
    rows, columns = (_doubles(np.flatnonzero(missing.any(axis=axis))) for axis in (1, 0))
    part = np.s_[:, rows, columns]
    np.copyto(result[part], expand_part(filled, rows, columns), where=missing[rows, columns])
    return result


def _doubles(at: npt.NDArray[np.intp]) -> slice:
    """From the first index to the last one, in whole pairs."""
    return slice(int(at[0]) // 2 * 2, int(at[-1]) // 2 * 2 + 2)


def _ratio(sums: Floats32, weights: Floats32) -> Floats32:
    """Means from sums; 0 where next to nothing was summed."""
    result: Floats32 = np.divide(sums, np.maximum(weights, np.float32(1e-3)), dtype=np.float32)
    return result
