"""Pictures whose pixels lie in a file of raw values, and are read by windows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from toposeam_cli.files.scratch import Scratch
from toposeam_cli.pictures.picture import Picture
from toposeam_cli.pictures.raw import Stored

#: Rows that are copied at once.
_ROWS = 256


def store(picture: Picture, scratch: Scratch) -> Picture:
    """The same picture, its pixels in a file.

    Raises
    ------
    OutputError
        When there is no space.
    """
    path = scratch.new()
    with scratch.failures_told():
        return stored_at(path, picture)


def stored_at(path: Path, picture: Picture) -> Picture:
    """The same picture, its pixels in a file that exists.

    Raises
    ------
    OSError
    """
    height, width = picture.pixels.shape[:2]
    with path.open("r+b") as file:
        for rows in _strips(height):
            planes = [np.atleast_3d(picture.pixels[rows])]
            if picture.alpha is not None:
                planes.append(picture.alpha[rows, :, np.newaxis])
            file.write(np.concatenate(planes, axis=2).tobytes())
    return stored_picture(path, picture, height, width)


def stored_picture(path: Path, like: Picture, height: int, width: int) -> Picture:
    """The picture in a file that holds its colours and, if it has any, its opacity behind them."""
    count = 1 if like.pixels.ndim == 2 else 3
    shape, dtype = (height, width, count + (like.alpha is not None)), like.pixels.dtype
    pixels = Stored(path, shape, dtype, (0, count))
    alpha = None if like.alpha is None else Stored(path, shape, dtype, (count, count + 1))
    return replace(like, pixels=cast(np.ndarray, pixels), alpha=cast("np.ndarray | None", alpha))


def _strips(height: int) -> Iterator[slice]:
    for start in range(0, height, _ROWS):
        yield slice(start, min(start + _ROWS, height))
