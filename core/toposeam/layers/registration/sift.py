"""SIFT: points that are found again at another size, angle and brightness, and what they look like.

Lowe, Distinctive image features from scale-invariant keypoints, IJCV 2004. Steps and constants are those of
Rey Otero and Delbracio, Anatomy of the SIFT method, IPOL 2014 (doi 10.5201/ipol.2014.82). All points of a
level are described together, each from 16 × 16 samples of the gradient in a frame turned and scaled with it.
Positions and gradients are complex numbers, y + ix.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Complexes, Floats, Floats32, Indices

#: (N, 3) of a level, a row and a column each.

#: Levels of an octave, and octaves at most; the last one's shorter side has so many px at least.
_LEVELS, _OCTAVES, _SHORTEST = 3, 8, 12
#: Blur of a camera's picture, and of the first level of an octave, pixels of the doubled picture.
_CAMERA_BLUR, _BLUR = 1.0, 1.6
#: An extremum is looked for again where it lies farther from a pixel, up to so many times.
_OFFSET, _TIMES = 0.6, 5
#: Ratio of curvatures from which on a point lies on an edge.
_EDGE = 10.0

#: Directions of a histogram, times it is smoothed, and how high a peak is, by the highest one.
_BINS, _SMOOTHED, _PEAK = 36, 6, 0.8
#: Samples along a side of the square that a descriptor describes.
_SAMPLES = 16
#: Where gradients are sampled for directions and for descriptors, in units of the blur; their weights.
_ROUND = (np.mgrid[-6:7, -6:7].T @ [1, 1j] * 0.75).ravel()
_ROUND_WEIGHT = np.exp(-(np.abs(_ROUND) ** 2) / (2 * 1.5**2)).astype(np.float32)
_SIDE = (np.arange(_SAMPLES) - (_SAMPLES - 1) / 2) * (15 / _SAMPLES)
_PATCH = (_SIDE[:, np.newaxis] + 1j * _SIDE).ravel()
_PATCH_WEIGHT = np.exp(-(np.abs(_PATCH) ** 2) / (2 * 6.0**2)).astype(np.float32)
#: (256, 16): the share of each sample in each of 4 × 4 histograms of 8 directions.
_SHARE_1D = np.maximum(1 - np.abs(_SIDE[:, np.newaxis] - [-4.5, -1.5, 1.5, 4.5]) / 3, 0)
_SHARE = np.einsum("yi,xj->yxij", _SHARE_1D, _SHARE_1D).reshape(-1, 16).astype(np.float32)
_DIRECTIONS = 8
#: Of a descriptor's length: no entry is greater.
_GREATEST = 0.2


def find_features(image: Floats32, contrast: float) -> tuple[Floats, npt.NDArray[np.uint8]]:
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
    doubled = scipy.ndimage.zoom(image, 2, order=1, mode="nearest", grid_mode=True)
    level = scipy.ndimage.gaussian_filter(doubled, np.sqrt(_BLUR**2 - _CAMERA_BLUR**2))
    for octave in range(_OCTAVES):
        if min(doubled.shape) < _SHORTEST * 2**octave:
            break
        levels = _blurred(level)
        level = levels[_LEVELS, ::2, ::2]
        corners, offsets = _extrema(np.diff(levels, axis=0), contrast)
        for number in range(1, _LEVELS + 1):
            there = corners[:, 0] == number
            blur = _BLUR * 2 ** ((number + offsets[there, 0]) / _LEVELS)
            at: Any = (corners[there, 1:] + offsets[there, 1:]) @ [1, 1j]
            bottom, right = (size - 1 for size in levels.shape[1:])
            inside = (
                (np.minimum(at.real, at.imag) > blur) & (at.real < bottom - blur) & (at.imag < right - blur)
            )
            if inside.any():
                at, described = _described(levels[number], at[inside], blur[inside])
                points.append((np.stack([at.imag, at.real], axis=1) * 2.0**octave + 0.5) / 2 - 0.5)
                descriptors.append(described)
    return np.concatenate(points), np.concatenate(descriptors)


def _blurred(first: Floats32) -> Floats32:
    """(_LEVELS + 3, h, w): the levels of an octave, each blurred more than the last."""
    levels = np.empty((_LEVELS + 3, *first.shape), np.float32)
    levels[0] = first
    more = np.sqrt(2 ** (2 / _LEVELS) - 1)
    for number in range(1, len(levels)):
        blur = more * _BLUR * 2 ** ((number - 1) / _LEVELS)
        scipy.ndimage.gaussian_filter(levels[number - 1], blur, output=levels[number])
    return levels


def _extrema(differences: Floats32, contrast: float) -> tuple[Indices, Floats]:
    """Where differences of Gaussians are greater, or less, than all around, off edges: the nearest entries,
    and how far from these, (N, 3) each.
    """
    strides = np.array([differences[0].size, differences.shape[2], 1])
    flat = differences.ravel()
    strong = np.zeros(differences.shape, bool)
    strong[1:-1, 1:-1, 1:-1] = np.abs(differences[1:-1, 1:-1, 1:-1]) > 0.8 * contrast
    place = np.flatnonzero(strong)
    value = flat[place]
    neighbours = sorted(itertools.product((-1, 0, 1), repeat=3), key=np.count_nonzero)[1:]
    for neighbour in neighbours:
        other = flat[place + np.dot(neighbour, strides)]
        kept = np.where(value > 0, value > other, value < other)
        place, value = place[kept], value[kept]
    corners = np.stack(np.unravel_index(place, differences.shape), axis=1)
    last = np.array(differences.shape) - 2
    for _ in range(_TIMES):
        slope, curvature = _derivatives(flat, corners @ strides, strides)
        regular = np.linalg.det(curvature) != 0
        corners, slope, curvature = corners[regular], slope[regular], curvature[regular]
        offsets = -np.linalg.solve(curvature, slope[..., np.newaxis])[..., 0]
        step = np.sign(offsets).astype(np.intp) * (np.abs(offsets) > _OFFSET)
        moved = np.clip(corners + step, 1, last)
        if np.array_equal(moved, corners):
            break
        corners = moved
    value = flat[corners @ strides] + 0.5 * (slope * offsets).sum(axis=1)
    across = curvature[:, 1:, 1:]
    trace, product = np.trace(across, axis1=1, axis2=2), np.linalg.det(across)
    good = (np.abs(offsets) < _OFFSET).all(axis=1) & (np.abs(value) > contrast)
    good &= trace**2 < product * (_EDGE + 1) ** 2 / _EDGE
    return corners[good], offsets[good]


def _derivatives(flat: Floats32, place: npt.NDArray[np.intp], strides: Indices) -> tuple[Floats, Floats]:
    """(N, 3) first and (N, 3, 3) second derivatives at entries of a raveled array."""
    before, after = (flat[place[:, np.newaxis] + sign * strides].astype(float) for sign in (-1, 1))
    second = np.empty((len(place), 3, 3))
    second[:, range(3), range(3)] = before + after - 2 * flat[place].astype(float)[:, np.newaxis]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        mixed: Any = 0.0
        for a, b in itertools.product((-1, 1), repeat=2):
            mixed = mixed + a * b * flat[place + a * strides[i] + b * strides[j]].astype(float)
        second[:, i, j] = second[:, j, i] = mixed / 4
    return (after - before) / 2, second


def _described(level: Floats32, at: Complexes, blur: Floats) -> tuple[Complexes, npt.NDArray[np.uint8]]:
    """The points of a level, each once for each of its directions, and their descriptors."""
    down, right = np.gradient(level)
    gradient = (down + 1j * right).astype(np.complex64)
    point, direction = _directions(_sampled(gradient, at, blur, _ROUND))
    at, turned = at[point], np.exp(1j * direction)
    samples = _sampled(gradient, at, blur[point] * turned, _PATCH)
    samples *= turned.conj().astype(np.complex64)[:, np.newaxis]
    strength = np.abs(samples) * _PATCH_WEIGHT
    angle = np.angle(samples) * np.float32(_DIRECTIONS / (2 * np.pi))
    histograms = np.empty((len(at), 16, _DIRECTIONS), np.float32)
    for number in range(-_DIRECTIONS // 2, _DIRECTIONS // 2):  # angles are from -4 to 4
        apart = np.abs(angle - number)
        np.minimum(apart, _DIRECTIONS - apart, out=apart)
        histograms[..., number] = (strength * np.maximum(1 - apart, 0)) @ _SHARE
    entries = histograms.reshape(len(at), 128)
    entries = np.minimum(entries, _GREATEST * np.linalg.norm(entries, axis=1, keepdims=True))
    length = np.maximum(np.linalg.norm(entries, axis=1, keepdims=True), np.finfo(np.float32).tiny)
    return at, np.minimum(512 * entries / length, 255).astype(np.uint8)


def _sampled(gradient: Any, at: Complexes, scale: Any, grid: Any) -> Any:
    """(N, M) complex64: the gradient at a grid laid round each point, bilinear; 0 outside."""
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


def _split(values: Any, last: int) -> tuple[npt.NDArray[np.intp], Floats32, npt.NDArray[np.bool_]]:
    """Values as integers below the last one and what is over, and which lie between 0 and the last one."""
    inside = (values >= 0) & (values <= last)
    values = np.clip(values, 0, last)
    whole = np.minimum(values.astype(np.intp), last - 1)
    return whole, (values - whole).astype(np.float32), inside


def _directions(samples: Any) -> tuple[npt.NDArray[np.intp], Floats]:
    """The numbers of points, each once for each peak of its histogram of gradients, and the peaks' angles."""
    count = len(samples)
    angle = np.rint(np.angle(samples) * (_BINS / (2 * np.pi))).astype(np.intp) % _BINS
    angle += _BINS * np.arange(count)[:, np.newaxis]
    weights = np.abs(samples) * _ROUND_WEIGHT
    histogram: Any = np.bincount(angle.ravel(), weights.ravel(), count * _BINS).reshape(count, _BINS)
    for _ in range(_SMOOTHED):
        histogram = (np.roll(histogram, 1, axis=1) + histogram + np.roll(histogram, -1, axis=1)) / 3
    before, after = np.roll(histogram, 1, axis=1), np.roll(histogram, -1, axis=1)
    high = histogram >= _PEAK * histogram.max(axis=1, keepdims=True)
    point, peak = np.nonzero(high & (histogram > before) & (histogram >= after))
    least, most, rest = (values[point, peak] for values in (before, histogram, after))
    return point, (peak + (least - rest) / (2 * (least + rest - 2 * most))) * (2 * np.pi / _BINS)
