"""Conversion and checks of image arrays: any integer or float dtype, gray or any number of channels."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from functools import partial, reduce
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam import _kernels
from toposeam.arrays import Floats32, Image, Mask
from toposeam.checks import Name, check_number, is_masked, term_of
from toposeam.errors import ImageError

#: Largest canvas, px, that is made unless the caller raises the limit: a gigapixel.
MAX_PIXELS = 10**9
#: Largest absolute value of a float image, in units of white: squares of larger ones overflow in float32.
MAX_FLOAT = 1e12
#: Largest image array, px: larger ones are refused before their values are read.
MAX_ARRAY_PIXELS = 2**32
#: `data_range`, the value that counts as white, lies between 1 ÷ this and this.
_MAX_WHITE = 1e30
#: Float images within ± this are taken as shares of white: highlights and filters go a little beyond 1.
_MAX_UNSCALED_FLOAT = 2.0
#: An array with at most four rows and more channels than this is taken as (C, H, W) and refused.
_MAX_CHANNELS = 16


class Windows(ABC):
    """An image that is read window by window: larger than memory, on disk, or computed.

    Indexing by slices of rows and columns returns the window as an array. :class:`toposeam.Layer` takes such
    an image for its pixels and its opacity. A subclass implements `read`.

    Parameters
    ----------
    shape : (int, int) or (int, int, int)
    dtype : dtype

    Examples
    --------
    >>> class Ramp(Windows):
    ...     def read(self, rows, columns):
    ...         return np.add.outer(np.r_[rows], np.r_[columns]).astype(self.dtype)
    >>> Ramp((60000, 90000), np.uint32)[1000:1002, 5:8].tolist()
    [[1005, 1006, 1007], [1006, 1007, 1008]]
    """

    def __init__(self, shape: tuple[int, ...], dtype: npt.DTypeLike) -> None:
        self.shape, self.dtype = tuple(shape), np.dtype(dtype)

    @property
    def ndim(self) -> int:
        """2, or 3 with channels."""
        return len(self.shape)

    @abstractmethod
    def read(self, rows: slice, columns: slice) -> Image:
        """Return the pixels of some rows and columns as a new (h, w) or (h, w, C) array.

        The caller may write to the array. The bounds of the slices are whole numbers within the image; a
        slice may have a step.
        """

    def __getitem__(self, key: tuple[slice, slice]) -> Image:
        rows, columns = (slice(*part.indices(side)) for part, side in zip(key, self.shape[:2], strict=True))
        return self.read(rows, columns)

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> Image:
        whole = self[:, :]
        return whole if dtype is None else whole.astype(dtype)


def as_array(image: Any, name: Name = "image", *, endless: bool = False) -> Image:
    """Return the pixels of an array or of a PIL picture, unchanged.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like, or PIL.Image.Image
        PIL pictures with a palette become RGB, or RGBA if they have transparent colours.
    name : str or Term
        Name of the image in error texts.
    endless : bool
        Accept images of any size, for callers that read them by windows.

    Returns
    -------
    (H, W) or (H, W, C) array of bool, integers or floats

    Raises
    ------
    ImageError
        For other shapes, (C, H, W) among them, empty or masked arrays, complex or object dtypes, and more
        than four gigapixels.
    """
    if is_masked(image):
        raise ImageError(
            "{array} is a masked array; pass {array}.filled(0), and where it has pixels as a mask",
            kind="array",
            array=term_of(name),
        )
    if type(image).__module__.partition(".")[0] == "PIL" and image.mode in ("P", "PA", "CMYK", "YCbCr"):
        image = image.convert("RGBA" if image.mode == "PA" or "transparency" in image.info else "RGB")
    try:
        array = np.asarray(image)
    except ValueError as error:
        raise ImageError(
            "{array} is no array ({reason}); pass an (H, W) or (H, W, C) one",
            kind="array",
            reason=str(error),
            array=term_of(name),
        ) from error
    if (
        array.dtype != bool
        and not np.issubdtype(array.dtype, np.integer)
        and not np.issubdtype(array.dtype, np.floating)
    ):
        raise ImageError(
            "{array} is of type {type} and dtype {dtype}; pass integers or floats",
            kind="dtype",
            type=type(image).__name__,
            dtype=str(array.dtype),
            array=term_of(name),
        )
    if array.ndim not in (2, 3) or 0 in array.shape:
        raise ImageError(
            "{array} has shape {shape!s}; pass a non-empty (H, W) or (H, W, C) array",
            kind="shape",
            shape=array.shape,
            array=term_of(name),
        )
    height, width = array.shape[:2]
    if height * width > MAX_ARRAY_PIXELS and not endless:
        raise ImageError(
            "{array} has {width} × {height} px, more than are taken at once; pass a part of it",
            kind="too large",
            width=width,
            height=height,
            array=term_of(name),
        )
    if array.ndim == 3 and array.shape[0] <= 4 and array.shape[2] > _MAX_CHANNELS:
        raise ImageError(
            "{array} has shape {shape!s}, which looks like (C, H, W); pass (H, W, C), as "
            "{array}.transpose(1, 2, 0) has it",
            kind="shape",
            shape=array.shape,
            array=term_of(name),
        )
    return array


def as_float(
    image: npt.ArrayLike, name: Name = "image", data_range: float | None = None
) -> npt.NDArray[np.float32]:
    """Return an image as float32 with a channel axis, its values divided by `data_range`.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like
        Bool, integer or float.
    name : str or Term
        Name of the image in error texts.
    data_range : float, optional
        The value that becomes 1 (white). By default 255 for uint8, 65535 for uint16, and 1 for floats, which
        must then lie within ±2.

    Returns
    -------
    (H, W, C) float32 array

    Raises
    ------
    ImageError
        As for :func:`as_array`; for NaN, infinite or huge values; and where `data_range` is needed: for
        integers of other types, and for floats beyond ±2 like those in 0..255.
    OptionError
        When `data_range` is not positive.

    Examples
    --------
    >>> as_float(np.array([[0, 255]], np.uint8)).ravel()
    array([0., 1.], dtype=float32)
    >>> as_float(np.array([[0, 4095]]), data_range=4095).ravel()
    array([0., 1.], dtype=float32)
    """
    array = as_array(image, name)
    check_values(array, name, data_range)
    if array.ndim == 2:
        array = array[..., np.newaxis]
    result = array.astype(np.float32)
    _scale(result, array.dtype, data_range)
    return result


def as_reduced(
    image: npt.ArrayLike, scale: int, name: Name = "image", data_range: float | None = None
) -> npt.NDArray[np.float32]:
    """Return an image like :func:`as_float`, averaged over squares of `scale` px a side.

    Examples
    --------
    >>> as_reduced(np.array([[0, 255], [255, 255]], np.uint8), 2).ravel().round(6)
    array([0.75], dtype=float32)
    """
    array = as_array(image, name)
    if scale == 1 or array.dtype not in (np.uint8, np.uint16):
        return np.asarray(reduced(as_float(array, name, data_range), scale))
    check_values(array, name, data_range)
    result: npt.NDArray[np.float32] = reduced(array.reshape(*array.shape[:2], -1), scale)
    _scale(result, array.dtype, data_range)
    return result


def reduced(values: npt.NDArray[Any], scale: int) -> npt.NDArray[Any]:
    """Average over squares of `scale` px a side; of uint8 and uint16 sums are exact and results float32.

    Parameters
    ----------
    values : (H, W, ...) array
    scale : int
        At most 256.
    """
    if scale == 1:
        return values
    kind = values.dtype if values.dtype.kind == "f" else np.dtype(np.uint32)
    add = partial(np.add, dtype=kind)
    rows, columns = (size // scale for size in values.shape[:2])
    whole = values[: rows * scale, : columns * scale]
    # Adding slices is five times faster than the mean of two of four axes.
    sums = reduce(add, (whole[at::scale] for at in range(scale)))
    squares = reduce(add, (sums[:, at::scale] for at in range(scale)))
    return np.asarray(squares / scale**2, kind if kind.kind == "f" else np.float32)


def all_of_squares(mask: Mask, scale: int) -> Mask:
    """Test which squares of `scale` px a side are True everywhere."""
    if scale == 1:
        return mask
    rows, columns = (size // scale for size in mask.shape)
    whole = mask[: rows * scale, : columns * scale]
    strips = reduce(np.logical_and, (whole[at::scale] for at in range(scale)))
    return np.asarray(reduce(np.logical_and, (strips[:, at::scale] for at in range(scale))))


def blurred(pictures: Floats32, *blurs: float) -> Floats32:
    """Blur pictures by Gaussians, one after the other, which go as far as four deviations.

    Parameters
    ----------
    pictures : (..., H, W) float32 array
        Beyond their borders they go on mirrored.
    blurs : float
        Standard deviations, px; 0 copies.

    Returns
    -------
    (len(blurs), ..., H, W) float32 array
        After the first blur, after the first two, and so on.

    Examples
    --------
    >>> blurred(np.eye(3, dtype=np.float32), 0, 0.5)[:, 1].round(2).astype(str).tolist()
    [['0.0', '1.0', '0.0'], ['0.18', '0.64', '0.18']]
    """
    result = np.empty((len(blurs), *pictures.shape), np.float32)
    source = np.ascontiguousarray(pictures, np.float32)
    *count, rows, columns = pictures.shape
    for blur, target in zip(blurs, result, strict=True):
        radius = int(4 * blur + 0.5)
        weights = np.exp(-0.5 / (blur or 1) ** 2 * np.arange(-radius, radius + 1) ** 2)
        half = weights[radius:] / weights.sum()
        if _kernels.library is None or _kernels.library.blurred(
            math.prod(count), rows, columns, source, radius, half, target
        ):
            from scipy.ndimage import gaussian_filter  # takes a while to load

            gaussian_filter(source, (*(0 for _ in count), blur, blur), output=target)
        source = target
    return result


def as_planes(
    image: npt.ArrayLike, name: Name = "image", data_range: float | None = None
) -> npt.NDArray[np.float32]:
    """Return an image like :func:`as_float`, but as (C, H, W).

    Arithmetic on whole channels is several times as fast on this layout.

    Examples
    --------
    >>> as_planes(np.array([[[0, 0, 255]]], np.uint8)).ravel()
    array([0., 0., 1.], dtype=float32)
    """
    array = as_array(image, name)
    check_values(array, name, data_range)
    if array.ndim == 2:
        array = array[..., np.newaxis]
    planes = np.empty((array.shape[2], *array.shape[:2]), np.float32)
    for channel, plane in enumerate(planes):
        plane[...] = array[..., channel]
    _scale(planes, array.dtype, data_range)
    return planes


def _scale(values: npt.NDArray[np.float32], dtype: np.dtype[Any], data_range: float | None) -> None:
    """Divide values by the white of their original dtype, or by `data_range`, in place."""
    if np.issubdtype(dtype, np.integer):
        values *= np.float32(1.0 / (data_range or np.iinfo(dtype).max))
    elif np.issubdtype(dtype, np.floating) and data_range is not None and data_range != 1:
        values /= np.float32(data_range)


def check_values(array: Image, name: Name = "image", data_range: float | None = None) -> None:
    """Refuse an image whose white is not known, or whose values would overflow.

    Parameters
    ----------
    array : (H, W) or (H, W, C) array
    name : str or Term
        Name of the image in error texts.
    data_range : float, optional
        The value that counts as white, as for :func:`as_float`.

    Raises
    ------
    ImageError
        For NaN, infinite and huge values; and, without `data_range`, for integers other than uint8 and
        uint16 and for floats beyond ±2.
    OptionError
        When `data_range` is not positive, or so small or large that values divided by it leave the range of
        float32.

    Examples
    --------
    >>> check_values(np.zeros((2, 2), np.uint8))
    >>> check_values(np.zeros((2, 2), np.int16))
    Traceback (most recent call last):
        ...
    toposeam.errors.ImageError: image has dtype int16 and values up to 0; pass uint8 or uint16, or say with \
data_range= which value is white
    """
    if data_range is not None:
        check_number("data_range", data_range, _least_white(array), _MAX_WHITE)
    if array.dtype == bool:
        return
    if np.issubdtype(array.dtype, np.integer):
        if data_range is None and array.dtype not in (np.uint8, np.uint16):
            raise ImageError(
                "{array} has dtype {dtype} and values up to {largest}; pass uint8 or uint16, or "
                "say with data_range= which value is white",
                kind="white",
                dtype=str(array.dtype),
                largest=array.max(),
                array=term_of(name),
            )
        return
    low, high = float(array.min()), float(array.max())  # NaN if any is
    largest = max(-low, high) / (data_range or 1)
    if not math.isfinite(low + high):
        raise ImageError(
            "{array} has NaN or infinite values; replace them, or exclude those pixels with a mask",
            kind="not finite",
            array=term_of(name),
        )
    if largest > MAX_FLOAT or max(-low, high) > _MAX_WHITE:
        raise ImageError(
            "{array} has values beyond ±{limit:g}; scale its range to [0, 1]",
            kind="white",
            limit=MAX_FLOAT if largest > MAX_FLOAT else _MAX_WHITE,
            array=term_of(name),
        )
    if data_range is None and largest > _MAX_UNSCALED_FLOAT:
        raise ImageError(
            "{array} is of floats up to {largest:g}, where 1 counts as white; say with "
            "data_range= which value does (255? 1, for a wide range?)",
            kind="white",
            largest=largest,
            array=term_of(name),
        )


def _least_white(array: Image) -> float:
    """Return the least `data_range` that an array allows: divided by less, its integers become too large."""
    if not np.issubdtype(array.dtype, np.integer):
        return 1 / _MAX_WHITE
    if array.dtype.itemsize <= 2:
        return float(np.iinfo(array.dtype).max) / MAX_FLOAT
    return max(abs(float(array.min())), abs(float(array.max())), 1 / _MAX_WHITE) / MAX_FLOAT


def full_scale(dtype: np.dtype[Any]) -> Any:
    """Return the value of white, and of opaque, in a dtype: the largest integer, or 1.0."""
    return dtype.type(np.iinfo(dtype).max if np.issubdtype(dtype, np.integer) else 1)


def in_dtype(values: npt.NDArray[np.floating[Any]], dtype: np.dtype[Any]) -> npt.NDArray[Any]:
    """Convert computed values to a dtype; for integers they are rounded and clipped to its limits.

    Examples
    --------
    >>> in_dtype(np.array([-3.0, 1.5, 2.5, 400.0]), np.dtype(np.uint8)).tolist()
    [0, 2, 2, 255]
    >>> in_dtype(np.float32([-3.0, 3e9]), np.dtype(np.int32)).tolist()
    [-3, 2147483647]
    """
    if np.issubdtype(dtype, np.integer):
        limits = np.iinfo(dtype)
        values = np.rint(values)
        np.clip(values, limits.min, limits.max, out=values)
        if dtype.itemsize > 2:  # a float may not hold the largest integer exactly; the next float overflows
            full = values >= limits.max
            return np.where(full, dtype.type(limits.max), np.where(full, 0, values).astype(dtype))
    return values.astype(dtype, copy=False)


def as_mask(mask: npt.ArrayLike, shape: tuple[int, ...], name: Name) -> Mask:
    """Return a mask as a bool array of the given shape, (H, W) or (D, H, W), True where it is not zero.

    Raises
    ------
    ImageError
        When the shape differs, and for masked arrays.
    """
    if is_masked(mask):
        raise ImageError(
            "{array} is a masked array; pass {array}.filled(0)", kind="array", array=term_of(name)
        )
    try:
        array = np.asarray(mask)
    except ValueError as error:
        raise ImageError(
            "{array} is no array ({reason}); pass one value per {unit}",
            kind="array",
            reason=str(error),
            unit=unit_of(shape),
            array=term_of(name),
        ) from error
    check_shape(array, shape, name)
    return array if array.dtype == bool else array != 0


def box_of(mask: Mask, reach: int = 0) -> tuple[slice, slice]:
    """Return the bounding rows and columns of a non-empty mask, widened by `reach` px within the image.

    Examples
    --------
    >>> box_of(np.eye(9)[:5] > 0, 1)
    (slice(0, 5, None), slice(0, 6, None))
    """
    sides = []
    for axis in (1, 0):
        line = np.flatnonzero(mask.any(axis=axis))
        sides.append(
            slice(max(int(line[0]) - reach, 0), min(int(line[-1]) + 1 + reach, mask.shape[1 - axis]))
        )
    return sides[0], sides[1]


def check_shape(array: npt.NDArray[Any], shape: tuple[int, ...], name: Name) -> None:
    """Refuse an array that does not have one value per pixel of (H, W), or per voxel of (D, H, W).

    Raises
    ------
    ImageError
    """
    if array.shape != shape:
        raise ImageError(
            "{array} has shape {shape!s}, the {whole} have {expected!s}; pass one value per {unit}",
            kind="shape",
            shape=array.shape,
            whole="volumes" if len(shape) == 3 else "images",
            expected=shape,
            unit=unit_of(shape),
            array=term_of(name),
        )


def unit_of(shape: tuple[int, ...]) -> str:
    """Return the noun for an element of (H, W), "pixel", or of (D, H, W), "voxel"."""
    return "voxel" if len(shape) == 3 else "pixel"


def widen(
    a: npt.NDArray[np.float32], b: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return two (H, W, C) images with the same number of channels; a single channel is repeated.

    Raises
    ------
    ImageError
        When both have several channels, but different numbers of them.
    """
    ca, cb = a.shape[2], b.shape[2]
    if ca == cb:
        return a, b
    if ca == 1:
        return np.broadcast_to(a, (*a.shape[:2], cb)), b
    if cb == 1:
        return a, np.broadcast_to(b, (*b.shape[:2], ca))
    raise ImageError(
        "{a} has {channels_a} channels and {b} has {channels_b}; convert them to the same"
        " number, or one of them to gray",
        kind="channels",
        channels_a=ca,
        channels_b=cb,
    )
