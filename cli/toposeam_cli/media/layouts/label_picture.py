"""Label maps of layouts as gray pictures: the number of the layer that shows, white where none does."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

import toposeam as ts
from toposeam.arrays import Labels
from toposeam_cli.media.pictures.decode import refuse_large, size_of
from toposeam_cli.media.pictures.picture import read_picture

#: From so many layers on the picture has 16 bits.
_DEEP_FROM = 255


def read_labels(path: Path, numbers: Sequence[int], count: int, max_pixels: int) -> Labels:
    """Read a label map.

    Parameters
    ----------
    path : Path
    numbers : sequence of int
        The number of each visible layer among those of the layout.
    count : int
        Number of all layers of the layout.
    max_pixels : int
        Refuse a larger picture, before it is decoded.

    Returns
    -------
    (H, W) int array
        The number of the layer among the visible ones, -1 for none and for others.

    Raises
    ------
    ImageError
        If it cannot be read, is no gray picture without transparency, or has the number of no layer.
    """
    refuse_large(path, *size_of(path), max_pixels, raisable=False)
    picture = read_picture(path, max_pixels=max_pixels)
    pixels = picture.pixels
    if pixels.ndim != 2 or picture.alpha is not None or pixels.dtype.kind != "u":
        raise ts.ImageError(
            f"the labels '{path}' are no gray picture of 8 or 16 bits without transparency; write one"
        )
    white = np.iinfo(pixels.dtype).max
    shown = np.where(pixels == white, -1, pixels.astype(np.int32))
    if shown.max(initial=-1) >= count:
        raise ts.ImageError(
            f"the labels '{path}' have the number {shown.max()}, and there are {count} layers, counted from "
            "0; correct the picture, or leave it out"
        )
    among = np.full(count + 1, -1, np.int16)  # the last one stands for -1
    among[list(numbers)] = np.arange(len(numbers))
    return np.asarray(among[shown])


def labels_png(labels: Labels, count: int) -> bytes:
    """Return a label map of so many layers, (H, W) int with -1 for none, as a PNG of 8 or 16 bits."""
    dtype = np.uint8 if count < _DEEP_FROM else np.uint16
    pixels = np.where(labels < 0, np.iinfo(dtype).max, labels).astype(dtype)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()
