"""Where a TIFF file says that its picture lies: XPosition and YPosition, in units of the resolution.

Hugin's ``nona`` writes them, and PTblender, enblend and Multiblend read them. Both positions and resolutions
are fractions, so that position × resolution is a whole number of pixels.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

_X_RESOLUTION, _Y_RESOLUTION, _X_POSITION, _Y_POSITION = 282, 283, 286, 287
_FULL_WIDTH, _FULL_HEIGHT = 33300, 33301
#: Layers may not lie farther from the origin, px.
FARTHEST = 2**31 - 1


def tiff_place(path: Path) -> tuple[int, int] | None:
    """(x, y) of the picture's upper left corner in px, however far, or None where the file does not say it.

    Parameters
    ----------
    path : Path
        Any file; only the tags are read.
    """
    tags = _tags(path)
    if tags is None or _X_POSITION not in tags or _Y_POSITION not in tags:
        return None
    x, y = (
        round(tags[position] * tags.get(resolution, Fraction(1)))
        for position, resolution in ((_X_POSITION, _X_RESOLUTION), (_Y_POSITION, _Y_RESOLUTION))
    )
    return x, y


def tiff_canvas(path: Path) -> tuple[int, int] | None:
    """(width, height) of the whole panorama that the picture is part of, where the file says it."""
    tags = _tags(path)
    if tags is None or _FULL_WIDTH not in tags or _FULL_HEIGHT not in tags:
        return None
    return int(tags[_FULL_WIDTH]), int(tags[_FULL_HEIGHT])


def _tags(path: Path) -> dict[int, Fraction] | None:
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    wanted = (_X_RESOLUTION, _Y_RESOLUTION, _X_POSITION, _Y_POSITION, _FULL_WIDTH, _FULL_HEIGHT)
    try:
        with path.open("rb") as file:
            header = file.read(8)
            if header[:2] not in (b"II", b"MM"):
                return None
            if header[2:4] in (b"\x2b\0", b"\0\x2b"):
                header += file.read(8)  # BigTIFF
            directory = ImageFileDirectory_v2(header)
            file.seek(directory.next)
            directory.load(file)
            found = {}
            for tag in wanted:
                if tag in directory:
                    value = directory[tag]
                    value = value[0] if isinstance(value, tuple) else value
                    found[tag] = Fraction(int(value.numerator), int(value.denominator))
            return found
    except (OSError, SyntaxError, ValueError, KeyError, TypeError, ZeroDivisionError, OverflowError):
        return None  # whoever reads the picture says what is wrong with it
