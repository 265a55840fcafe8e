"""Slow light: whether a sample has any, taken out of it, and levelled between patches.

*Levelling.* Patches of a sample that is brighter on one side than on the other do not fit by their light even
where their structure fits. So structure is compared without light, and each copy gets a light of its own
that multiplies all channels alike, so that no hue changes: in logarithms a plane, an offset and two slopes,
in the copy's own coordinates in the sample. These make neighbours agree along their seams in the
least-squares sense and, as far as that leaves it open, take the sample's slope out. The error of a logarithm
is that of the value over the value, so joints weigh by the square of their brightness: else shadows, which
end sharply on one side only, would tell how bright their neighbours are, and light would drift from one side
of a texture to the other.

*Flattening.* A quadratic surface through the sample's values is its light; each channel is divided by it.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import linalg

from toposeam.arrays import Floats, Floats32, Image, Ints32, Mask
from toposeam.errors import ImageError, Term
from toposeam.images import as_array, as_mask, check_values, full_scale, in_dtype
from toposeam.texture.canvas.copy_borders import ROWS, joints
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.sources import Images, as_list
from toposeam.texture.light.shared_light import quadratic_terms, shared_light

#: Least share of a sample's variance that a quadratic surface explains where its light is slow, and least
#: light that dark and bright parts of it share there; half of that where the surface explains most.
_LEAST_EXPLAINED, _LEAST_SHARED, _MOSTLY = 0.05, 0.1, 0.5
#: Difference across a seam, as a share of white, that counts half; much larger ones are edges.
_HALF_WEIGHT = 0.15
#: Weight of a copy's offset, and of its slope across the whole sample, against its seams: so a step that
#: seams leave is carried on over a few patches, not over the whole texture.
_OFFSET_WEIGHT, _SLOPE_WEIGHT = 0.1, 0.2
#: Share of white that is added to values before their logarithm is taken, so that black has one.
_FLOOR = 0.05
#: Number of pixels of a texture, about, by which its brightness is measured.
_SAMPLES = 1 << 13
#: Least value of fitted light, as a share of its mean, so that no quotient explodes.
_LEAST_LIGHT = 0.1


def has_slow_light(features: Floats32, usable: Mask) -> bool:
    """Test whether light changes slowly over a sample.

    Parameters
    ----------
    features : (H, W, F) float32 array
    usable : (H, W) bool array
    """
    if not usable.any():
        return False
    values = features[usable].astype(np.float64)
    values -= values[0]  # or rounding would decide of what is nearly alike everywhere
    basis = quadratic_terms(usable.shape)[usable]
    along, mean = basis.T @ values, values.mean(axis=0)
    none = len(values) * float(np.square(mean).sum())
    whole = float(np.square(values).sum()) - none
    # The residual of a least-squares surface is orthogonal to it.
    explained = float((_fitted(basis, along) * along).sum()) - none
    if not (whole > 0 and explained >= _LEAST_EXPLAINED * whole):
        return False
    least = _LEAST_SHARED if explained < _MOSTLY * whole else _LEAST_SHARED / 2
    return shared_light(features.mean(axis=2), usable) >= least


def without_light(features: Floats32, present: Mask, copied: Mask) -> Floats32:
    """Take slow light out of features, which keep their mean, so that structure is compared.

    Light is fitted to the pixels that may be copied; the others are only compared.
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
    """Take slow light out of a sample.

    Each channel is divided by the quadratic surface that fits it best, and keeps its mean.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like
        Colours; for normals or heights it makes no sense.
    source_mask : (H, W) array_like, optional
        Where it has values that count.
    data_range : float, optional
        The value that counts as white, as for :func:`toposeam.synth`.

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
    >>> int(np.ptp(ts.texture.flatten_light(slope))) <= 4
    True
    """
    array = as_array(image)
    shape = (array.shape[0], array.shape[1])
    where = np.ones(shape, bool) if source_mask is None else as_mask(source_mask, shape, "source_mask")
    if not where.any():
        raise ImageError(
            "{mask} is empty, so there is no light to find; paint it white somewhere",
            kind="nothing to sample",
            mask=Term("source_mask"),
        )
    gone = ~where if array.ndim == 2 else ~where[..., np.newaxis]
    check_values(np.where(gone, array.dtype.type(0), array), "image", data_range)
    values = np.where(gone & ~np.isfinite(array), 0.0, array.astype(np.float64))
    deep = values[..., np.newaxis] if values.ndim == 2 else values
    light = _surface(deep, where)
    mean = deep[where].mean(axis=0)
    flat = deep * mean / np.maximum(light, np.maximum(_LEAST_LIGHT * np.abs(mean), 1e-12))
    flat = flat[..., 0] if values.ndim == 2 else flat
    if np.issubdtype(array.dtype, np.integer):
        flat = np.clip(flat, 0, float(data_range or full_scale(array.dtype)))
    return in_dtype(flat, array.dtype)


def flattened(source: Images, mask: Images | None, white: float | None) -> list[Any]:
    """Take slow light out of several samples, white being one value."""
    several: list[Any] = list(source) if isinstance(source, list | tuple) else [source]
    masks = as_list(mask, len(several), "source_mask")
    return [
        flatten_light(image, source_mask=where, data_range=white)
        for image, where in zip(several, masks, strict=True)
    ]


def _surface(values: npt.NDArray[Any], where: Mask) -> Floats:
    """Fit a quadratic surface to some pixels, (H, W, C)."""
    basis = quadratic_terms(where.shape)
    some = basis[where]
    result: Floats = basis @ _fitted(some, some.T @ values[where])
    return result


def _fitted(basis: Floats, along: Floats) -> Floats:
    """Compute the least-squares factors (6, C) of (n, 6) terms, given their products with values (n, C)."""
    return np.asarray(np.linalg.lstsq(basis.T @ basis, along, rcond=None)[0], np.float64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CopyLight:
    """The light that copies are given. It multiplies values above `floor`, those of all channels alike, and
    its logarithm is a plane in the copy's own coordinates in the exemplar; where a channel would leave the
    range of values, it is nearer to 1.
    """

    atlas: Atlas
    coefficients: Floats  #: (P, 3), of each patch: in the exemplar's middle, slopes; or P = 0
    floor: np.float32
    low: float
    high: float
    #: (2, AH * AW) float32: least and largest gain of each pixel of the atlas.
    limits: Floats32

    @classmethod
    def of(cls, plane: Floats32, atlas: Atlas) -> CopyLight:
        """Leave the copies of a sample (AH, AW, C) as they are."""
        low, high = (float(limit(plane[atlas.copied])) for limit in (np.min, np.max))
        return cls(
            atlas=atlas,
            coefficients=np.empty((0, 3)),
            floor=np.float32(0),
            low=low,
            high=high,
            limits=np.empty((2, 0), np.float32),
        )

    def given(self, coefficients: Floats, floor: float, plane: Floats32) -> CopyLight:
        """Give the copies of a sample (AH, AW, C) light."""
        limits = [
            (limit + floor) / np.maximum(extreme(plane, axis=2).ravel() + floor, 1e-6)
            for limit, extreme in ((self.low, np.min), (self.high, np.max))
        ]
        kept = np.stack([np.minimum(limits[0], 1), np.maximum(limits[1], 1)]).astype(np.float32)
        return dataclasses.replace(self, coefficients=coefficients, floor=np.float32(floor), limits=kept)

    def gain(self, index: Ints32, labels: Ints32) -> Floats32:
        """Compute the gain (…, 1) at pixels, given by flat index and number of the patch that show there."""
        if not len(self.coefficients):
            return np.ones((*index.shape, 1), np.float32)
        there = np.maximum(index, 0)
        (down, right), numbers = _places(self.atlas, there), np.maximum(labels, 0)
        even, lower, further = np.ascontiguousarray(self.coefficients.T)
        light = even.take(numbers)
        light += lower.take(numbers) * down
        light += further.take(numbers) * right
        gain = np.exp(light, out=light).astype(np.float32)
        np.clip(gain, self.limits[0].take(there), self.limits[1].take(there), out=gain)
        result: Floats32 = gain[..., np.newaxis]
        return result

    def offset(self, gain: Floats32) -> Floats32:
        """Compute the offset of a value that has been multiplied by a gain."""
        result: Floats32 = (gain - 1) * self.floor
        return result


def levelled_copies(
    plane: Floats32,
    even: Floats32,
    atlas: Atlas,
    index: Ints32,
    labels: Ints32,
    copies: Ints32,
    wraps: tuple[bool, bool],
) -> CopyLight:
    """Compute the light to be given to the copies of a texture so that it agrees.

    Parameters
    ----------
    plane : (AH, AW, C) float32 array
        The sample.
    even : (AH, AW, F) float32 array
        The same without its slow light, 1 being white: where copies differ in this, they have an edge that is
        no matter of light.
    atlas : Atlas
    index, labels : (H, W) int32 arrays
        Flat index and number of the patch that show at each pixel.
    copies : (P,) int32 array
        The first patch of the copy that each patch belongs to.
    wraps : (bool, bool)
        Whether rows and columns continue at the opposite border.

    Returns
    -------
    CopyLight
    """
    given, level = plane.reshape(-1, plane.shape[2]), even.reshape(-1, even.shape[2])
    white, usable = float(np.abs(plane[atlas.copied]).max()) or 1.0, atlas.usable.ravel()
    bright = np.maximum(given, 0).mean(axis=1, keepdims=True) / white
    flat = np.log(bright + _FLOOR)  # light multiplies
    certain = np.square(bright[:, 0] + _FLOOR)
    certain /= certain[atlas.copied.ravel()].mean()
    parts = []
    for first, second, step in joints(index, atlas.width, wraps):
        a, b = (copies[labels.take(place)] for place in (first, second))
        two = np.flatnonzero(a != b)
        a, b, p, q = a[two], b[two], index.take(first[two]), index.take(second[two])
        ahead, behind = np.minimum(p + step, len(flat) - 1), np.maximum(q - step, 0)
        known = np.stack([usable[behind], usable[ahead]], axis=1).astype(np.float32)
        apart = (flat[p] - flat[behind]) * known[:, :1] + (flat[ahead] - flat[q]) * known[:, 1:]
        apart /= np.maximum(known.sum(axis=1, keepdims=True), 1)
        differs = np.maximum(
            np.abs(level[p] - level[behind]) * known[:, :1], np.abs(level[ahead] - level[q]) * known[:, 1:]
        )
        weight = known.any(axis=1) / (1 + (differs.max(axis=1, initial=0) / _HALF_WEIGHT) ** 4)
        weight *= np.minimum(certain[p], certain[q])
        terms = np.concatenate([_coordinates(atlas, p), -_coordinates(atlas, q)], axis=1)
        parts.append(_pairs(a, b, terms, apart, weight))
    matrix, wanted = _equations(parts, _slope_coefficients(flat, atlas, index, labels, copies))
    solved = linalg.splu(matrix).solve(wanted) if len(copies) else wanted
    light = CopyLight.of(plane, atlas).given(solved.reshape(-1, 3)[copies], _FLOOR * white, plane)
    return _as_bright(light, plane, index, labels) if len(copies) else light


def _as_bright(light: CopyLight, plane: Floats32, index: Ints32, labels: Ints32) -> CopyLight:
    """Shift the light so that the values of the texture are nearest to those of its exemplars, each to that
    of its rank; agreement along seams leaves that open.
    """
    atlas, step = light.atlas, max(1, round((index.size / _SAMPLES) ** 0.5))
    index, labels = index[::step, ::step], labels[::step, ::step]
    shown = index >= 0
    index, labels = index[shown], labels[shown]
    exemplar, _ = atlas.locate(index)
    bright, wanted = plane.mean(axis=2), []
    for number, count in enumerate(np.bincount(exemplar, minlength=len(atlas.places)).tolist()):
        place = atlas.places[number]
        values = bright[place][atlas.copied[place]]
        wanted.append(values[np.linspace(0, len(values) - 1, count).astype(np.intp)])
    given = np.sort(np.concatenate(wanted) + light.floor)
    made = np.sort((bright.ravel().take(index) + light.floor) * light.gain(index, labels)[..., 0])
    # The factor that makes the sum of |given - factor * made| least is a weighted median.
    weight = np.maximum(made, np.float32(1e-9))
    ratio = np.maximum(given, np.float32(1e-9)) / weight
    order = np.argsort(ratio)
    middle = np.searchsorted(np.cumsum(weight[order], dtype=np.float64), 0.5 * weight.sum(dtype=np.float64))
    coefficients = light.coefficients.copy()
    coefficients[:, 0] += np.log(float(ratio[order[middle]]))
    return dataclasses.replace(light, coefficients=coefficients)


def _pairs(
    a: Ints32, b: Ints32, terms: Floats, apart: npt.NDArray[Any], weight: npt.NDArray[Any]
) -> tuple[npt.NDArray[np.intp], Floats, Floats, Floats]:
    """Sum the normal equations of joints by the pairs of copies that meet there.

    Parameters
    ----------
    a, b : (n,) int32 arrays
        The two copies.
    terms : (n, 6) array
        Factors of their coefficients in the difference of their light.
    apart : (n, C) array
        Difference in brightness of the first copy from the second.
    weight : (n,) array

    Returns
    -------
    tuple
        (m, 2) copies; their (m, 6, 6) part of the normal equations and (m, 6, C) of the right side; the (m,)
        weight of their joints.
    """
    keys, at = np.unique(a.astype(np.intp) << 32 | b, return_inverse=True)
    found, count = np.stack([keys >> 32, keys & 0xFFFFFFFF], axis=1), len(keys)

    def summed(values: npt.NDArray[Any]) -> Floats:
        result: npt.NDArray[Any] = np.bincount(at, weight * values, count)
        return result

    matrix: Floats = np.empty((count, 6, 6))
    wanted: Floats = np.empty((count, 6, apart.shape[1]))
    for k in range(6):
        for m in range(k, 6):
            matrix[:, k, m] = matrix[:, m, k] = summed(terms[:, k] * terms[:, m])
        for channel in range(apart.shape[1]):
            wanted[:, k, channel] = -summed(terms[:, k] * apart[:, channel])
    return found, matrix, wanted, summed(np.ones(len(at)))


def _equations(
    parts: list[tuple[npt.NDArray[np.intp], Floats, Floats, Floats]], even: Floats
) -> tuple[sparse.csc_matrix, Floats]:
    """Assemble the normal equations for three coefficients of each copy, which tend to given ones,
    (P, 3, C).
    """
    size = 3 * len(even)
    pairs, matrices, wishes, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
    line = (3 * pairs[:, :, np.newaxis] + np.arange(3)).reshape(-1, 6)
    rows, columns = np.broadcast_arrays(line[:, :, np.newaxis], line[:, np.newaxis])
    matrix = sparse.csc_matrix((matrices.ravel(), (rows.ravel(), columns.ravel())), (size, size))
    wanted = np.zeros((size, even.shape[2]))
    np.add.at(wanted, line, wishes)
    known = 1 + np.bincount(pairs.ravel(), weights.repeat(2), len(even))
    least = np.stack([_OFFSET_WEIGHT * known, _SLOPE_WEIGHT * known, _SLOPE_WEIGHT * known], axis=1).ravel()
    wanted += least[:, np.newaxis] * even.reshape(size, -1)
    return sparse.csc_matrix(matrix + sparse.diags(least)), wanted


def _slope_coefficients(
    flat: Floats32, atlas: Atlas, index: Ints32, labels: Ints32, copies: Ints32
) -> Floats:
    """Compute the coefficients that would take the slopes of its exemplar's light out of each copy."""
    slopes = []
    for place in atlas.places:
        inside = np.zeros(atlas.copied.shape, bool)
        inside[place] = atlas.copied[place]
        at = np.flatnonzero(inside)
        basis = _coordinates(atlas, at.astype(np.int32))
        found = np.linalg.lstsq(basis.T @ basis, basis.T @ flat[at], rcond=None)[0]
        slopes.append(np.concatenate([np.zeros((1, found.shape[1])), -found[1:]]))
    exemplar = np.zeros(len(copies), np.intp)
    for first in range(0, len(index) if len(slopes) > 1 else 0, ROWS):
        rows = slice(first, first + ROWS)
        shown = labels[rows] >= 0
        exemplar[copies[labels[rows][shown]]] = atlas.locate(index[rows][shown])[0]
    result: Floats = np.stack(slopes)[exemplar]
    return result


def _coordinates(atlas: Atlas, index: Ints32) -> Floats:
    """Compute (…, 3): 1, and row and column in the exemplar from -1 to 1."""
    return np.stack([np.ones(index.shape), *_places(atlas, index)], axis=-1)


def _places(atlas: Atlas, index: Ints32) -> tuple[Floats, Floats]:
    """Compute row and column in the exemplar, from -1 to 1 each."""
    owner, half = atlas.owner_of_rows, atlas.shapes / 2
    row, column = np.divmod(index, np.int32(atlas.width))
    rows = np.arange(len(owner)) - atlas.corners[owner, 0]
    down = (rows / half[owner, 0] - 1).take(row)
    right = (column - atlas.corners[0, 1]) / half[owner, 1].take(row) - 1
    return down, right
