"""Colours as text and as numbers: sRGB in [0, 1]."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from toposeam.errors import OptionError

#: (3,) Weights of red, green and blue in the brightness of a picture (ITU-R BT.709).
LUMA: npt.NDArray[np.float64] = np.array([0.2126, 0.7152, 0.0722])
LUMA.setflags(write=False)


def parse_colour(text: str) -> tuple[float, float, float]:
    """Return the colour of ``#rrggbb`` or ``#rgb``, sRGB in [0, 1].

    Raises
    ------
    OptionError

    Examples
    --------
    >>> parse_colour("#f80") == parse_colour("#ff8800")
    True
    """
    digits = text.removeprefix("#")
    if len(digits) == 3:
        digits = "".join(2 * digit for digit in digits)
    try:
        if len(digits) != 6 or not digits.isalnum():
            raise ValueError
        return int(digits[:2], 16) / 255, int(digits[2:4], 16) / 255, int(digits[4:], 16) / 255
    except ValueError:
        raise OptionError(
            "colour {colour} cannot be read; write it as {allowed}",
            kind="colour",
            value=text,
            colour=repr(text),
            allowed="#rrggbb",
        ) from None


def to_hex(colour: Iterable[float]) -> str:
    """Return a colour as ``#rrggbb``, clipped to [0, 1].

    Parameters
    ----------
    colour : three floats
        sRGB, 0 to 1.

    Examples
    --------
    >>> to_hex((1.0, 0.5, -0.1)), to_hex(parse_colour("#20304a"))
    ('#ff8000', '#20304a')
    """
    return "#" + "".join(f"{round(255 * min(max(float(share), 0.0), 1.0)):02x}" for share in colour)
