"""Landmarks of a texture: salient pixels, whose surroundings differ from most of it.

Where a texture is clearly a ground with objects on it (dots on paper, mushrooms in grass, stars), seams
should run through the ground. Gravel, bricks or marble are no such textures: there seams run where they show
least.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from toposeam.arrays import Floats32, Ints32, Mask
from toposeam.texture.exemplar.patch_search import reduced

#: Standard deviation, px, of the Gaussian in which saliency is measured.
_BLUR = 4.0
#: The same where objects are looked for: in wider means small objects run into each other.
_OBJECT_BLUR = 2.0
#: Squared difference from the median, in multiples of the mean one, from which on a pixel is salient.
_SALIENT = 0.5
#: Largest weight that saliency gives a pixel before weights are scaled.
_MOST_WEIGHT = 1.0
#: Pixels whose squared difference is between `_UNCLEAR` and 1 are clearly neither ground nor object. A
#: texture is a ground with objects if at most this share of its pixels is unclear: 0.17 in small mushrooms,
#: 0.26 in weave, wood and grass.
_UNCLEAR, _UNCLEAR_SHARE = 0.3, 0.2
#: A salient piece that reaches over this share of the sample along both axes is no object, but mortar.
_NETWORK_SHARE = 0.9
#: Cost of a seam through a pixel of an object, in standard deviations of the texture, per unit of weight.
_GUARD_COST = 0.25


class Landmarks(NamedTuple):
    """Weights of the pixels of the atlas by their saliency."""

    #: (AH, AW) float32, 1 on average over usable pixels.
    weight: Floats32
    #: (AH * AW,) float32, cost of each pixel to a seam in units of the features; None where the texture is no
    #: ground with objects.
    guard: Floats32 | None


def find_landmarks(features: Floats32, usable: Mask, factor: int) -> Landmarks:
    """Find the landmarks of a texture.

    Parameters
    ----------
    features : (AH, AW, F) float32 array
        0 where not usable.
    usable : (AH, AW) bool array
    factor : int
        Side of the blocks, px, in which saliency is measured.
    """
    values, mass = reduced(features, usable.astype(np.float32), factor)
    seen = mass > 0
    if not seen.any():
        return Landmarks(np.ones(usable.shape, np.float32), None)
    weight = np.clip(_apart(values, mass, _BLUR / factor) - np.float32(_SALIENT), 0, _MOST_WEIGHT) * seen
    weight /= max(float(weight[seen].mean()), 1e-6)
    full = weight.repeat(factor, axis=0).repeat(factor, axis=1)[: usable.shape[0], : usable.shape[1]]
    full = np.ascontiguousarray(full) * usable
    if not _has_objects(_apart(values, mass, _OBJECT_BLUR / factor), seen):
        return Landmarks(full, None)
    spread = float(np.sqrt(values[seen].var(axis=0).sum()))
    return Landmarks(full, np.float32(_GUARD_COST * spread) * full.ravel())


def _apart(values: Floats32, mass: Floats32, blur: float) -> Floats32:
    """Compute the squared distance of each blurred pixel from the median, scaled to 1 on average."""
    seen = mass > 0
    mean = values[seen].mean(axis=0)
    below = np.maximum(ndimage.gaussian_filter(mass, blur), np.float32(1e-6))
    apart = np.zeros(mass.shape, np.float32)
    for channel in range(values.shape[2]):
        plane = ndimage.gaussian_filter((values[..., channel] - mean[channel]) * mass, blur) / below
        apart += np.square(plane - np.median(plane[seen]))
    apart /= max(float(apart[seen].mean()), 1e-12)
    return apart


def _has_objects(apart: Floats32, seen: Mask) -> bool:
    """Test whether a texture is a ground with objects: few pixels are neither, and no object reaches over all
    of it.
    """
    unclear = np.count_nonzero((apart > _UNCLEAR) & (apart < 1) & seen)
    if unclear > _UNCLEAR_SHARE * np.count_nonzero(seen):
        return False
    salient = (apart > _SALIENT) & seen
    for exemplar in ndimage.find_objects(ndimage.label(seen)[0]):
        part = salient[exemplar]
        least = _NETWORK_SHARE * np.array(part.shape)
        for piece in ndimage.find_objects(ndimage.label(part)[0]):
            if (np.array([side.stop - side.start for side in piece]) > least).all():
                return False
    return True


def add_guard(
    guard: Floats32, a: Floats32, b: Floats32, padded: Ints32, source: Ints32
) -> tuple[Floats32, Floats32]:
    """Add a channel to the values on both sides of a seam that makes the seam dearer in objects, except where
    the patch continues what is there.

    Parameters
    ----------
    guard : (AH * AW,) float32 array
    a, b : (h + 2, w + 2, F) float32 arrays
        Values of the canvas, and of the patch.
    padded : (h + 2, w + 2) int32 array
        Flat indices that the canvas shows; -1 where it shows none.
    source : (h, w) int32 array
        Flat indices of the patch.
    """
    there = np.full_like(padded, -1)
    there[1:-1, 1:-1] = source
    same = padded == there
    both = np.empty((2, *padded.shape, a.shape[2] + 1), np.float32)
    for result, values, one, sign in zip(both, (a, b), (padded, there), (1, -1), strict=True):
        result[..., :-1] = values
        pays = guard.take(np.maximum(one, 0))
        pays[(one < 0) | same] = 0
        np.multiply(pays, np.float32(sign), out=result[..., -1])
    return both[0], both[1]
