"""Layers placed on a canvas."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Image, Mask
from toposeam.checks import check_kind, check_number, check_pair
from toposeam.errors import ImageError, OptionError, Term
from toposeam.images import MAX_PIXELS, Windows, as_array, as_mask, full_scale
from toposeam.sentence import counted

#: Default of the largest number of megapixels of a canvas.
MAX_MEGAPIXELS = MAX_PIXELS / 1e6
#: Farthest a layer may lie from the origin, px.
FARTHEST = 2**31 - 1


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Layer:
    """An image placed on a plane.

    Examples
    --------
    >>> Layer(np.zeros((20, 30)), at=(5, -2), name="left")
    Layer('left', 30 × 20 px at 5,-2, float64)
    """

    #: (H, W) or (H, W, C) array, integer or float, colour only; or a PIL picture, whose opacity becomes
    #: `alpha`; or :class:`toposeam.Windows`, of which only what is needed is read.
    image: Image
    _: KW_ONLY
    #: (H, W), same dtype as the image: opacity, up to that dtype's full scale (1 for floats); None means
    #: opaque. The layer has pixels where it is above 0.
    alpha: npt.NDArray[Any] | None = None
    #: (x, y): column and row of the layer's upper left pixel, in px; may be negative.
    at: tuple[int, int] = (0, 0)
    #: Shown in error texts and file names.
    name: str = "layer"
    #: (H, W), True where the layer may show; None means wherever it has pixels.
    mask: npt.ArrayLike | None = None
    #: (H, W), True where no other layer may show; ignored where the layer itself may not.
    keep: npt.ArrayLike | None = None
    #: The value of white, if the dtype does not imply it: for integers other than uint8 and uint16, and for
    #: floats beyond [0, 1] (:func:`toposeam.images.as_float`).
    data_range: float | None = None
    #: Exposure of the photograph in any unit, as seconds × ISO ÷ f-number². It is used for matching tones
    #: if overlaps do not determine them.
    exposure: float | None = None

    def __post_init__(self) -> None:
        check_kind("name", self.name, str, "a text")
        if self.data_range is not None:
            check_number("data_range", self.data_range, 0, above=True)
        if self.exposure is not None:
            check_number("exposure", self.exposure, 0, above=True)
        image = (
            self.image if isinstance(self.image, Windows) else as_array(self.image, self.title, endless=True)
        )
        if hasattr(self.image, "getbands") and image.ndim == 3 and image.shape[2] in (2, 4):  # of PIL
            if self.alpha is None:
                object.__setattr__(self, "alpha", image[..., -1])
            image = image[..., 0] if image.shape[2] == 2 else image[..., :3]
        object.__setattr__(self, "image", image)
        if self.alpha is not None and not isinstance(self.alpha, Windows):
            object.__setattr__(
                self, "alpha", as_array(self.alpha, Term("", f"the alpha of {self.name}"), endless=True)
            )
        if self.alpha is not None and self.alpha.shape != self.image.shape[:2]:
            raise ImageError(
                "{name}: alpha has shape {shape!s}, the image {expected!s}; pass one value per pixel",
                kind="shape",
                name=self.name,
                shape=self.alpha.shape,
                expected=self.image.shape[:2],
            )
        if self.alpha is not None and self.alpha.dtype != self.image.dtype:
            raise ImageError(
                "{name}: alpha is {dtype} and the image {expected}; convert it",
                kind="dtype",
                name=self.name,
                dtype=str(self.alpha.dtype),
                expected=str(self.image.dtype),
            )
        try:
            object.__setattr__(self, "at", check_pair("at", self.at, -FARTHEST, FARTHEST))
        except OptionError as error:
            raise OptionError(
                "{name}: {parameter} is {value!r}; give two whole numbers of px, x and y, not beyond ±2³¹",
                kind="whole number",
                name=self.name,
                parameter=Term("at", "at"),
                value=self.at,
            ) from error
        for field in ("mask", "keep"):
            if getattr(self, field) is not None:
                object.__setattr__(
                    self,
                    field,
                    as_mask(getattr(self, field), self.image.shape[:2], Term("", f"{self.name}: {field}")),
                )

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        where = f"{self.at[0]},{self.at[1]}"
        return f"Layer({self.name!r}, {width} × {height} px at {where}, {self.image.dtype})"

    @property
    def title(self) -> Term:
        """The name, as a term in errors that front ends do not replace."""
        return Term("", self.name)

    @property
    def white(self) -> float:
        """The value of white."""
        return float(full_scale(self.image.dtype)) if self.data_range is None else self.data_range

    @property
    def bare(self) -> Layer:
        """The layer without masks and opacity, where its cover is known otherwise."""
        return dataclasses.replace(self, alpha=None, mask=None, keep=None)

    @property
    def covered(self) -> Mask:
        """(H, W) bool mask, True where the layer has pixels that may show."""
        covered = np.ones(self.image.shape[:2], bool) if self.alpha is None else np.asarray(self.alpha) > 0
        return covered if self.mask is None else covered & np.asarray(self.mask)


def as_layers(pictures: Any) -> Any:
    """Wrap the arrays and PIL pictures of a sequence in layers that are named by their numbers, from 1.

    Other items are left as they are, for :func:`toposeam.checks.check_items` to refuse.
    """
    if not isinstance(pictures, list | tuple):
        return pictures
    return tuple(
        Layer(picture, name=f"picture {number}") if _is_picture(picture) else picture
        for number, picture in enumerate(pictures, start=1)
    )


def _is_picture(item: object) -> bool:
    """Test whether something is an array or a PIL picture."""
    return isinstance(item, np.ndarray) or hasattr(item, "getbands")


class Box(NamedTuple):
    """A rectangle of canvas pixels, bottom and right exclusive; it may reach beyond the canvas."""

    top: int
    left: int
    bottom: int
    right: int

    @classmethod
    def of(cls, rows: slice, columns: slice) -> Box:
        """Return the box of rows and columns, as :func:`toposeam.images.box_of` finds them."""
        return cls(rows.start, columns.start, rows.stop, columns.stop)

    @property
    def slices(self) -> tuple[slice, slice]:
        """The rows and columns of the box, if it lies on the canvas."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in px."""
        top, left, bottom, right = self  # called very often: no calls of max
        return bottom - top if bottom > top else 0, right - left if right > left else 0

    def grown(self, margin: int) -> Box:
        """Return the box with a margin on all sides."""
        return Box(self.top - margin, self.left - margin, self.bottom + margin, self.right + margin)

    def moved(self, down: int, right: int) -> Box:
        """Return the box moved down and right."""
        return Box(self.top + down, self.left + right, self.bottom + down, self.right + right)

    def halved(self) -> Box:
        """Return the box of the pixels at half the size of which this box contains a part."""
        return Box(self.top // 2, self.left // 2, -(-self.bottom // 2), -(-self.right // 2))

    def doubled(self) -> Box:
        """Return the box at twice the size."""
        return Box(2 * self.top, 2 * self.left, 2 * self.bottom, 2 * self.right)

    def shared(self, other: Box) -> Box:
        """Return the intersection of two boxes; a side of its shape is 0 if it is empty."""
        top, left, bottom, right = self
        first, start, last, end = other
        return Box(
            top if top > first else first,
            left if left > start else start,
            bottom if bottom < last else last,
            right if right < end else end,
        )

    def around(self, other: Box) -> Box:
        """Return the smallest box that holds both."""
        return Box(
            min(self.top, other.top),
            min(self.left, other.left),
            max(self.bottom, other.bottom),
            max(self.right, other.right),
        )

    def within(self, outer: Box) -> tuple[slice, slice]:
        """Return the rows and columns of this box in an array that fills `outer`."""
        top, left, bottom, right = self
        y, x = outer[:2]
        return slice(top - y, bottom - y), slice(left - x, right - x)


def cut(array: npt.NDArray[Any], at: Box, box: Box, fill: int = 0) -> npt.NDArray[Any]:
    """Copy box `box` from an array that fills box `at`, (H, W, …) to (h, w, …); `fill` beyond the array."""
    top, left, bottom, right = box
    y, x, last, end = at
    if y <= top and x <= left and bottom <= last and right <= end:
        return array[top - y : bottom - y, left - x : right - x].copy()
    common = at.shared(box)
    shape = (*box.shape, *array.shape[2:])
    result = np.full(shape, fill, array.dtype) if fill else np.zeros(shape, array.dtype)
    if all(common.shape):
        result[common.within(box)] = array[common.within(at)]
    return result


def check_layers(layers: Sequence[Layer]) -> Sequence[Layer]:
    """Refuse anything but at least two placed layers; return them as a sequence.

    Raises
    ------
    OptionError
        Also for arrays and pictures that are not placed.
    """
    given = [layers] if isinstance(layers, Layer | str) or not isinstance(layers, Sequence) else layers
    for index, layer in enumerate(given):
        if isinstance(layer, str | os.PathLike):
            raise OptionError(
                "layer {number} is the name {value!r}; pass the picture, as PIL.Image.open({value!r}), or "
                "give names of files to the command line",
                kind="type",
                number=index,
                layers=(index,),
                value=os.fspath(layer),
            )
    if len(given) < 2 and all(isinstance(layer, Layer) or _is_picture(layer) for layer in given):
        kind = "picture" if given and not isinstance(given[0], Layer) else "layer"
        raise OptionError(
            "{given} given; pass a list of at least two",
            kind="few layers",
            given=f"{counted(len(given), kind)} {'was' if len(given) == 1 else 'were'}",
        )
    for index, layer in enumerate(given):
        if not isinstance(layer, Layer):
            raise OptionError(
                "layer {number} is of type {type}; say where it lies, as toposeam.Layer(image, at=(x, y))",
                kind="type",
                number=index,
                layers=(index,),
                type=type(layer).__name__,
            )
    return given
