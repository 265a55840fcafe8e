"""Describe pictures for comparison: detail without slow changes of light, and SIFT features.

SIFT is that of Lowe, Distinctive image features from scale-invariant keypoints, IJCV 2004
(doi:10.1023/B:VISI.0000029664.99615.94). Steps and parameters follow Rey Otero and Delbracio, Anatomy of the
SIFT method, IPOL 2014 (doi:10.5201/ipol.2014.82). All points of a level are described together, each from
16 × 16 samples of the gradient in a frame turned and scaled with it. Positions and gradients are complex
numbers, y + ix.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Bytes, Complexes, Floats, Floats32, Indices, Mask
from toposeam.images import all_of_squares, as_reduced, blurred, reduced
from toposeam.layers.canvas.layer import Layer

Float = TypeVar("Float", np.float32, np.float64)

#: Pixels of the copies in which features are looked for, and patches laid on each other.
_FEATURE_PIXELS, _DETAIL_PIXELS = 200_000, 2_000_000
#: Least difference of Gaussians of a feature, of full scale: a third of what is usual.
_CONTRAST = 0.004
#: px; what changes more slowly is exposure, not content.
CONTENT_BLUR = 8.0
#: Largest distance of the nearest feature ÷ that of the next one.
_LARGEST_RATIO = 0.85


@dataclass(frozen=True, slots=True, kw_only=True)
class _SiftParameters:
    """Parameters of SIFT, as published."""

    #: Levels of an octave that are searched, octaves at most, and the least side of the last octave, px.
    levels: int = 3
    octaves: int = 8
    shortest: int = 12
    #: Blur of a camera's picture, and of the first level of an octave, px of the doubled picture.
    camera_blur: float = 1.0
    first_blur: float = 1.6
    #: Largest distance of an extremum from its pixel, px; times that a nearer pixel is looked for.
    largest_offset: float = 0.6
    relocations: int = 5
    #: Ratio of curvatures from which on a point lies on an edge.
    edge: float = 10.0
    #: Bins of the histogram of directions, times it is smoothed, and the least height of a peak, of the
    #: highest one.
    bins: int = 36
    smoothings: int = 6
    peak: float = 0.8
    #: Samples along a side of the square that a descriptor describes, and directions of its histograms.
    samples: int = 16
    directions: int = 8
    #: Greatest entry of a descriptor, of its length.
    greatest: float = 0.2


_SIFT = _SiftParameters()


@cache
def _orientation_grid() -> tuple[Complexes, Floats32]:
    """Return the places, in units of the blur, where gradients give a feature's directions, and weights."""
    grid: Any = (np.mgrid[-6:7, -6:7].T @ [1, 1j] * 0.75).ravel()
    return grid, np.exp(-(np.abs(grid) ** 2) / (2 * 1.5**2)).astype(np.float32)


@cache
def _descriptor_grid() -> tuple[Complexes, Floats32, Floats32]:
    """Return the 256 places, in units of the blur, where gradients are described, their weights, and the
    (256, 16) share of each in the 4 × 4 histograms.
    """
    count = _SIFT.samples
    side = (np.arange(count) - (count - 1) / 2) * (15 / count)
    grid = (side[:, np.newaxis] + 1j * side).ravel()
    weight = np.exp(-(np.abs(grid) ** 2) / (2 * 6.0**2)).astype(np.float32)
    shares = np.maximum(1 - np.abs(side[:, np.newaxis] - [-4.5, -1.5, 1.5, 4.5]) / 3, 0)
    return grid, weight, np.einsum("yi,xj->yxij", shares, shares).reshape(-1, 16).astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class FeatureSet:
    """A picture as it is compared: gray without slow changes, and the features of a reduced copy."""

    #: (h, w) gray without slow changes, of a copy `detail_scale` times smaller, and where it is known.
    detail: Floats32
    known: Mask
    #: px of the picture per px of the copy in which features are looked for.
    scale: int
    #: (K, 2) x and y, px of the picture, and (K, 128).
    keypoints: Floats
    descriptors: Bytes
    #: px of the picture per px of `detail`.
    detail_scale: int = 1
    #: Width and height of the picture, px, where `detail` does not say it.
    picture_size: tuple[int, int] | None = None
    #: Where it is light, to the right and 1j down, as a share of how much the gray values differ.
    light: complex = 0j

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture, px."""
        if self.picture_size is not None:
            return self.picture_size
        return self.detail.shape[1] * self.detail_scale, self.detail.shape[0] * self.detail_scale

    def __post_init__(self) -> None:
        for values in (self.detail, self.known, self.descriptors):
            values.setflags(write=False)  # as those of costs


def describe_picture(picture: Layer) -> FeatureSet:
    """Compute the detail and the features of a picture."""
    height, width = picture.image.shape[:2]
    detail_scale = max(1, int(np.ceil(np.sqrt(height * width / _DETAIL_PIXELS))))
    known = all_of_squares(picture.covered, detail_scale)
    planes = as_reduced(np.asarray(picture.image), detail_scale, picture.title, picture.data_range)
    gray = gray_of(planes, np.float32)
    gray[~known] = 0
    slow = blurred(gray, CONTENT_BLUR)[0]
    if not known.all():
        slow /= np.maximum(blurred(known.astype(np.float32), CONTENT_BLUR)[0], 1e-6)
    detail = np.where(known, gray - slow, np.float32(0)).astype(np.float32)
    scale = max(1, int(np.ceil(np.sqrt(gray.size / _FEATURE_PIXELS))))
    points, descriptors = find_features(reduced(gray, scale), _CONTRAST)
    points = (points + 0.5) * scale * detail_scale - 0.5
    light = _light(gray[::8, ::8], known[::8, ::8])
    size = (width, height)
    return FeatureSet(detail, known, scale * detail_scale, points, descriptors, detail_scale, size, light)


def _light(gray: Floats32, known: Mask) -> complex:
    """Correlate known gray values with their place: to the right and 1j down."""
    values, places = gray[known], np.argwhere(known)
    if not len(values) or not values.std():
        return 0j
    apart = (places - places.mean(axis=0)) / np.maximum(places.std(axis=0), 1e-6)
    down, right = (values - values.mean()) @ apart / (len(values) * values.std())
    return complex(right, down)


def gray_of(planes: npt.NDArray[np.float32], dtype: type[Float]) -> npt.NDArray[Float]:
    """Average (H, W, C) channels in the precision of a type: by a product, six times faster than the mean
    of an axis.
    """
    channels = planes.shape[2]
    return np.asarray(planes @ np.full(channels, 1 / channels, dtype))


def shared_features(a: FeatureSet, b: FeatureSet) -> Indices:
    """Find the features that are each other's nearest and clearly nearer than the next one.

    Returns
    -------
    (N, 2) int array
        Their numbers in `a` and in `b`.
    """
    if not (len(a.descriptors) and len(b.descriptors)):
        return np.zeros((0, 2), np.intp)
    # Whole numbers up to 128 · 255² are exact in float32, so this is what skimage.feature.match_descriptors
    # gives, in a tenth of its time: |f|² - 2 f s + |s|² of all pairs as one product.
    first, second = (one.descriptors.astype(np.float32) for one in (a, b))
    squares = [np.square(one).sum(axis=1, keepdims=True) for one in (first, second)]
    distance = np.hstack([-2 * first, squares[0], np.ones_like(squares[0])]) @ (
        np.hstack([second, np.ones_like(squares[1]), squares[1]]).T
    )
    nearest = distance.argmin(axis=1)
    numbers = np.arange(len(first))
    least = distance[numbers, nearest]
    # Down the columns numpy finds the least in a tenth of the time that it takes to say where it is.
    mutual = least == distance.min(axis=0)[nearest]
    distance[numbers, nearest] = np.inf
    next_one = np.maximum(distance.min(axis=1), np.finfo(float).eps ** 2) if len(second) > 1 else np.inf
    clear = np.sqrt(least.astype(float)) / np.sqrt(next_one) < _LARGEST_RATIO
    chosen = np.flatnonzero(mutual & clear)
    chosen = chosen[np.sort(np.unique(nearest[chosen], return_index=True)[1])]  # one of equal features
    return np.stack([numbers[chosen], nearest[chosen]], axis=1)


def find_features(image: Floats32, contrast: float) -> tuple[Floats, Bytes]:
    """Find the features of a gray picture.

    Parameters
    ----------
    image : (H, W) float32 array
        Gray values, usually from 0 to 1.
    contrast : float
        Least difference of Gaussians of a feature.

    Returns
    -------
    points : (K, 2) float array
        x and y, px; the same one once for each of its directions.
    descriptors : (K, 128) uint8 array
    """
    points, descriptors = [np.zeros((0, 2))], [np.zeros((0, 128), np.uint8)]
    doubled = _doubled(image)
    level, first = doubled, np.sqrt(_SIFT.first_blur**2 - _SIFT.camera_blur**2)
    more = np.sqrt(2 ** (2 / _SIFT.levels) - 1) * _SIFT.first_blur
    blurs = more * 2 ** (np.arange(_SIFT.levels + 2) / _SIFT.levels)
    for octave in range(_SIFT.octaves):
        if min(doubled.shape) < _SIFT.shortest * 2**octave:
            break
        levels = blurred(level, 0 if octave else first, *blurs)
        level = levels[_SIFT.levels, ::2, ::2]
        corners, offsets = _extrema(np.diff(levels, axis=0), contrast)
        for number in range(1, _SIFT.levels + 1):
            there = corners[:, 0] == number
            blur = _SIFT.first_blur * 2 ** ((number + offsets[there, 0]) / _SIFT.levels)
            at: Any = (corners[there, 1:] + offsets[there, 1:]) @ [1, 1j]
            bottom, right = (size - 1 for size in levels.shape[1:])
            inside = (
                (np.minimum(at.real, at.imag) > blur) & (at.real < bottom - blur) & (at.imag < right - blur)
            )
            if inside.any():
                at, described = _describe_points(levels[number], at[inside], blur[inside])
                points.append((np.stack([at.imag, at.real], axis=1) * 2.0**octave + 0.5) / 2 - 0.5)
                descriptors.append(described)
    return np.concatenate(points), np.concatenate(descriptors)


def _doubled(image: Floats32) -> Floats32:
    """Double a picture's sides by linear interpolation; at its borders it goes on as there."""
    rows, columns = image.shape
    around = np.pad(image, 1, mode="edge").astype(float)
    doubled = np.empty((2 * rows, 2 * columns), np.float32)
    for down in (0, 1):
        lines = 0.75 * around[1:-1]
        lines += 0.25 * around[2 * down : 2 * down + rows]
        inner = 0.75 * lines[:, 1:-1]
        for right in (0, 1):
            beside = 0.25 * lines[:, 2 * right : 2 * right + columns]
            doubled[down::2, right::2] = np.add(inner, beside, out=beside)
    return doubled


def _extrema(differences: Floats32, contrast: float) -> tuple[Indices, Floats]:
    """Find the extrema of differences of Gaussians that lie off edges.

    Returns
    -------
    corners : (N, 3) int array
        The nearest entries: level, row and column.
    offsets : (N, 3) float array
        From there to the extrema.
    """
    strides = np.array([differences[0].size, differences.shape[2], 1])
    flat = differences.ravel()
    strong = np.zeros(differences.shape, bool)
    strong[1:-1, 1:-1, 1:-1] = np.abs(differences[1:-1, 1:-1, 1:-1]) > 0.8 * contrast
    for axis in (1, 2):  # few are greater or less than both neighbours in a row, and that is tested fastest
        change = np.moveaxis(np.diff(differences[1:-1], axis=axis), axis, 0)
        np.moveaxis(strong[1:-1], axis, 0)[1:-1] &= change[1:] * change[:-1] < 0
    place = np.flatnonzero(strong)
    value = flat[place]
    neighbours = sorted(itertools.product((-1, 0, 1), repeat=3), key=np.count_nonzero)[1:]
    for neighbour in neighbours:
        other = flat[place + np.dot(neighbour, strides)]
        kept = np.where(value > 0, value > other, value < other)
        place, value = place[kept], value[kept]
    corners = np.stack(np.unravel_index(place, differences.shape), axis=1)
    last = np.array(differences.shape) - 2
    for _ in range(_SIFT.relocations):
        slope, curvature = _derivatives(flat, corners @ strides, strides)
        regular = np.linalg.det(curvature) != 0
        corners, slope, curvature = corners[regular], slope[regular], curvature[regular]
        offsets = -np.linalg.solve(curvature, slope[..., np.newaxis])[..., 0]
        step = np.sign(offsets).astype(np.intp) * (np.abs(offsets) > _SIFT.largest_offset)
        moved = np.clip(corners + step, 1, last)
        if np.array_equal(moved, corners):
            break
        corners = moved
    value = flat[corners @ strides] + 0.5 * (slope * offsets).sum(axis=1)
    across = curvature[:, 1:, 1:]
    trace, product = np.trace(across, axis1=1, axis2=2), np.linalg.det(across)
    good = (np.abs(offsets) < _SIFT.largest_offset).all(axis=1) & (np.abs(value) > contrast)
    good &= trace**2 < product * (_SIFT.edge + 1) ** 2 / _SIFT.edge
    return corners[good], offsets[good]


def _derivatives(flat: Floats32, place: Indices, strides: Indices) -> tuple[Floats, Floats]:
    """Compute the (N, 3) first and (N, 3, 3) second derivatives at entries of a raveled array."""
    before, after = (flat[place[:, np.newaxis] + sign * strides].astype(float) for sign in (-1, 1))
    second = np.empty((len(place), 3, 3))
    second[:, range(3), range(3)] = before + after - 2 * flat[place].astype(float)[:, np.newaxis]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        mixed: Any = 0.0
        for a, b in itertools.product((-1, 1), repeat=2):
            mixed = mixed + a * b * flat[place + a * strides[i] + b * strides[j]].astype(float)
        second[:, i, j] = second[:, j, i] = mixed / 4
    return (after - before) / 2, second


def _describe_points(level: Floats32, at: Complexes, blur: Floats) -> tuple[Complexes, Bytes]:
    """Describe the points of a level, each once for each of its directions: places and descriptors."""
    down, right = np.gradient(level)
    gradient = (down + 1j * right).astype(np.complex64)
    around, around_weight = _orientation_grid()
    point, direction = _directions(_sample_gradient(gradient, at, blur, around), around_weight)
    at, turned = at[point], np.exp(1j * direction)
    grid, weight, shares = _descriptor_grid()
    samples = _sample_gradient(gradient, at, blur[point] * turned, grid)
    samples *= turned.conj().astype(np.complex64)[:, np.newaxis]
    strength, count = np.abs(samples) * weight, _SIFT.directions
    angle = np.angle(samples) * np.float32(count / (2 * np.pi))
    histograms = np.empty((len(at), 16, count), np.float32)
    for number in range(-count // 2, count // 2):  # angles are from -4 to 4
        apart = np.abs(angle - number)
        np.minimum(apart, count - apart, out=apart)
        histograms[..., number] = (strength * np.maximum(1 - apart, 0)) @ shares
    entries = histograms.reshape(len(at), 128)
    entries = np.minimum(entries, _SIFT.greatest * np.linalg.norm(entries, axis=1, keepdims=True))
    length = np.maximum(np.linalg.norm(entries, axis=1, keepdims=True), np.finfo(np.float32).tiny)
    return at, np.minimum(512 * entries / length, 255).astype(np.uint8)


def _sample_gradient(gradient: Any, at: Complexes, scale: Any, grid: Complexes) -> Any:
    """Sample the gradient at a grid laid round each point, bilinear, 0 outside: (N, M) complex64."""
    where = at[:, np.newaxis] + np.multiply.outer(scale, grid)
    (row, down, high), (column, right, wide) = (
        _split(part, size - 1) for part, size in zip((where.real, where.imag), gradient.shape, strict=True)
    )
    flat, place = gradient.ravel(), row * gradient.shape[1] + column

    def along(place: Any) -> Any:
        left = flat.take(place)
        return left + right * (flat.take(place + 1) - left)

    upper = along(place)
    result = upper + down * (along(place + gradient.shape[1]) - upper)
    result *= high & wide
    return result


def _split(values: Any, last: int) -> tuple[Indices, Floats32, Mask]:
    """Split values into integers below the last one and fractions, and test which lie from 0 to the last."""
    inside = (values >= 0) & (values <= last)
    values = np.clip(values, 0, last)
    whole = np.minimum(values.astype(np.intp), last - 1)
    return whole, (values - whole).astype(np.float32), inside


def _directions(samples: Any, weight: Floats32) -> tuple[Indices, Floats]:
    """Find the peaks of each point's histogram of gradients: the numbers of points, and the peaks' angles."""
    count, bins = len(samples), _SIFT.bins
    angle = np.rint(np.angle(samples) * (bins / (2 * np.pi))).astype(np.intp) % bins
    angle += bins * np.arange(count)[:, np.newaxis]
    weights = np.abs(samples) * weight
    histogram: Any = np.bincount(angle.ravel(), weights.ravel(), count * bins).reshape(count, bins)
    for _ in range(_SIFT.smoothings):
        histogram = (np.roll(histogram, 1, axis=1) + histogram + np.roll(histogram, -1, axis=1)) / 3
    before, after = np.roll(histogram, 1, axis=1), np.roll(histogram, -1, axis=1)
    high = histogram >= _SIFT.peak * histogram.max(axis=1, keepdims=True)
    point, peak = np.nonzero(high & (histogram > before) & (histogram >= after))
    least, most, rest = (values[point, peak] for values in (before, histogram, after))
    return point, (peak + (least - rest) / (2 * (least + rest - 2 * most))) * (2 * np.pi / bins)
