"""Light: values decoded, multiplied by gains and encoded again, so that highlights roll off and white stays
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

from toposeam.images import Image, in_dtype

Light = npt.NDArray[np.floating[Any]]

#: Light up to which nothing rolls off: a value of 0.8.
KNEE = 0.6
#: Up to this value encoding is a straight line; and its light.
STRAIGHT, _STRAIGHT_LIGHT = 0.04045, 0.0031308


def decoded(shares: npt.ArrayLike) -> Light:
    """The light of values, as shares of white.

    Examples
    --------
    >>> decoded([0.0, 0.5, 1.0]).round(3).tolist()
    [0.0, 0.214, 1.0]
    """
    shares = np.asarray(shares, None if hasattr(shares, "dtype") else float)
    curved = (np.maximum(shares, STRAIGHT) + 0.055) / 1.055
    result: Light = np.where(shares <= STRAIGHT, shares / 12.92, curved**2.4)
    return result


def encoded(light: npt.ArrayLike) -> Light:
    """The values of light, as shares of white.

    Examples
    --------
    >>> encoded([0.0, 0.214, 1.0]).round(3).tolist()
    [0.0, 0.5, 1.0]
    """
    light = np.asarray(light, None if hasattr(light, "dtype") else float)
    curved = 1.055 * np.maximum(light, _STRAIGHT_LIGHT) ** (1 / 2.4) - 0.055
    result: Light = np.where(light <= _STRAIGHT_LIGHT, 12.92 * light, curved)
    return result


def rolled(light: Light, top: float) -> Light:
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


def raised(light: Light, gain: npt.NDArray[Any], top: float, white: float) -> Light:
    """(n, C) light times gains, rolled off; what is lighter than `white` in all channels is brought to 1.

    Nothing is raised beyond 1 that was not there before.
    """
    wanted = light * gain
    low, high = (extreme(wanted, axis=-1, keepdims=True) for extreme in (np.min, np.max))
    if top > 1:
        least = rolled(low, top)
        slope = (rolled(high, top) - least) / np.where(high > low, high - low, 1)
        result = least + (wanted - low) * slope
    else:
        result = wanted
    burnt = np.clip((light.min(axis=-1, keepdims=True) - white) / (1 - white), 0, 1)
    burnt *= burnt * (3 - 2 * burnt)
    result = result + np.maximum(0, 1 - rolled(gain, top)) * burnt
    bounded: Light = np.minimum(result, np.maximum(light, 1)).astype(light.dtype, copy=False)
    return bounded


def light_of(values: Image, white: float) -> Light:
    """The light of a picture's values; by a table where they are uint8 or uint16."""
    if values.dtype in (np.uint8, np.uint16):
        light: Light = _decoding(values.dtype, white).take(values)
        return light
    shares: Light = values / (values.dtype.type(white) if values.dtype.kind == "f" else white)
    return decoded(shares)


def values_of(light: Light, dtype: np.dtype[Any], white: float) -> Image:
    """A picture's values of light."""
    return in_dtype(encoded(light) * white, dtype)


def multiplied(values: Image, root: npt.NDArray[Any], white: float) -> Light:
    """A picture's values of its light times gains, of which the 2.4-th roots are given, where both are above
    :data:`STRAIGHT`: there gains of light are gains of values, with an offset.

    Examples
    --------
    >>> multiplied(np.array([0.5]), np.array([2.0]) ** (1 / 2.4), 1.0).round(3)
    array([0.686])
    >>> encoded(2 * decoded([0.5])).round(3)
    array([0.686])
    """
    offset = root.dtype.type(0.055 * white)
    result: Light = values + offset
    result *= root
    result -= offset
    return result


@functools.lru_cache(maxsize=4)
def _decoding(dtype: np.dtype[Any], white: float) -> npt.NDArray[np.float32]:
    """The light of every value."""
    light: npt.NDArray[np.float32] = decoded(np.arange(np.iinfo(dtype).max + 1) / white).astype(np.float32)
    return light
