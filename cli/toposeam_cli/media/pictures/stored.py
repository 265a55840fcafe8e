"""Pictures whose pixels are in a file of raw values and are read by windows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np

from toposeam.images import full_scale
from toposeam_cli.files.scratch import Scratch
from toposeam_cli.media.pictures.libvips import channels
from toposeam_cli.media.pictures.picture import Picture, read_strips

#: Rows that are copied at a time.
_ROWS = 256


def read_stored(path: Path, max_pixels: int, file: Path) -> Picture:
    """Read a picture a few rows at a time into an existing file, without alpha if it is opaque everywhere.

    Raises
    ------
    ImageError
    OSError
        When the disk is full.
    """
    like, height = None, 0
    with file.open("r+b") as target:
        for part in read_strips(path, max_pixels):
            if like is None or like.alpha is None:
                if part.alpha is None or (part.alpha == full_scale(part.alpha.dtype)).all():
                    part = replace(part, alpha=None)
                elif like is not None:
                    target.flush()
                    _add_opacity(target, stored_picture(file, like, height, like.pixels.shape[1]))
            _write(target, part)
            like, height = part, height + part.pixels.shape[0]
    return stored_picture(file, cast(Picture, like), height, cast(Picture, like).pixels.shape[1])


def store(
    picture: Picture, convert: Callable[[Picture], Picture] | None = None, *, scratch: Scratch
) -> Picture:
    """Write the pixels of a picture to a file, converted by rows if `convert` is given; return the picture
    over it.

    Raises
    ------
    OutputError
        When the disk is full.
    """
    file = scratch.new()
    parts = _parts(picture)
    with scratch.failures_told():
        return stored_at(file, parts if convert is None else map(convert, parts))


def stored_at(file: Path, parts: Iterable[Picture]) -> Picture:
    """Write a picture that comes in parts of some rows to an existing file; return the picture over it.

    Raises
    ------
    OSError
        When the disk is full.
    """
    parts, height = iter(parts), 0
    first = next(parts)
    with file.open("r+b") as target:
        for part in chain([first], parts):
            height += part.pixels.shape[0]
            _write(target, part)
    return stored_picture(file, first, height, first.pixels.shape[1])


def stored_in(file: Path, picture: Picture) -> Picture:
    """Write the pixels of a picture to an existing file; return the picture over it.

    Raises
    ------
    OSError
        When the disk is full.
    """
    return stored_at(file, _parts(picture))


def stored_picture(path: Path, like: Picture, height: int, width: int) -> Picture:
    """Return the picture in a file that holds its colours and, if it has any, its opacity behind them."""
    from toposeam_cli.media.pictures.raw import Stored

    count = 1 if like.pixels.ndim == 2 else 3
    shape, dtype = (height, width, count + (like.alpha is not None)), like.pixels.dtype
    pixels = Stored([path], shape, dtype, (0, count))
    alpha = None if like.alpha is None else Stored([path], shape, dtype, (count, count + 1))
    return replace(like, pixels=cast(np.ndarray, pixels), alpha=cast("np.ndarray | None", alpha))


def _add_opacity(target: BinaryIO, picture: Picture) -> None:
    """Rewrite the file of an opaque picture in place with an opacity, and leave the file's position at its
    end. The last rows are moved first, so that no row is overwritten before it is read.
    """
    (height, width), dtype = picture.pixels.shape[:2], picture.pixels.dtype
    line = width * (channels(picture.pixels) + 1) * dtype.itemsize
    for start in reversed(range(0, height, _ROWS)):
        pixels = picture.pixels[start : start + _ROWS, :]
        target.seek(start * line)
        _write(target, replace(picture, pixels=pixels, alpha=np.full(pixels.shape[:2], full_scale(dtype))))
        target.flush()
    target.seek(height * line)


def _parts(picture: Picture) -> Iterator[Picture]:
    for start in range(0, picture.pixels.shape[0], _ROWS):
        rows = slice(start, start + _ROWS), slice(None)
        alpha = None if picture.alpha is None else picture.alpha[rows]
        yield replace(picture, pixels=picture.pixels[rows], alpha=alpha)


def _write(target: BinaryIO, part: Picture) -> None:
    values = part.pixels
    if part.alpha is not None:
        planes = values if values.ndim == 3 else values[..., np.newaxis]
        values = np.concatenate([planes, part.alpha[..., np.newaxis]], axis=2)
    target.write(np.ascontiguousarray(values).data)
