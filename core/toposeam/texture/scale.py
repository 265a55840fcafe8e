"""How large the elements of a texture are, seen from its autocorrelation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import scipy.fft as sf

from toposeam.images import Mask
from toposeam.texture.atlas import Floats32

#: Patches are no smaller and, when their size is chosen automatically, no larger than this, px.
SMALLEST, LARGEST = 8, 96
#: A patch holds about this many elements side by side.
_ELEMENTS = 4
#: Where the autocorrelation has fallen to this, one element has ended.
_DECAY = 0.2


def element_size(features: Floats32, usable: Mask) -> float:
    """The size of a texture's elements in px.

    The distance at which the autocorrelation of the exemplar (its mean and its slow drift taken away) has fallen to 0.2, twice, averaged
    over the two axes: from the middle of an element to its end on either side.

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


def natural_patch(features: Sequence[Floats32], usable: Sequence[Mask], rooms: Sequence[tuple[int, int]]) -> int:
    """A patch size for some exemplars: a few elements, and never more than a third of the smallest exemplar's shorter side."""
    span = float(np.mean([element_size(values, mask) for values, mask in zip(features, usable, strict=True)]))
    room = min(min(shape) for shape in rooms)
    return int(np.clip(round(_ELEMENTS * span), min(SMALLEST * 3, room), max(min(LARGEST, room // 3), min(SMALLEST * 3, room))))


def autocorrelation(features: Floats32, usable: Mask) -> npt.NDArray[np.float32]:
    """How alike pixels are at every distance, 1 at distance 0 and about 0 far away: (H', W'), negative distances at the far ends.

    Parameters
    ----------
    features : (H, W, F) float32 array
    usable : (H, W) bool array
    """
    size = [sf.next_fast_len(2 * length, real=True) for length in usable.shape]
    present = usable.astype(np.float32)
    pairs = _products(present, size)
    total = np.zeros(pairs.shape, np.float32)
    for channel in range(features.shape[2]):
        plane = features[..., channel]
        total += _products((plane - plane[usable].mean()) * present, size)
    total /= np.maximum(pairs, 1)
    total /= max(float(total[0, 0]), 1e-12)
    return total


def _products(plane: Floats32, size: list[int]) -> npt.NDArray[np.float32]:
    result: npt.NDArray[np.float32] = sf.irfft2(np.square(np.abs(sf.rfft2(plane, size))), size)
    return result
