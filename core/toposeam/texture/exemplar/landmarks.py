"""Salient pixels of a texture: those whose surroundings are unlike most of it.

Dots on paper, mushrooms in grass, stars: where a texture is clearly a ground with objects on it, seams should
run through the ground. Gravel, bricks or marble are no such textures: there seams run where they show least.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from toposeam.arrays import Floats32, Ints32, Mask
from toposeam.texture.exemplar.patch_search import reduced

#: Deviation in px of the means in which pixels are seen, and in which it is decided whether there are
#: objects: small ones run into each other sooner.
_BLUR, _SHARP = 4.0, 2.0
#: Difference from the median, in shares of the mean difference, from which on pixels catch the eye, and
#: beyond which they could not more.
_LOW, _HIGH = 0.5, 1.0
#: A texture is a ground with objects where fewer pixels than this share are between the two, as far below
#: the mean as _BETWEEN. In small mushrooms 0.17 are, in weave, wood and grass 0.26.
_UNCLEAR, _BETWEEN = 0.2, 0.3
#: What catches the eye and reaches over this share of the sample both ways is no object: mortar.
_NETWORK = 0.9
#: Price of a pixel of an object to a seam, in deviations of the texture, per unit of weight.
_GUARD = 0.25


class Landmarks(NamedTuple):
    """Weights of the pixels of the atlas by how much they catch the eye."""

    #: (AH, AW) float32, 1 on average over usable pixels.
    weight: Floats32
    #: (AH * AW,) float32, what a seam pays for each pixel in units of the features; None where the texture is
    #: no ground with objects.
    guard: Floats32 | None


def landmarks(features: Floats32, usable: Mask, factor: int) -> Landmarks:
    """Find what catches the eye.

    Parameters
    ----------
    features : (AH, AW, F) float32 array
        0 where not usable.
    usable : (AH, AW) bool array
    factor : int
        They are looked at in blocks of factor × factor px.
    """
    values, mass = reduced(features, usable.astype(np.float32), factor)
    seen = mass > 0
    if not seen.any():
        return Landmarks(np.ones(usable.shape, np.float32), None)
    weight = np.clip(_apart(values, mass, _BLUR / factor) - np.float32(_LOW), 0, _HIGH) * seen
    weight /= max(float(weight[seen].mean()), 1e-6)
    full = weight.repeat(factor, axis=0).repeat(factor, axis=1)[: usable.shape[0], : usable.shape[1]]
    full = np.ascontiguousarray(full) * usable
    if not _has_objects(_apart(values, mass, _SHARP / factor), seen):
        return Landmarks(full, None)
    spread = float(np.sqrt(values[seen].var(axis=0).sum()))
    return Landmarks(full, np.float32(_GUARD * spread) * full.ravel())


def _apart(values: Floats32, mass: Floats32, blur: float) -> Floats32:
    """Compute how far each blurred pixel is from the median, squared, 1 on average."""
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
    """Test whether a texture is a ground with objects: little lies between the two, and no object reaches
    over all of it.
    """
    unclear = np.count_nonzero((apart > _BETWEEN) & (apart < 1) & seen)
    if unclear > _UNCLEAR * np.count_nonzero(seen):
        return False
    striking = (apart > _LOW) & seen
    for exemplar in ndimage.find_objects(ndimage.label(seen)[0]):
        part = striking[exemplar]
        least = _NETWORK * np.array(part.shape)
        for piece in ndimage.find_objects(ndimage.label(part)[0]):
            if (np.array([side.stop - side.start for side in piece]) > least).all():
                return False
    return True


def guarded(
    guard: Floats32, a: Floats32, b: Floats32, padded: Ints32, source: Ints32
) -> tuple[Floats32, Floats32]:
    """Add a channel to the values on both sides of a seam, by which it is dearer in objects, unless these are
    continued.

    Parameters
    ----------
    guard : (AH * AW,) float32 array
    a, b : (h + 2, w + 2, F) float32 arrays
        What is there, and the patch.
    padded : (h + 2, w + 2) int32 array
        What is there, flat indices; -1 where nothing is.
    source : (h, w) int32 array
        The patch.
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
