"""Masks read from pictures: white is inside."""

from pathlib import Path

import numpy as np

from toposeam.errors import ImageError
from toposeam.images import full_scale
from toposeam_cli.media.pictures.decode import refuse_large, size_of
from toposeam_cli.media.pictures.picture import read_picture


def read_white(path: Path, shape: tuple[int, int], of: str, max_pixels: int) -> np.ndarray:
    """Read a mask: (H, W) bool, True where the picture is at least half white and not transparent.

    Parameters
    ----------
    path : Path
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
