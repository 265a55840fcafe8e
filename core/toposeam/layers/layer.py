"""Layers placed on a canvas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.errors import ImageError, OptionError
from toposeam.images import Image, Mask


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layer:
    """An image placed on a plane."""

    #: (H, W) or (H, W, C), integer or float, colour only.
    image: Image
    #: (H, W), same dtype as the image: opacity, up to that dtype's full scale (1 for floats); None means opaque. The layer has pixels
    #: where it is above 0.
    alpha: npt.NDArray[Any] | None = None
    #: Column and row of the layer's upper left pixel, in px; may be negative.
    offset: tuple[int, int] = (0, 0)
    #: Shown in error texts and file names.
    name: str = "layer"

    def __post_init__(self) -> None:
        if self.image.ndim not in (2, 3) or 0 in self.image.shape:
            raise ImageError(f"{self.name} has shape {self.image.shape}; a layer needs a non-empty (H, W) or (H, W, C) image")
        if self.alpha is not None and self.alpha.shape != self.image.shape[:2]:
            raise ImageError(f"{self.name}: alpha has shape {self.alpha.shape}, the image {self.image.shape[:2]}; pass one value per pixel")
        if self.alpha is not None and self.alpha.dtype != self.image.dtype:
            raise ImageError(f"{self.name}: alpha is {self.alpha.dtype} and the image {self.image.dtype}; convert it")
        if len(self.offset) != 2 or not all(isinstance(value, int | np.integer) for value in self.offset):
            raise OptionError(f"{self.name}: offset is {self.offset}; give two whole numbers of px, column and row")

    @property
    def covered(self) -> Mask:
        """(H, W) bool, where the layer has pixels."""
        return np.ones(self.image.shape[:2], bool) if self.alpha is None else self.alpha > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Canvas:
    """The smallest rectangle that holds every layer."""

    origin: tuple[int, int]
    #: Height and width in px.
    shape: tuple[int, int]

    def place(self, layer: Layer) -> tuple[slice, slice]:
        """Rows and columns of the canvas that the layer fills."""
        x, y = layer.offset[0] - self.origin[0], layer.offset[1] - self.origin[1]
        height, width = layer.image.shape[:2]
        return slice(y, y + height), slice(x, x + width)


def common_canvas(layers: Sequence[Layer], max_pixels: int) -> Canvas:
    """The canvas of some layers.

    Raises
    ------
    OptionError
        When it would hold more than `max_pixels` pixels.
    """
    left, top = (min(layer.offset[axis] for layer in layers) for axis in (0, 1))
    right = max(layer.offset[0] + layer.image.shape[1] for layer in layers)
    bottom = max(layer.offset[1] + layer.image.shape[0] for layer in layers)
    height, width = bottom - top, right - left
    if height * width > max_pixels:
        raise OptionError(f"the layers span {width} × {height} px, more than {max_pixels} pixels; check the offsets")
    return Canvas(origin=(left, top), shape=(height, width))
