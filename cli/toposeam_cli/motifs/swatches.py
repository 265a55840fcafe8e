"""Palettes in files: GIMP's .gpl, which are texts, and Adobe's .ase, blocks of big-endian numbers."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import toposeam as ts
from toposeam.colours import LUMA
from toposeam_cli.files.regular import check_regular

#: Largest file of swatches that is read, bytes.
_LARGEST_BYTES = 1_000_000
_COLOUR = 0x0001
#: White of LAB swatches, CIE D50, and sRGB's linear primaries adapted to it (Bradford).
_WHITE = np.array([0.96422, 1.0, 0.82521])
_TO_RGB = np.array(
    [
        [3.1338561, -1.6168667, -0.4906146],
        [-0.9787684, 1.9161415, 0.0334540],
        [0.0719453, -0.2289914, 1.4052427],
    ]
)


def read_swatches(path: Path) -> np.ndarray:
    """Return the colours in a file, (n, 3) sRGB in [0, 1]: first the lightest, as that of the paper, then the
    others in their order.

    Raises
    ------
    OptionError
        When it cannot be read, or has no colours.
    """
    check_regular(path, "the swatches")
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise ts.OptionError(
                f"'{path}' is larger than {_LARGEST_BYTES // 10**6} MB; give a file of swatches"
            )
        data = path.read_bytes()
    except OSError as error:
        raise ts.OptionError(
            f"'{path}' cannot be read ({(error.strerror or str(error)).lower()}); check its name and folder"
        ) from error
    try:
        colours = list(_ase(data) if path.suffix.lower() == ".ase" else _gpl(data.decode("utf-8", "replace")))
        if not np.isfinite(np.array(colours)).all():
            raise ValueError("it holds what is no number")
    except (struct.error, ValueError, IndexError, OverflowError) as error:
        raise ts.OptionError(f"'{path}' is damaged ({error}); export it again") from error
    if not colours:
        raise ts.OptionError(f"'{path}' has no colours in RGB, LAB, gray or CMYK; export it again")
    found = np.clip(np.array(colours), 0.0, 1.0)
    lightest = int(np.argmax(found @ LUMA))
    return np.concatenate([found[lightest : lightest + 1], np.delete(found, lightest, axis=0)])


def _gpl(text: str) -> Iterator[tuple[float, float, float]]:
    lines = text.splitlines()
    if not lines or not lines[0].startswith("GIMP Palette"):
        raise ValueError("it does not begin with 'GIMP Palette'")
    for line in lines[1:]:
        words = line.split()
        if len(words) >= 3 and all(word.isdigit() for word in words[:3]):
            red, green, blue = (int(word) / 255 for word in words[:3])
            yield red, green, blue


def _ase(data: bytes) -> Iterator[tuple[float, float, float]]:
    if data[:4] != b"ASEF":
        raise ValueError("it does not begin with 'ASEF'")
    (blocks,) = struct.unpack_from(">I", data, 8)
    at = 12
    for _ in range(blocks):
        kind, length = struct.unpack_from(">HI", data, at)
        if kind == _COLOUR:
            (letters,) = struct.unpack_from(">H", data, at + 6)
            model = data[at + 8 + 2 * letters : at + 12 + 2 * letters]
            values = at + 12 + 2 * letters
            if model == b"RGB ":
                yield struct.unpack_from(">3f", data, values)
            elif model == b"Gray":
                (gray,) = struct.unpack_from(">f", data, values)
                yield gray, gray, gray
            elif model == b"CMYK":
                cyan, magenta, yellow, black = struct.unpack_from(">4f", data, values)
                yield (1 - cyan) * (1 - black), (1 - magenta) * (1 - black), (1 - yellow) * (1 - black)
            elif model == b"LAB ":
                yield _of_lab(*struct.unpack_from(">3f", data, values))
        at += 6 + length


def _of_lab(lightness: float, a: float, b: float) -> tuple[float, float, float]:
    """Convert CIE LAB, its lightness in [0, 1], to sRGB."""
    y = (100.0 * lightness + 16.0) / 116.0
    roots = np.array([y + a / 500.0, y, y - b / 200.0])
    xyz = _WHITE * np.where(roots > 6 / 29, roots**3, 3 * (6 / 29) ** 2 * (roots - 4 / 29))
    linear = np.clip(_TO_RGB @ xyz, 0.0, 1.0)
    red, green, blue = np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055
    ).tolist()
    return red, green, blue
