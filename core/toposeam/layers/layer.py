"""Layers placed on a canvas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from toposeam.errors import ImageError, OptionError
from toposeam.images import Image, Mask, as_mask


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
    #: (H, W), where the layer may show; None means wherever it has pixels.
    mask: npt.ArrayLike | None = None
    #: (H, W), where no other layer may show; counts where the layer itself may.
    keep: npt.ArrayLike | None = None

    def __post_init__(self) -> None:
        if self.image.ndim not in (2, 3) or 0 in self.image.shape:
            raise ImageError(f"{self.name} has shape {self.image.shape}; a layer needs a non-empty (H, W) or (H, W, C) image")
        if self.alpha is not None and self.alpha.shape != self.image.shape[:2]:
            raise ImageError(f"{self.name}: alpha has shape {self.alpha.shape}, the image {self.image.shape[:2]}; pass one value per pixel")
        if self.alpha is not None and self.alpha.dtype != self.image.dtype:
            raise ImageError(f"{self.name}: alpha is {self.alpha.dtype} and the image {self.image.dtype}; convert it")
        if len(self.offset) != 2 or not all(isinstance(value, int | np.integer) for value in self.offset):
            raise OptionError(f"{self.name}: offset is {self.offset}; give two whole numbers of px, column and row")
        for field in ("mask", "keep"):
            if getattr(self, field) is not None:
                object.__setattr__(self, field, as_mask(getattr(self, field), self.image.shape[:2], f"{self.name}: {field}"))

    @property
    def covered(self) -> Mask:
        """(H, W) bool, where the layer has pixels that may show."""
        covered = np.ones(self.image.shape[:2], bool) if self.alpha is None else self.alpha > 0
        return covered if self.mask is None else covered & np.asarray(self.mask)


class Box(NamedTuple):
    """A rectangle of canvas pixels; it may reach over the canvas's edge."""

    top: int
    left: int
    bottom: int
    right: int

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns, for a box that lies on the canvas."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in px."""
        return max(0, self.bottom - self.top), max(0, self.right - self.left)

    def grown(self, margin: int) -> Box:
        """The box with a margin on all sides."""
        return Box(self.top - margin, self.left - margin, self.bottom + margin, self.right + margin)

    def shared(self, other: Box) -> Box:
        """What two boxes have in common; its shape has a zero when that is nothing."""
        return Box(max(self.top, other.top), max(self.left, other.left), min(self.bottom, other.bottom), min(self.right, other.right))

    def within(self, outer: Box) -> tuple[slice, slice]:
        """Rows and columns of this box in an array that fills `outer`."""
        return slice(self.top - outer.top, self.bottom - outer.top), slice(self.left - outer.left, self.right - outer.left)


def cut(array: npt.NDArray[Any], at: Box, box: Box, fill: int = 0) -> npt.NDArray[Any]:
    """A copy of what an array that fills `at` holds in `box`; `fill` where it does not reach. (H, W, …) to (h, w, …)."""
    result = np.full((*box.shape, *array.shape[2:]), fill, array.dtype)
    common = at.shared(box)
    if all(common.shape):
        result[common.within(box)] = array[common.within(at)]
    return result


@dataclass(frozen=True, slots=True, kw_only=True)
class Canvas:
    """The smallest rectangle that holds every layer."""

    origin: tuple[int, int]
    #: Height and width in px.
    shape: tuple[int, int]

    @property
    def box(self) -> Box:
        """The canvas itself."""
        return Box(0, 0, *self.shape)

    def place(self, layer: Layer) -> Box:
        """The part of the canvas that the layer fills."""
        x, y = layer.offset[0] - self.origin[0], layer.offset[1] - self.origin[1]
        return Box(y, x, y + layer.image.shape[0], x + layer.image.shape[1])


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
