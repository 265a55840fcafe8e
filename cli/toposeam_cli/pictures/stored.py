"""Pictures whose pixels lie in a file of raw values, and are read by windows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np

from toposeam.images import full_scale
from toposeam_cli.files.scratch import Scratch
from toposeam_cli.pictures.picture import Picture, read_strips
from toposeam_cli.pictures.raw import Stored

#: Rows that are copied at once.
_ROWS = 256


def read_stored(path: Path, max_pixels: int, file: Path) -> Picture:
    """A picture as :func:`~toposeam_cli.pictures.picture.read_picture` reads it, a few rows at a time into a
    file that exists; opacity that is full everywhere, which says nothing, is left out.

    Raises
    ------
    ImageError
    OSError
        When there is no space.
    """
    opaque = True

    def parts() -> Iterator[Picture]:
        nonlocal opaque
        for part in read_strips(path, max_pixels):
            if part.alpha is not None and opaque:
                opaque = bool((part.alpha == full_scale(part.alpha.dtype)).all())
            yield part

    picture = stored_at(file, parts())
    return _without_alpha(file, picture) if opaque and picture.alpha is not None else picture


def store(
    picture: Picture, convert: Callable[[Picture], Picture] | None = None, *, scratch: Scratch
) -> Picture:
    """The same picture, or what it is converted to by rows, its pixels in a file.

    Raises
    ------
    OutputError
        When there is no space.
    """
    file = scratch.new()
    parts = _parts(picture)
    with scratch.failures_told():
        return stored_at(file, parts if convert is None else map(convert, parts))


def stored_at(file: Path, parts: Iterable[Picture]) -> Picture:
    """The picture whose rows come part by part, its pixels in a file that exists.

    Raises
    ------
    OSError
        When there is no space.
    """
    parts, height = iter(parts), 0
    first = next(parts)
    with file.open("r+b") as target:
        for part in chain([first], parts):
            height += part.pixels.shape[0]
            _write(target, part)
    return stored_picture(file, first, height, first.pixels.shape[1])


def stored_in(file: Path, picture: Picture) -> Picture:
    """The same picture, its pixels in a file that exists.

    Raises
    ------
    OSError
        When there is no space.
    """
    return stored_at(file, _parts(picture))


def stored_picture(path: Path, like: Picture, height: int, width: int) -> Picture:
    """The picture in a file that holds its colours and, if it has any, its opacity behind them."""
    count = 1 if like.pixels.ndim == 2 else 3
    shape, dtype = (height, width, count + (like.alpha is not None)), like.pixels.dtype
    pixels = Stored(path, shape, dtype, (0, count))
    alpha = None if like.alpha is None else Stored(path, shape, dtype, (count, count + 1))
    return replace(like, pixels=cast(np.ndarray, pixels), alpha=cast("np.ndarray | None", alpha))


def _without_alpha(file: Path, picture: Picture) -> Picture:
    """The same, its file rewritten in place: what is written lies before what is read."""
    height, width = picture.pixels.shape[:2]
    with file.open("r+b") as target:
        for part in _parts(picture):
            _write(target, replace(part, alpha=None))
            target.flush()
        target.truncate()
    return stored_picture(file, replace(picture, alpha=None), height, width)


def _parts(picture: Picture) -> Iterator[Picture]:
    for start in range(0, picture.pixels.shape[0], _ROWS):
        rows = slice(start, start + _ROWS), slice(None)
        alpha = None if picture.alpha is None else picture.alpha[rows]
        yield replace(picture, pixels=picture.pixels[rows], alpha=alpha)


def _write(target: BinaryIO, part: Picture) -> None:
    planes = [part.pixels if part.pixels.ndim == 3 else part.pixels[..., np.newaxis]]
    if part.alpha is not None:
        planes.append(part.alpha[..., np.newaxis])
    target.write(np.concatenate(planes, axis=2).tobytes())
