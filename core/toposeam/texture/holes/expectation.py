"""The features expected in a hole from its surroundings, and the features of each pixel.

*Like* is colour and contrast, blurred. Into a hole it is continued as a membrane. Where the mean of its row
says most of what there is to say of a pixel, as where there is a horizon, or that of its column, only what is
left over is continued so, and the horizon runs on at its height.

*Strange* is a pixel whose colour and contrast hardly occur round the hole: an eye, a buckle, a lone tower.
None is expected.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from toposeam.images import Mask
from toposeam.texture.exemplar.atlas import Floats32
from toposeam.texture.holes.distances import distance_from
from toposeam.texture.light.levelling import membrane

#: How far round a hole, in radii of a disc of its area, rows and columns are compared, and what share of the
#: variance they have to explain to count: 0.95 in a field with a skyline, 0.7 at most where there is none.
_AROUND, _TOLD = 2.0, 0.8
#: Width of the ring that shows what is usual, in such radii and at least, px.
_RING, _LEAST = 0.5, 16
#: Deviation of the blur of colours and contrasts, px; number of colours; number of bins of each.
_BLUR, _COLOURS, _BINS = 1.5, 3, 12
#: The share of the ring's pixels below which those of a bin are strange, and what a strange pixel counts, a
#: difference from white to black being 1.
_FEW, _STRANGE = 0.002, 2.0


def expectation(features: Floats32, hole: Mask, present: Mask) -> tuple[Floats32, Floats32]:
    """Estimate what is expected at each pixel, and what each is like.

    Parameters
    ----------
    features : (H, W, F) float32 array
        The picture; anything in the hole.
    hole, present : (H, W) bool array
        What has to go, and where the picture has pixels.

    Returns
    -------
    two (H, W, F + 2) float32 arrays
        The blurred features and contrast, and how strange the pixel is.
    """
    radius = float(np.sqrt(np.count_nonzero(hole) / np.pi))
    known = (present & ~hole).astype(np.float32)
    planes = [*np.moveaxis(features, 2, 0), _contrast(features, known)]
    like = _blurred(planes, known, float(np.clip(radius / 6, 1.5, 12)))
    distance = distance_from(hole)
    around = distance <= _AROUND * radius
    ring = (distance <= max(_RING * radius, _LEAST)) & (known > 0)
    del distance
    seen = _blurred([*planes[:-1][:_COLOURS], planes[-1]], known, _BLUR)
    strange = (_strange(seen, ring) * known)[..., np.newaxis]
    del seen, planes
    told = _told_by_lines(like, known * around)
    left = like if told is None else like - told
    expected = np.zeros((*known.shape, like.shape[2] + 1), np.float32)
    expected[..., :-1] = membrane(left, hole | ~present)
    del left
    if told is not None:
        expected[..., :-1] += told
    return expected, np.concatenate([like, strange], axis=2)


def _blurred(planes: list[Floats32], known: Floats32, sigma: float) -> Floats32:
    share = np.maximum(ndimage.gaussian_filter(known, sigma), 1e-6)
    found = np.empty((*known.shape, len(planes)), np.float32)
    for number, plane in enumerate(planes):
        found[..., number] = ndimage.gaussian_filter(plane * known, sigma) / share
    return found


def _contrast(features: Floats32, known: Floats32) -> Floats32:
    """Compute twice the steps to the next pixels, over all channels."""
    steps = np.zeros(known.shape, np.float32)
    for axis in (0, 1):
        both = np.minimum(known, np.roll(known, -1, axis))
        step = np.zeros_like(steps)
        for plane in np.moveaxis(features, 2, 0):
            step += np.abs(np.roll(plane, -1, axis) - plane)
        step *= both
        step[(slice(-1, None), slice(None)) if axis == 0 else (slice(None), slice(-1, None))] = 0
        steps += step
    return 2 * steps


def _told_by_lines(like: Floats32, weight: Floats32) -> Floats32 | None:
    """Compute what the mean of its row, or of its column, says of each pixel; None where neither says most of
    it.
    """
    best, found = _TOLD, None
    mass = weight[..., np.newaxis]
    centred = like - (like * mass).sum(axis=(0, 1)) / np.maximum(mass.sum(), 1)
    whole = _weighted_square(centred, mass)
    del centred
    if whole == 0:
        return found
    for axis in (1, 0):
        count = mass.sum(axis=axis).ravel()
        mean = (like * mass).sum(axis=axis) / np.maximum(count, 1)[:, np.newaxis]
        every, seen = np.arange(len(count)), np.flatnonzero(count)
        lines = np.stack([np.interp(every, seen, line[seen]) for line in mean.T], axis=1)
        lines = np.expand_dims(lines, axis).astype(np.float32)
        told = 1 - _weighted_square(like - lines, mass) / whole
        if told > best:
            best, found = told, np.broadcast_to(lines, like.shape)
    return found


def _weighted_square(values: Floats32, mass: Floats32) -> float:
    """Sum squares, each with its weight; the values are used up."""
    np.square(values, out=values)
    values *= mass
    return float(values.sum())


def _strange(like: Floats32, ring: Mask) -> Floats32:
    """Compute how rarely something like each pixel occurs in a ring: (H, W), from 0 to `_STRANGE`."""
    bins = np.zeros(ring.shape, np.int32)
    for plane in np.moveaxis(like, 2, 0):
        bins *= _BINS
        bins += np.clip(plane * _BINS, 0, _BINS - 1).astype(np.int32)
    shape = (_BINS,) * like.shape[2]
    count = np.bincount(bins[ring], minlength=_BINS ** len(shape)).astype(np.float32).reshape(shape)
    for axis in range(count.ndim):
        count = ndimage.convolve1d(count, np.array([0.5, 1, 0.5], np.float32), axis, mode="constant")
    rare = np.exp(-count / np.float32(_FEW * max(int(np.count_nonzero(ring)), 1)))
    result: Floats32 = (_STRANGE * rare.ravel()[bins]).astype(np.float32)
    return result
