"""The features expected in a hole from its surroundings, and the features of each pixel.

The features of a pixel are its colour and contrast, blurred (`like`). They are continued into a hole as a
membrane. Where the means of rows explain most of the features' variance, as where there is a horizon, or
those of columns do, only the rest is continued as a membrane, so that the horizon runs on at its height.

A pixel is *strange* if its colour and contrast hardly occur round the hole: an eye, a buckle, a lone tower.
None is expected in a hole.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, islice
from typing import Any

import numpy as np
from scipy import ndimage

from toposeam.arrays import Floats32, Mask
from toposeam.images import box_of
from toposeam.texture.holes.distances import distance_from
from toposeam.texture.light.levelling import membrane

#: The features of a picture, (H, W) each, one after another.
Planes = Callable[[], Iterable[Floats32]]

_NEIGHBOURS: Any = ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:]))

#: Distance round a hole within which rows and columns are compared, in radii of a disc of the hole's area.
_LINE_RADII = 2.0
#: Least share of the variance that rows or columns explain so that they count: they explain 0.95 in a field
#: with a skyline, and 0.7 at most where there is none.
_LEAST_EXPLAINED = 0.8
#: Width of the ring round a hole that shows what is usual, in such radii, and its least width, px.
_RING_RADII, _LEAST_RING = 0.5, 16
#: Standard deviation of the blur of colours and contrast, px.
_BLUR = 1.5
#: Number of colours in the histogram of the ring, and number of bins of each and of the contrast.
_COLOURS, _BINS = 3, 12
#: Boxes begin at multiples of this many px, as a membrane is found on a reduced grid of rows and columns.
_GRID = 128
#: A bin with less than this share of the ring's pixels is strange.
_STRANGE_SHARE = 0.002
#: Cost of a strange pixel; a difference from white to black costs 1.
_STRANGE_COST = 2.0


def expectation(planes: Planes, hole: Mask, present: Mask) -> tuple[Floats32, Floats32]:
    """Estimate the features expected in a hole, and compute those of each pixel.

    Parameters
    ----------
    planes : callable
        Returns the features of the picture, (H, W) float32 arrays, one after another; anything in the hole.
    hole, present : (H, W) bool array
        What has to go, and where the picture has pixels.

    Returns
    -------
    expected : (h, w, F + 2) float32 array
        In the box that :func:`gap_box` gives.
    like : (H, W, F + 2) float32 array
        The blurred features and contrast, and how strange the pixel is.
    """
    radius = float(np.sqrt(np.count_nonzero(hole) / np.pi))
    known = (present & ~hole).astype(np.float32)
    around, ring = np.zeros(hole.shape, bool), np.zeros(hole.shape, bool)
    width = max(_RING_RADII * radius, _LEAST_RING)
    near = box_of(hole, math.ceil(max(_LINE_RADII * radius, width)))
    distance = distance_from(hole[near])
    around[near], ring[near] = distance <= _LINE_RADII * radius, (distance <= width) & (known[near] > 0)
    del distance
    contrast, count = _contrast(planes, known)
    strange = _strange([*islice(planes(), _COLOURS), contrast], known, ring)
    like = np.empty((*known.shape, count + 2), np.float32)
    like[..., -1] = strange
    del strange
    sigma = float(np.clip(radius / 6, 1.5, 12))
    for number, plane in enumerate(_blurred(chain(planes(), [contrast]), known, sigma)):
        like[..., number] = plane
    del contrast
    lines = _means_of_lines(like[..., :-1], known * around)
    gaps = hole | ~present
    box = gap_box(gaps)
    expected = np.zeros((*gaps[box].shape, like.shape[2]), np.float32)
    left = like[box][..., :-1] if lines is None else like[box][..., :-1] - lines[box]
    expected[..., :-1] = membrane(left, gaps[box])
    if lines is not None:
        expected[..., :-1] += lines[box]
    return expected, like


def gap_box(gaps: Mask) -> tuple[slice, slice]:
    """Select the rows and columns of a mask and of all pixels that decide what is expected there."""
    rows, columns = (
        slice(max(side.start // _GRID - 1, 0) * _GRID, side.stop + _GRID) for side in box_of(gaps)
    )
    return rows, columns


def _blurred(planes: Iterable[Floats32], known: Floats32, sigma: float) -> Iterator[Floats32]:
    """Blur what is known of each plane."""
    share = np.maximum(ndimage.gaussian_filter(known, sigma), 1e-6)
    for plane in planes:
        blurred: Floats32 = plane * known
        ndimage.gaussian_filter(blurred, sigma, output=blurred)
        blurred /= share
        yield blurred


def _contrast(planes: Planes, known: Floats32) -> tuple[Floats32, int]:
    """Compute the contrast, twice the sum of the steps to the next pixels over all planes; and count the
    planes.
    """
    steps = np.zeros(known.shape, np.float32)
    for first, second in _NEIGHBOURS:
        step: Floats32 = np.zeros(steps[first].shape, np.float32)
        count = 0
        for plane in planes():
            step += np.abs(plane[second] - plane[first])
            count += 1
        step *= known[first]
        step *= known[second]
        steps[first] += step
    steps *= 2
    return steps, count


def _means_of_lines(like: Floats32, weight: Floats32) -> Floats32 | None:
    """Compute the mean of the rows, or of the columns, at each pixel: (H, W, F), those that explain more of
    the variance; None where neither explain enough.
    """
    best, found = _LEAST_EXPLAINED, None
    planes = np.moveaxis(like, 2, 0)
    mass = max(float(weight.sum(dtype=float)), 1.0)
    means = [float((plane * weight).sum(dtype=float)) / mass for plane in planes]
    whole = sum(
        _weighted_square(plane - np.float32(mean), weight) for plane, mean in zip(planes, means, strict=True)
    )
    if whole == 0:
        return found
    for axis in (1, 0):
        count = weight.sum(axis=axis)
        every, seen = np.arange(len(count)), np.flatnonzero(count)
        lines = np.empty((len(count), len(planes)), np.float32)
        for number, plane in enumerate(planes):
            mean = (plane * weight).sum(axis=axis)[seen] / count[seen]
            lines[:, number] = np.interp(every, seen, mean)
        lines = np.expand_dims(lines, axis)
        apart = sum(
            _weighted_square(plane - lines[..., number], weight) for number, plane in enumerate(planes)
        )
        explained = 1 - apart / whole
        if explained > best:
            best, found = explained, np.broadcast_to(lines, like.shape)
    return found


def _weighted_square(values: Floats32, weight: Floats32) -> float:
    """Sum squares, each with its weight; the values are used up."""
    np.square(values, out=values)
    values *= weight
    return float(values.sum(dtype=float))


def _strange(planes: Sequence[Floats32], known: Floats32, ring: Mask) -> Floats32:
    """Compute how rarely something like each pixel occurs in a ring: (H, W), from 0 to `_STRANGE_COST`."""
    bins = np.zeros(ring.shape, np.int32)
    for plane in _blurred(planes, known, _BLUR):
        bins *= _BINS
        plane *= _BINS
        bins += np.clip(plane, 0, _BINS - 1, out=plane).astype(np.int32)
    shape = (_BINS,) * len(planes)
    count = np.bincount(bins[ring], minlength=_BINS ** len(shape)).astype(np.float32).reshape(shape)
    for axis in range(count.ndim):
        count = ndimage.convolve1d(count, np.array([0.5, 1, 0.5], np.float32), axis, mode="constant")
    rare = np.exp(-count / np.float32(_STRANGE_SHARE * max(int(np.count_nonzero(ring)), 1)))
    result: Floats32 = rare.ravel().take(bins)
    result *= np.float32(_STRANGE_COST)
    result *= known
    return result
