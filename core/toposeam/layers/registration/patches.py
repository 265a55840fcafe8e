"""Patches of the overlap of two pictures, laid exactly on each other by phase correlation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from toposeam.arrays import Floats
from toposeam.layers.canvas.transforms import Transform, reach
from toposeam.layers.registration.features import Look, cornered

_PATCH, _PATCHES = 64, 6  # px a side; in rows and columns of so many over the overlap
_LEAST_PATCHES, _LEAST_SIDE = 2, 16
_UPSAMPLING = 20
_LEAST_OWN = 0.6  # correlation of a patch that counts


@dataclass(frozen=True, slots=True, eq=False)
class LaidPatches:
    """Centres of patches in one picture and in another, and the correlation of their overlap."""

    first: Floats
    second: Floats
    correlation: float


def find_patches(a: Look, b: Look, transform: Transform, count: int = _PATCHES) -> LaidPatches | None:
    """Lay patches of the overlap exactly on each other.

    Parameters
    ----------
    a, b : Look
    transform : Transform
        Takes points of `b` to about where they are in `a`, px.
    count : int
        Rows and columns of patches over the overlap.

    Returns
    -------
    LaidPatches or None
        None where the overlap is too small or shows nothing.
    """
    from skimage.registration import phase_cross_correlation

    height, width = b.detail.shape
    transform = _Reduced(transform, a.fine, b.fine)
    reached = reach(transform, (width, height))
    if reached is None:
        return None
    low = np.maximum(reached[0], 0)
    high = np.minimum(reached[1], np.array(a.detail.shape[::-1]) - 1.0)
    size = int(min(_PATCH, *(0.7 * (high - low))))
    if size < _LEAST_SIDE:
        return None
    tops, lefts = (np.linspace(low[k], high[k] - size + 1, count).astype(int) for k in (1, 0))
    corners = np.array(
        [(left, top) for top in tops for left in lefts if a.known[top : top + size, left : left + size].all()]
    ).reshape(-1, 2)
    # (K, size, size, 2) x and y in `b` of all patches at once.
    grid = np.stack(np.meshgrid(np.arange(size), np.arange(size)), axis=-1)
    coordinates = transform.to_picture((corners[:, np.newaxis, np.newaxis] + grid).astype(float))
    inside = ((coordinates >= 0) & (coordinates <= np.array([width, height]) - 1)).all(axis=(1, 2, 3))
    centres, shifts, energy = [], [], np.zeros(3)
    register: Any = phase_cross_correlation  # carries no types
    for (left, top), (x, y) in zip(corners[inside], np.moveaxis(coordinates[inside], 3, 1), strict=True):
        if not b.known[np.rint(y).astype(int), np.rint(x).astype(int)].all():
            continue
        one = a.detail[top : top + size, left : left + size]
        other = scipy.ndimage.map_coordinates(b.detail, [y, x], order=1)
        shift = np.zeros(2)
        if one.std() > 0 and other.std() > 0:
            shift = register(one, other, upsample_factor=_UPSAMPLING, normalization=None)[0]
        moved = scipy.ndimage.shift(other, shift, order=1)
        first, second = one[4:-4, 4:-4], moved[4:-4, 4:-4]
        products = np.array([(first * second).sum(), (first**2).sum(), (second**2).sum()], np.float64)
        energy += products
        own = float(products[0] / np.sqrt(max(products[1] * products[2], 1e-12)))
        if own > _LEAST_OWN and cornered(one) and np.abs(shift).max() <= size / 4:
            centres.append(np.array([left, top]) + (size - 1) / 2)
            shifts.append(shift[::-1])
    if energy[1] * energy[2] <= 0:
        return None
    correlation = float(energy[0] / np.sqrt(energy[1] * energy[2]))
    if len(centres) < _LEAST_PATCHES:
        return LaidPatches(np.zeros((0, 2)), np.zeros((0, 2)), min(correlation, 0.0))
    first, second = np.array(centres), transform.to_picture(np.array(centres) - np.array(shifts))
    return LaidPatches(_full(first, a.fine), _full(second, b.fine), correlation)


@dataclass(frozen=True, slots=True)
class _Reduced:
    """A transform between two reduced pictures."""

    transform: Transform
    first: int
    second: int

    def to_canvas(self, points: Floats) -> Floats:
        return _small(self.transform.to_canvas(_full(points, self.second)), self.first)

    def to_picture(self, points: Floats) -> Floats:
        return _small(self.transform.to_picture(_full(points, self.first)), self.second)


def _full(points: Floats, scale: int) -> Floats:
    return points if scale == 1 else (points + 0.5) * scale - 0.5


def _small(points: Floats, scale: int) -> Floats:
    return points if scale == 1 else (points + 0.5) / scale - 0.5
