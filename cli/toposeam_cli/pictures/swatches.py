"""Palettes in files: GIMP's .gpl, which is text, and Adobe's .ase, which is blocks of big-endian numbers."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import toposeam as ts
from toposeam.colours import LUMA
from toposeam_cli.files.regular import check_regular

#: Files of swatches are not larger.
_LARGEST_BYTES = 1_000_000
_COLOUR = 0x0001


def read_swatches(path: Path) -> np.ndarray:
    """The colours in a file, (n, 3) sRGB in [0, 1]: the lightest, which is taken for the paper, then the
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
    except (struct.error, ValueError, IndexError) as error:
        raise ts.OptionError(f"'{path}' is damaged ({error}); export it again") from error
    if not colours:
        raise ts.OptionError(f"'{path}' has no colours in RGB, gray or CMYK; export it again")
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
        at += 6 + length
