"""Slow light: how much of it a sample has, taken out of it, and levelled between patches.

*Levelling.* Patches of a sample that is brighter on one side than on the other do not fit by their light even
where their structure fits. So structure is compared without light, and each copy gets a light of its own
that multiplies every channel: in logarithms a plane, an offset and two slopes, in the copy's own coordinates
in the sample. These make neighbours agree along their seams in the least-squares sense and, as far as that
leaves it open, take the sample's slope out.

*Flattening.* A quadratic surface through the sample's values is its light; each channel is divided by it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import linalg

from toposeam.errors import ImageError
from toposeam.images import Image, Mask, as_array, as_mask, check_values, full_scale
from toposeam.texture.atlas import Atlas, Floats32, Ints32
from toposeam.texture.rendering import Lift
from toposeam.texture.sources import Images, as_list

#: Share of a sample's variance that a quadratic surface explains, from which on its light counts as slow.
_SLOW = 0.1
#: A difference across a seam, in shares of white, that counts half.
_LIGHT = 0.15
#: What an offset, and a slope across the whole sample, counts against the seams of the copy.
_OFFSET, _SLOPE = 0.02, 0.2
#: Added to values, in shares of white, before their logarithm is taken.
_BLACK = 0.05
#: Rows of the canvas for which light is made at a time.
_ROWS = 256
#: Light is nowhere taken to be darker than this share of its mean.
_DARKEST = 0.1

Floats = npt.NDArray[np.float64]


def has_slow_light(features: Floats32, usable: Mask) -> bool:
    """Whether light changes slowly over a sample.

    Parameters
    ----------
    features : (H, W, F) float32 array
    usable : (H, W) bool array
    """
    values = features[usable]
    whole = float(values.var(axis=0).sum())
    if whole == 0:
        return False
    left = values - _surface(features, usable)[usable]
    return 1 - float(left.var(axis=0).sum()) / whole >= _SLOW


def without_light(features: Floats32, present: Mask, copied: Mask) -> Floats32:
    """Features without their slow light, about their mean: what structure is compared by.

    The light is that of what is copied; what lies beside it is only compared.
    """
    even = features - _surface(features, copied) + features[copied].mean(axis=0)
    result: Floats32 = np.where(present[..., np.newaxis], even, 0).astype(np.float32)
    return result


def flatten_light(
    image: npt.ArrayLike,
    *,
    source_mask: npt.ArrayLike | None = None,
    data_range: float | None = None,
) -> Image:
    """A sample without its slow light.

    Each channel is divided by the quadratic surface that fits it best, and keeps its mean.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like
        Colours; for normals or heights it makes no sense.
    source_mask : (H, W) array_like, optional
        Where it has values that count.
    data_range : float, optional
        The value that counts as white, as for :func:`toposeam.synthesize`.

    Returns
    -------
    (H, W) or (H, W, C) array of the image's dtype
        Of integers none below 0 or beyond white.

    Raises
    ------
    ImageError
        For images or masks that cannot be used; where `data_range` is needed.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> slope = np.tile(np.linspace(60, 180, 64).astype(np.uint8), (64, 1))
    >>> int(np.ptp(ts.flatten_light(slope))) <= 4
    True
    """
    array = as_array(image)
    shape = (array.shape[0], array.shape[1])
    where = np.ones(shape, bool) if source_mask is None else as_mask(source_mask, shape, "source_mask")
    if not where.any():
        raise ImageError("source_mask is empty, so there is no light to find; paint it white somewhere")
    gone = ~where if array.ndim == 2 else ~where[..., np.newaxis]
    check_values(np.where(gone, array.dtype.type(0), array), "image", data_range)
    values = np.where(gone & ~np.isfinite(array), 0.0, array.astype(np.float64))
    deep = values[..., np.newaxis] if values.ndim == 2 else values
    light = _surface(deep, where)
    mean = deep[where].mean(axis=0)
    flat = deep * mean / np.maximum(light, np.maximum(_DARKEST * np.abs(mean), 1e-12))
    flat = flat[..., 0] if values.ndim == 2 else flat
    if np.issubdtype(array.dtype, np.integer):
        flat = np.rint(np.clip(flat, 0, float(data_range or full_scale(array.dtype))))
    result: Image = flat.astype(array.dtype)
    return result


def flattened(source: Images, mask: Images | None, white: float | None) -> list[Any]:
    """Several samples without their slow light, white being one value."""
    several: list[Any] = list(source) if isinstance(source, list | tuple) else [source]
    masks = as_list(mask, len(several), "source_mask")
    return [
        flatten_light(image, source_mask=where, data_range=white)
        for image, where in zip(several, masks, strict=True)
    ]


def _surface(values: npt.NDArray[Any], where: Mask) -> Floats:
    """(H, W, C), the quadratic surface through some pixels."""
    y, x = (np.linspace(-1, 1, length) for length in where.shape)
    y, x = y[:, np.newaxis], x[np.newaxis]
    terms = [np.ones(where.shape), y + 0 * x, x + 0 * y, y * x, y * y + 0 * x, x * x + 0 * y]
    basis = np.stack(terms, axis=2)
    some = basis[where]
    found = np.linalg.lstsq(some.T @ some, some.T @ values[where], rcond=None)[0]
    result: Floats = basis @ found
    return result


def levelled_copies(
    plane: Floats32,
    even: Floats32,
    atlas: Atlas,
    index: Ints32,
    labels: Ints32,
    wraps: tuple[bool, bool],
) -> Lift:
    """The light to be given to the copies of a texture so that it agrees.

    Parameters
    ----------
    plane : (AH, AW, C) float32 array
        The sample.
    even : (AH, AW, F) float32 array
        The same without its slow light, 1 being white: where copies differ in this, they have an edge that is
        no matter of light.
    atlas : Atlas
    index, labels : (H, W) int32 arrays
        What shows at each pixel, and the number of the copy.
    wraps : (bool, bool)
        Whether rows and columns continue at the opposite border.

    Returns
    -------
    Lift
    """
    given, level = plane.reshape(-1, plane.shape[2]), even.reshape(-1, even.shape[2])
    low, high = (float(limit(plane[atlas.copied])) for limit in (np.min, np.max))
    white, usable, stride = max(abs(low), abs(high)) or 1.0, atlas.usable.ravel(), atlas.width
    flat = np.log(np.maximum(given, 0) / white + _BLACK)  # light multiplies
    firsts, seconds, differences, weights = [], [], [], []
    for axis, step in ((1, 1), (0, stride)):
        q_index, q_label = np.roll(index, -1, axis), np.roll(labels, -1, axis)
        seam = (labels != q_label) & (index >= 0) & (q_index >= 0)
        if not wraps[axis]:
            seam[(slice(-1, None), slice(None)) if axis == 0 else (slice(None), slice(-1, None))] = False
        p, q = index[seam], q_index[seam]
        ahead, behind = np.minimum(p + step, len(flat) - 1), np.maximum(q - step, 0)
        known = np.stack([usable[behind], usable[ahead]], axis=1).astype(np.float32)
        apart = (flat[p] - flat[behind]) * known[:, :1] + (flat[ahead] - flat[q]) * known[:, 1:]
        apart /= np.maximum(known.sum(axis=1, keepdims=True), 1)
        firsts.append((labels[seam], p))
        seconds.append((q_label[seam], q))
        differences.append(apart)
        off = np.maximum(
            np.abs(level[p] - level[behind]) * known[:, :1], np.abs(level[ahead] - level[q]) * known[:, 1:]
        )
        off = off.max(axis=1, initial=0) / _LIGHT
        weights.append((known.any(axis=1) / (1 + off**4)).astype(np.float64))
    difference, weight = np.concatenate(differences).astype(np.float64), np.concatenate(weights)
    count = int(labels.max()) + 1
    at = [_coordinates(atlas, np.concatenate([indices for _, indices in side])) for side in (firsts, seconds)]
    patch = [np.concatenate([label for label, _ in side]).astype(np.intp) for side in (firsts, seconds)]
    matrix, wanted = _equations(patch, at, difference, weight, _even(flat, atlas, index, labels, count))
    solved = linalg.splu(matrix).solve(wanted) if count else wanted
    coefficients = solved.reshape(count, 3, -1)
    gain = np.empty((*index.shape, given.shape[1]), np.float32)
    for first in range(0, len(index), _ROWS):  # in double precision all of it would take a gigabyte
        rows = slice(first, first + _ROWS)
        found = coefficients[np.maximum(labels[rows], 0)]
        terms = _coordinates(atlas, np.maximum(index[rows], 0))
        gain[rows] = np.exp(np.einsum("hwk,hwkc->hwc", terms, found))
    offset = gain - 1
    offset *= np.float32(_BLACK * white)
    return Lift(gain=gain, offset=offset, low=low, high=high)


def _equations(
    patch: list[npt.NDArray[np.intp]], at: list[Floats], difference: Floats, weight: Floats, even: Floats
) -> tuple[sparse.csc_matrix, Floats]:
    """The normal equations for three coefficients of each copy, which tend to given ones, (n, 3, C)."""
    count, size = len(even), 3 * len(even)
    rows, columns, entries = [], [], []
    wanted = np.zeros((size, difference.shape[1]))
    for first, sign in ((0, 1.0), (1, -1.0)):
        for k in range(3):
            line = 3 * patch[first] + k
            for channel in range(difference.shape[1]):
                wanted[:, channel] -= np.bincount(
                    line, sign * weight * at[first][:, k] * difference[:, channel], size
                )
            for second in (0, 1):
                both = 1.0 if first == second else -1.0
                for m in range(3):
                    rows.append(line)
                    columns.append(3 * patch[second] + m)
                    entries.append(both * weight * at[first][:, k] * at[second][:, m])
    matrix = sparse.csc_matrix(
        (np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))), (size, size)
    )
    known = sum(np.bincount(label, weight, count) for label in patch) + 1.0
    least = np.stack([_OFFSET * known, _SLOPE * known, _SLOPE * known], axis=1).ravel()
    wanted += least[:, np.newaxis] * even.reshape(size, -1)
    return sparse.csc_matrix(matrix + sparse.diags(least)), wanted


def _even(flat: Floats32, atlas: Atlas, index: Ints32, labels: Ints32, count: int) -> Floats:
    """The coefficients that would take the slopes of its exemplar's light out of each copy."""
    slopes = []
    for place in atlas.places:
        inside = np.zeros(atlas.copied.shape, bool)
        inside[place] = atlas.copied[place]
        at = np.flatnonzero(inside)
        basis = _coordinates(atlas, at.astype(np.int32))
        found = np.linalg.lstsq(basis.T @ basis, basis.T @ flat[at], rcond=None)[0]
        slopes.append(np.concatenate([np.zeros((1, found.shape[1])), -found[1:]]))
    shown, first = np.unique(labels, return_index=True)
    exemplar = np.zeros(count, np.intp)
    exemplar[shown[shown >= 0]] = atlas.locate(index.ravel()[first[shown >= 0]])[0]
    result: Floats = np.stack(slopes)[exemplar]
    return result


def _coordinates(atlas: Atlas, index: Ints32) -> Floats:
    """(…, 3): 1, and row and column in the exemplar from -1 to 1."""
    exemplar, place = atlas.locate(index)
    half = atlas.shapes[exemplar] / 2
    return np.concatenate([np.ones((*index.shape, 1)), place / half - 1], axis=-1)
