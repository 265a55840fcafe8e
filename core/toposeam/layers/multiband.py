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
from scipy import ndimage

from toposeam.images import Mask

Floats32 = npt.NDArray[np.float32]

#: Burt and Adelson's kernel with a = 0.375.
_KERNEL = np.array([1, 4, 6, 4, 1], np.float32) / 16

#: Weight of bands that were made up, and what keeps sums of weights from being 0.
_MADE_UP, _LEAST = 1e-3, 1e-9


def multiband(
    differences: Sequence[Floats32], present: Sequence[Mask], shows: Sequence[Mask], levels: int
) -> Floats32:
    """What the mixture of some layers differs from their hard cut.

    Parameters
    ----------
    differences : sequence of (h, w, C) float32 arrays
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
    (h, w, C) float32 array
    """
    mixed: list[Floats32] = []
    total: list[Floats32] = []
    for difference, known, mask in zip(differences, present, shows, strict=True):
        weights = gaussian(mask[..., np.newaxis].astype(np.float32), levels)
        knowns = gaussian(known[..., np.newaxis].astype(np.float32), levels)
        for level, band in enumerate(_laplacian(_continued(difference, known, levels), levels)):
            if level == len(mixed):
                mixed.append(np.zeros_like(band))
                total.append(np.full_like(weights[level], _LEAST))
            # What was made up counts next to nothing, unless nobody knows better.
            weight = weights[level] * np.maximum(2 * knowns[level] - 1, np.float32(_MADE_UP))
            mixed[level] += weight * band
            total[level] += weight
    result = np.zeros(0, np.float32)
    for level in reversed(range(levels + 1)):
        mixed[level] /= total[level]
        result = mixed[level] if level == levels else mixed[level] + expand(result)
    return result


def gaussian(image: Floats32, levels: int) -> list[Floats32]:
    """The Gaussian pyramid, finest first."""
    pyramid = [image]
    for _ in range(levels):
        pyramid.append(reduce(pyramid[-1]))
    return pyramid


def reduce(image: Floats32) -> Floats32:
    """Every other pixel of the smoothed image. (h, w, C) to (h / 2, w / 2, C)."""
    smooth = ndimage.correlate1d(image, _KERNEL, axis=0, mode="nearest")[::2]
    result: Floats32 = ndimage.correlate1d(smooth, _KERNEL, axis=1, mode="nearest")[:, ::2]
    return result


def expand(image: Floats32) -> Floats32:
    """The image at twice the size, smooth. (h, w, C) to (2 h, 2 w, C)."""
    for axis in (0, 1):
        image = np.moveaxis(image, axis, 0)
        before, after = np.concatenate([image[:1], image[:-1]]), np.concatenate([image[1:], image[-1:]])
        doubled = np.empty((2 * len(image), *image.shape[1:]), np.float32)
        doubled[::2] = (before + 6 * image + after) / 8
        doubled[1::2] = (image + after) / 2
        image = np.moveaxis(doubled, 0, axis)
    return image


def _laplacian(image: Floats32, levels: int) -> list[Floats32]:
    pyramid = gaussian(image, levels)
    return [*(fine - expand(coarse) for fine, coarse in pairwise(pyramid)), pyramid[-1]]


def _continued(image: Floats32, known: Mask, levels: int) -> Floats32:
    """The image with smooth values where it has none."""
    if known.all():
        return image
    weights = gaussian(known[..., np.newaxis].astype(np.float32), levels)
    sums = gaussian(np.where(known[..., np.newaxis], image, np.float32(0)), levels)
    filled = _ratio(sums[-1], weights[-1])
    for level in reversed(range(levels)):
        share = weights[level]
        # Averages of few pixels give way to the coarser level.
        trust = np.minimum(share, 1) if level else (share > 0).astype(np.float32)
        coarser = expand(filled)
        filled = coarser + trust * (_ratio(sums[level], share) - coarser)
    return filled


def _ratio(sums: Floats32, weights: Floats32) -> Floats32:
    """Means from sums; 0 where next to nothing was summed."""
    return (sums / np.maximum(weights, 1e-3)).astype(np.float32, copy=False)
