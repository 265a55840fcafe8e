"""Backgrounds under the holes of a picture."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.colours import LUMA
from toposeam.images import full_scale


def colour_of(text: str) -> tuple[int, int, int]:
    """Parse a colour's name or ``#rrggbb``; return red, green and blue, 0 to 255.

    Raises
    ------
    OptionError
    """
    from PIL import ImageColor

    try:
        red, green, blue = ImageColor.getrgb(text)[:3]
    except ValueError as error:
        raise ts.OptionError(
            f"--background is {text!r}; give a colour's name, like white, or #rrggbb, like #20304a"
        ) from error
    return red, green, blue


def on_background(
    image: npt.NDArray[Any], alpha: npt.NDArray[Any], colour: tuple[int, int, int]
) -> npt.NDArray[Any]:
    """Return the picture over a colour, opaque.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) array
    alpha : (H, W) array of its dtype
    colour : (int, int, int)
        Red, green and blue, 0 to 255; for a gray picture their luma is taken.
    """
    full = float(full_scale(image.dtype))
    below = np.asarray(colour, np.float32) / 255 * full
    if image.ndim == 2:
        below = below @ LUMA.astype(np.float32)
    result = np.empty_like(image)
    for start in range(0, len(image), 256):
        rows = slice(start, start + 256)
        share = alpha[rows].astype(np.float32) / np.float32(full)
        share = share if image.ndim == 2 else share[..., np.newaxis]
        mixed = image[rows] * share + below * (1 - share)
        result[rows] = np.rint(mixed) if np.issubdtype(image.dtype, np.integer) else mixed
    return result
