"""Light: gains of light, applied to values as they are encoded, so that highlights roll off and white stays
white.

Values are taken for encoded as sRGB, which most pictures are, and others nearly. In light, 1 is white. All
layers share one shoulder: up to :data:`KNEE` light stays as it is, from there to the brightest light that any
layer is to show it approaches white. It bends the least and the most of a pixel's channels; the others keep
their place between them, so that hues stay. What was near white in all channels stays so whatever the gain.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import AnyFloats, Image

#: AnyFloats up to which nothing rolls off: a value of 0.8.
KNEE = 0.6
#: Up to this value encoding is a straight line; and its light.
STRAIGHT, _STRAIGHT_LIGHT = 0.04045, 0.0031308


def decoded(shares: npt.ArrayLike) -> AnyFloats:
    """The light of values, as shares of white.

    Examples
    --------
    >>> decoded([0.0, 0.5, 1.0]).round(3).tolist()
    [0.0, 0.214, 1.0]
    """
    shares = np.asarray(shares, None if hasattr(shares, "dtype") else float)
    curved = (np.maximum(shares, STRAIGHT) + 0.055) / 1.055
    result: AnyFloats = np.where(shares <= STRAIGHT, shares / 12.92, curved**2.4)
    return result


def encoded(light: npt.ArrayLike) -> AnyFloats:
    """The values of light, as shares of white.

    Examples
    --------
    >>> encoded([0.0, 0.214, 1.0]).round(3).tolist()
    [0.0, 0.5, 1.0]
    """
    light = np.asarray(light, None if hasattr(light, "dtype") else float)
    curved = 1.055 * np.maximum(light, _STRAIGHT_LIGHT) ** (1 / 2.4) - 0.055
    result: AnyFloats = np.where(light <= _STRAIGHT_LIGHT, 12.92 * light, curved)
    return result


def rolled(light: AnyFloats, top: float) -> AnyFloats:
    """Light up to `top` brought below white: the same up to the knee, with its slope, and 1 from `top` on.

    Examples
    --------
    >>> rolled(np.array([0.5, 0.6, 0.8, 1.5, 2.0]), 1.5).round(3).tolist()
    [0.5, 0.6, 0.747, 1.0, 1.0]
    >>> rolled(np.array([0.5, 2.0]), 1.0).tolist()
    [0.5, 2.0]
    """
    if top <= 1:
        return light
    most = (top - KNEE) / (1 - KNEE)
    over = np.clip((light - KNEE) / (1 - KNEE), 0, most)
    bent = over * (1 + over / most**2) / (1 + over)
    return np.where(light > KNEE, KNEE + (1 - KNEE) * bent, light).astype(light.dtype, copy=False)


def bent(shares: AnyFloats, top: float) -> AnyFloats:
    """Values as shares of white of which the light is rolled off, by a table."""
    if top <= 1:
        return shares
    table, first, scale = _bending(top)
    at = np.clip((shares - first) * scale, 0, len(table) - 1).astype(np.int32)
    return np.where(shares > first, table.take(at), shares).astype(shares.dtype, copy=False)


def finished(shares: AnyFloats, raised: AnyFloats, whites: AnyFloats, top: float, white: float) -> AnyFloats:
    """(C, n) what becomes of values whose light was multiplied: rolled off, and what was lighter than `white`
    in all channels brought to 1. Nothing goes beyond 1 that was not there before.

    Parameters
    ----------
    shares, raised : (C, n)
        Values as shares of white, before and after.
    whites : (C, n) or (C, 1)
        What became of 1.
    top : float
        The brightest light that is to show.
    white : float
        A share of white.
    """
    result = raised
    if top > 1:
        low, high = (functools.reduce(extreme, raised) for extreme in (np.minimum, np.maximum))
        least = bent(low, top)
        slope = bent(high, top) - least
        slope /= np.where(high > low, high - low, 1)
        result = (raised - low) * slope
        result += least
    darkest = functools.reduce(np.minimum, shares)
    near = np.flatnonzero(darkest > white)
    if len(near):
        burnt = np.minimum((darkest[near] - white) / (1 - white), 1)
        burnt *= burnt * (3 - 2 * burnt)
        short = np.maximum(0, 1 - bent(np.broadcast_to(whites, shares.shape)[:, near], top))
        result = result.copy() if result is raised else result
        result[:, near] += short * burnt
    bounded: AnyFloats = np.minimum(result, np.maximum(shares, 1))
    return bounded


def light_of(values: Image, white: float) -> AnyFloats:
    """The light of a picture's values; by a table where they are uint8 or uint16."""
    if values.dtype in (np.uint8, np.uint16):
        light: AnyFloats = _decoding(values.dtype, white).take(values)
        return light
    shares: AnyFloats = values / (values.dtype.type(white) if values.dtype.kind == "f" else white)
    return decoded(shares)


def multiplied(shares: AnyFloats, root: npt.NDArray[Any]) -> AnyFloats:
    """Values as shares of white, their light times gains of which the 2.4-th roots are given, where both are
    above :data:`STRAIGHT`: there gains of light are gains of values, with an offset.

    Examples
    --------
    >>> multiplied(np.array([0.5]), np.array([2.0]) ** (1 / 2.4)).round(3)
    array([0.686])
    >>> encoded(2 * decoded([0.5])).round(3)
    array([0.686])
    """
    result: AnyFloats = shares + shares.dtype.type(0.055)
    result = result * root
    result -= shares.dtype.type(0.055)
    return result


@functools.lru_cache(maxsize=4)
def _decoding(dtype: np.dtype[Any], white: float) -> npt.NDArray[np.float32]:
    """The light of every value."""
    light: npt.NDArray[np.float32] = decoded(np.arange(np.iinfo(dtype).max + 1) / white).astype(np.float32)
    return light


@functools.lru_cache(maxsize=4)
def _bending(top: float) -> tuple[npt.NDArray[np.float32], float, float]:
    """What evenly spaced values from the knee to `top` are bent to, the first, and how many there are up to
    1.
    """
    first, last = (float(encoded(end)) for end in (KNEE, top))
    table = encoded(rolled(decoded(np.linspace(first, last, 1 << 16)), top)).astype(np.float32)
    return table, first, (len(table) - 1) / (last - first)
