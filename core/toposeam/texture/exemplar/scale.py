"""The size of a texture's elements, estimated from its autocorrelation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.fft as sf

from toposeam.arrays import Floats32, Mask
from toposeam.texture.exemplar.mirror_narrow import NARROW, widened
from toposeam.texture.exemplar.patch_search import whole
from toposeam.texture.exemplar.sources import DataRange, Images, read_sources

#: Least side of a patch, px: narrower exemplars are widened.
SMALLEST_PATCH = NARROW
#: Sides of patches that are chosen automatically, px: the smallest for small and for large exemplars, and the
#: largest.
SMALLEST, USUAL, LARGEST = 24, 40, 96
#: Number of elements side by side in a patch, about.
_ELEMENTS = 4
#: Largest side of a patch as a share of the exemplar's: of large patches few reach its border, where pixels
#: would hardly show.
_MOST_SHARE = 0.25
#: Side of a coarse patch as a share of the exemplar's.
_COARSE_SHARE = 0.55
#: Autocorrelation, 1 at distance 0, at which an element ends.
_END_CORRELATION = 0.2


def natural_patch(
    image: Images,
    *,
    alpha: Images | None = None,
    source_mask: Images | None = None,
    data_range: DataRange = None,
) -> int:
    """Find the side of a patch that suits a texture: a few of its elements.

    An element is as large as the distance over which the autocorrelation, the mean and the slow drift taken
    away, falls to 0.2.

    Parameters
    ----------
    image : (H, W[, C]) array_like, or a list of such
        The exemplars.
    alpha, source_mask : (H, W) array_like, or a list with one per exemplar
        Opacity, and what may be copied.
    data_range : float, optional
        The value that counts as white, as for :func:`toposeam.synth`.

    Returns
    -------
    int
        px.

    Raises
    ------
    ImageError
        For images or masks that cannot be used.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> stripes = np.tile(np.repeat([0, 255], 8), (128, 8)).astype(np.uint8)
    >>> ts.texture.natural_patch(stripes) > 24
    True
    """
    image, alpha, source_mask = map(widened, (image, alpha, source_mask))
    sources = read_sources(image, alpha=alpha, mask=source_mask, data_range=data_range, name="image")
    return patch_for(sources.features, sources.usable, sources.shapes)


def element_size(features: Floats32, usable: Mask) -> float:
    """Estimate the size of a texture's elements in px.

    The distance at which the autocorrelation of the exemplar (its mean and its slow drift taken away) has
    fallen to 0.2, twice, averaged over the two axes: from the middle of an element to its end on either side.

    Parameters
    ----------
    features : (H, W, F) float32 array
    usable : (H, W) bool array
    """
    height, width = (length // 2 for length in usable.shape)
    mean = autocorrelation(features, usable)
    spans = []
    for line, length in (
        (mean[height:-1, width], usable.shape[0]),
        (mean[height, width:-1], usable.shape[1]),
    ):
        below = np.flatnonzero(line <= _END_CORRELATION)
        spans.append(2.0 * (below[0] if len(below) else length / 2))
    return float(np.mean(spans))


def patch_for(features: Sequence[Floats32], usable: Sequence[Mask], rooms: Sequence[tuple[int, int]]) -> int:
    """Choose a patch size for some exemplars: a few elements, never more than a quarter of the smallest
    exemplar's shorter side, and smaller where holes leave no room for it.
    """
    span = float(np.mean([element_size(values, mask) for values, mask in zip(features, usable, strict=True)]))
    room = min(min(shape) for shape in rooms)
    share = int(_MOST_SHARE * room)
    least = int(np.clip(share, min(SMALLEST, room), USUAL))
    return _fitting(int(np.clip(round(_ELEMENTS * span), least, max(min(LARGEST, share), least))), usable)


def coarse_patch(usable: Sequence[Mask], rooms: Sequence[tuple[int, int]]) -> int:
    """Choose a patch about half as large as the smallest exemplar, smaller where holes leave no room for
    it.
    """
    return _fitting(int(_COARSE_SHARE * min(min(shape) for shape in rooms)), usable)


def _fitting(patch: int, usable: Sequence[Mask]) -> int:
    """Find the largest patch, up to a size, that some exemplar has room for; that size where it has
    for none.
    """

    def fits(side: int) -> bool:
        return any(mask.all() and min(mask.shape) >= side for mask in usable) or any(
            bool(whole(mask, (side, side)).any()) for mask in usable
        )

    if fits(patch) or not fits(SMALLEST_PATCH):
        return patch
    most, least = patch, SMALLEST_PATCH
    while most - least > 1:
        middle = (least + most) // 2
        least, most = (middle, most) if fits(middle) else (least, middle)
    return least


def autocorrelation(features: Floats32, usable: Mask, *, tapered: bool = False) -> Floats32:
    """Compute how alike pixels are at every distance up to half the exemplar, 1 at distance 0, in the middle,
    and about 0 far away: (2 * (H // 2) + 1, 2 * (W // 2) + 1).

    Parameters
    ----------
    features : (H, W, F) float32 array
    usable : (H, W) bool array
        Which pixels count.
    tapered : bool
        Whether pixels near the border count less: elements cut by it would move the maxima.
    """
    lines = [np.sin(np.pi * (np.arange(n) + 0.5) / n) if tapered else np.ones(n) for n in usable.shape]
    weight = (np.outer(*lines) * usable).astype(np.float32)
    planes = [(features[..., c] - features[..., c][usable].mean()) * weight for c in range(features.shape[2])]
    total = _products(planes)
    pairs = (
        np.outer(*[_products([line[np.newaxis].astype(np.float32)])[0] for line in lines])
        if usable.all()
        else _products([weight])
    )
    total /= np.maximum(pairs, 1)
    total /= max(float(total[total.shape[0] // 2, total.shape[1] // 2]), 1e-12)
    return total


def _products(planes: Sequence[Floats32]) -> Floats32:
    """Sum products at every distance up to half of each side, for all planes together."""
    (height, width), half = planes[0].shape, [length // 2 for length in planes[0].shape]
    size = sf.next_fast_len(height + half[0]), sf.next_fast_len(width + half[1], real=True)
    power = np.zeros((size[0], size[1] // 2 + 1), np.float32)
    for plane in planes:
        # Rows of zeros need no transform along them, and of those far away none is needed.
        spectrum = sf.fft(sf.rfft(plane, size[1], axis=1), size[0], axis=0, overwrite_x=True)
        power += np.square(spectrum.real)
        power += np.square(spectrum.imag)
    rows = sf.ifft(power, axis=0).take(np.arange(-half[0], half[0] + 1), axis=0, mode="wrap")
    result: Floats32 = sf.irfft(rows, size[1], axis=1)
    return result.take(np.arange(-half[1], half[1] + 1), axis=1, mode="wrap")
