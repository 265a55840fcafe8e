"""How large the elements of a texture are, seen from its autocorrelation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import scipy.fft as sf

from toposeam.images import Mask
from toposeam.texture.atlas import Floats32
from toposeam.texture.search import whole
from toposeam.texture.sources import DataRange, Images, read_sources

#: Sides of a patch are at least this many px.
SMALLEST_PATCH = 4
#: Sides of patches that are chosen automatically, px: the smallest for small and for large exemplars, and the
#: largest.
SMALLEST, USUAL, LARGEST = 24, 40, 96
#: A patch holds about this many elements side by side.
_ELEMENTS = 4
#: Where the autocorrelation has fallen to this, one element has ended.
_DECAY = 0.2


def natural_patch(
    image: Images,
    *,
    alpha: Images | None = None,
    source_mask: Images | None = None,
    data_range: DataRange = None,
) -> int:
    """The side of a patch that suits a texture: a few of its elements.

    An element is as large as the distance over which the autocorrelation, the mean and the slow drift taken
    away, falls to 0.2.

    Parameters
    ----------
    image : (H, W[, C]) array_like, or a list of such
        The exemplars.
    alpha, source_mask : (H, W) array_like, or a list with one per exemplar
        Opacity, and what may be copied.
    data_range : float, optional
        The value that counts as white, as for :func:`toposeam.synthesize`.

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
    >>> ts.natural_patch(stripes) > 24
    True
    """
    sources = read_sources(image, alpha=alpha, mask=source_mask, data_range=data_range, name="image")
    return patch_for(sources.features, sources.usable, sources.shapes)


def element_size(features: Floats32, usable: Mask) -> float:
    """The size of a texture's elements in px.

    The distance at which the autocorrelation of the exemplar (its mean and its slow drift taken away) has
    fallen to 0.2, twice, averaged over the two axes: from the middle of an element to its end on either side.

    Parameters
    ----------
    features : (H, W, F) float32 array
    usable : (H, W) bool array
    """
    height, width = usable.shape
    mean = autocorrelation(features, usable)
    spans = []
    for line, length in ((mean[: height // 2, 0], height), (mean[0, : width // 2], width)):
        below = np.flatnonzero(line <= _DECAY)
        spans.append(2.0 * (below[0] if len(below) else length / 2))
    return float(np.mean(spans))


def patch_for(features: Sequence[Floats32], usable: Sequence[Mask], rooms: Sequence[tuple[int, int]]) -> int:
    """A patch size for some exemplars: a few elements, never more than a third of the smallest exemplar's
    shorter side, and smaller where holes leave no room for it.
    """
    span = float(np.mean([element_size(values, mask) for values, mask in zip(features, usable, strict=True)]))
    room = min(min(shape) for shape in rooms)
    least = int(np.clip(room // 4, min(SMALLEST, room), USUAL))
    return _fitting(int(np.clip(round(_ELEMENTS * span), least, max(min(LARGEST, room // 3), least))), usable)


def _fitting(patch: int, usable: Sequence[Mask]) -> int:
    """The largest patch, up to a size, that some exemplar has room for; that size where it has for none."""

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


def autocorrelation(features: Floats32, usable: Mask | Floats32) -> npt.NDArray[np.float32]:
    """How alike pixels are at every distance, 1 at distance 0 and about 0 far away: (H', W'), negative
    distances at the far ends.

    Parameters
    ----------
    features : (H, W, F) float32 array
    usable : (H, W) bool or float array
        Which pixels count, or how much.
    """
    size = [sf.next_fast_len(2 * length, real=True) for length in usable.shape]
    present = usable.astype(np.float32)
    pairs = _products(present, size)
    total = np.zeros(pairs.shape, np.float32)
    for channel in range(features.shape[2]):
        plane = features[..., channel]
        total += _products((plane - plane[usable > 0].mean()) * present, size)
    total /= np.maximum(pairs, 1)
    total /= max(float(total[0, 0]), 1e-12)
    return total


def _products(plane: Floats32, size: list[int]) -> npt.NDArray[np.float32]:
    result: npt.NDArray[np.float32] = sf.irfft2(np.square(np.abs(sf.rfft2(plane, size))), size)
    return result
