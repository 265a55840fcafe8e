"""Masks read from pictures, where white is inside, or drawn as boxes and ellipses that are given in words."""

import re
from pathlib import Path

import numpy as np

from toposeam.errors import ImageError
from toposeam.images import full_scale
from toposeam_cli.media.pictures.decode import refuse_large, size_of
from toposeam_cli.media.pictures.picture import read_picture

#: A box or an ellipse: the kind, x and y of its upper left corner, its width and height, px.
_AREA = re.compile(r"(box|ellipse):([+-]?\d+),([+-]?\d+),(\d+),(\d+)")


def read_white(path: Path, shape: tuple[int, int], of: str, max_pixels: int) -> np.ndarray:
    """Read a mask: (H, W) bool, True where the picture is at least half white and not transparent.

    Parameters
    ----------
    path : Path
        Or words in place of a file: ``box:X,Y,W,H``, ``ellipse:X,Y,W,H``, or several with ``;`` between them.
    shape : (int, int)
        Height and width it must have.
    of : str
        Name of the masked picture, for error texts.
    max_pixels : int
        Limit as for :func:`~toposeam_cli.media.pictures.picture.read_picture`.

    Raises
    ------
    ImageError
        When it has another shape, or as :func:`~toposeam_cli.media.pictures.picture.read_picture` raises it.
    """
    if path.name.startswith(("box:", "ellipse:")) and not path.exists():
        return _drawn(path.name, shape, of)
    size = size_of(path)
    refuse_large(path, *size, max_pixels)
    height, width = shape
    if sorted(size) == sorted(shape):  # it may be rotated, which only decoding shows
        mask = read_picture(path, max_pixels=max_pixels)
        size = mask.pixels.shape[1], mask.pixels.shape[0]
    if size != (width, height):
        raise ImageError(
            f"the mask {path.name} is {size[0]} × {size[1]} px, but {of} is {width} × {height} px; make it "
            "that size"
        )
    gray = mask.pixels if mask.pixels.ndim == 2 else mask.pixels.mean(axis=2)
    white: np.ndarray = (gray >= full_scale(mask.pixels.dtype) / 2) & mask.covered()
    return white


def _drawn(words: str, shape: tuple[int, int], of: str) -> np.ndarray:
    """Draw areas that are given in words.

    Raises
    ------
    ImageError
        If they cannot be understood, or lie beside the picture.
    """
    white = np.zeros(shape, bool)
    for word in words.split(";"):
        area = _AREA.fullmatch(word.strip())
        if area is None:
            raise ImageError(
                f"{word!r} is no area; write box:X,Y,WIDTH,HEIGHT or ellipse:X,Y,WIDTH,HEIGHT, in px"
            )
        left, top, width, height = map(int, area.groups()[1:])
        rows, columns = (
            np.arange(max(0, low), min(low + side, end))
            for low, side, end in zip((top, left), (height, width), shape, strict=True)
        )
        if not rows.size or not columns.size:
            raise ImageError(f"{word} holds no pixel of {of}, which is {shape[1]} × {shape[0]} px")
        inside = np.ones((rows.size, columns.size), bool)
        if area[1] == "ellipse":
            down, across = (
                ((2 * (at - low) + 1) / side - 1) ** 2
                for at, low, side in ((rows, top, height), (columns, left, width))
            )
            inside = down[:, np.newaxis] + across <= 1
        white[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] |= inside
    return white
