"""Position of the picture in a TIFF file: XPosition and YPosition, in units of the resolution.

Hugin's ``nona`` writes them, and PTblender, enblend and Multiblend read them. Both positions and resolutions
are fractions, so that position × resolution is a whole number of pixels.
"""

from __future__ import annotations

import struct
from fractions import Fraction
from pathlib import Path
from typing import Any, BinaryIO

_X_RESOLUTION, _Y_RESOLUTION, _X_POSITION, _Y_POSITION = 282, 283, 286, 287
_FULL_WIDTH, _FULL_HEIGHT = 33300, 33301
_WANTED = (_X_RESOLUTION, _Y_RESOLUTION, _X_POSITION, _Y_POSITION, _FULL_WIDTH, _FULL_HEIGHT)
#: Greatest distance of a layer from the origin, px.
FARTHEST = 2**31 - 1

#: Byte order by a file's first two bytes.
_ORDERS = {b"II": "<", b"MM": ">"}
#: Formats by version: of the first directory's address, of its number of entries, and of an entry, which has
#: a tag, a type, the number of values, and these values or their address.
_LAYOUTS = {42: ("L", "H", "HHL4s"), 43: ("HHQ", "Q", "HHQ8s")}
#: Most tags that are read of a directory: a classic one has no more, and a damaged BigTIFF may claim any
#: number.
_MOST_TAGS = 1 << 16
#: Format of a value of each type; rationals are a numerator and a denominator.
KINDS = {1: "B", 3: "H", 4: "L", 5: "LL", 6: "b", 8: "h", 9: "l", 10: "ll", 11: "f", 12: "d", 16: "Q"}


def tiff_place(path: Path) -> tuple[int, int] | None:
    """Return the (x, y) of the picture's upper left corner, px, or None where the file does not state it.

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
    """Return the (width, height) of the panorama of which the picture is a part, px, or None where the file
    does not state it.
    """
    tags = _tags(path)
    if tags is None or _FULL_WIDTH not in tags or _FULL_HEIGHT not in tags:
        return None
    return int(tags[_FULL_WIDTH]), int(tags[_FULL_HEIGHT])


def _tags(path: Path) -> dict[int, Fraction] | None:
    """Return the first values of the wanted tags of the file's first directory."""
    found = {}
    try:
        with path.open("rb") as file:
            order = _ORDERS[file.read(2)]
            (version,) = _read(file, order + "H")
            address, count, entry = _LAYOUTS[version]
            file.seek(_read(file, order + address)[-1])
            (entries,) = _read(file, order + count)
            entries = min(entries, _MOST_TAGS)
            for tag, kind, _, value in [_read(file, order + entry) for _ in range(entries)]:
                if tag not in _WANTED or kind not in KINDS:
                    continue
                layout = order + KINDS[kind]
                size = struct.calcsize(layout)
                if size > len(value):
                    file.seek(*struct.unpack(order + address[-1], value))
                    value = file.read(size)
                found[tag] = Fraction(*struct.unpack(layout, value[:size]))
    except (OSError, KeyError, ValueError, ZeroDivisionError, OverflowError, struct.error):
        return None  # the picture's reader reports the error
    return found


def _read(file: BinaryIO, layout: str) -> tuple[Any, ...]:
    return struct.unpack(layout, file.read(struct.calcsize(layout)))
