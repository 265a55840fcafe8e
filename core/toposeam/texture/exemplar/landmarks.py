"""Salient pixels of a texture: those whose surroundings are unlike most of it.

Dots on paper, mushrooms in grass, stars: where a texture is clearly a ground with objects on it, seams should
run through the ground. Gravel, bricks or marble are no such textures: there seams run where they show least.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from toposeam.images import Mask
from toposeam.texture.exemplar.atlas import Floats32, Ints32
from toposeam.texture.exemplar.patch_search import reduced

#: Deviation in px of the means in which pixels are seen.
_BLUR = 4.0
#: Difference from the median, in shares of the mean difference, from which on pixels catch the eye, and
#: beyond which they could not more.
_LOW, _HIGH = 0.5, 1.0
#: A texture is a ground with objects where fewer pixels than this share are between the two, as far below
#: the mean as _BETWEEN.
_UNCLEAR, _BETWEEN = 0.15, 0.3
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
    seen, blur = mass > 0, _BLUR / factor
    if not seen.any():
        return Landmarks(np.ones(usable.shape, np.float32), None)
    mean = values[seen].mean(axis=0)
    below = np.maximum(ndimage.gaussian_filter(mass, blur), np.float32(1e-6))
    apart = np.zeros(mass.shape, np.float32)
    for channel in range(values.shape[2]):
        plane = ndimage.gaussian_filter((values[..., channel] - mean[channel]) * mass, blur) / below
        apart += np.square(plane - np.median(plane[seen]))
    apart /= max(float(apart[seen].mean()), 1e-12)
    weight = np.clip(apart - np.float32(_LOW), 0, _HIGH) * seen
    weight /= max(float(weight[seen].mean()), 1e-6)
    plain = float(((apart > _BETWEEN) & (apart < 1) & seen).sum()) > _UNCLEAR * float(seen.sum())
    full = weight.repeat(factor, axis=0).repeat(factor, axis=1)[: usable.shape[0], : usable.shape[1]]
    full = np.ascontiguousarray(full) * usable
    if plain:
        return Landmarks(full, None)
    spread = float(np.sqrt(values[seen].var(axis=0).sum()))
    return Landmarks(full, np.float32(_GUARD * spread) * full.ravel())


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
