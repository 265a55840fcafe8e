"""Image arrays on the way in and out: any integer or float dtype, gray or any number of channels."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.errors import ImageError

Image = npt.NDArray[Any]
Mask = npt.NDArray[np.bool_]

#: Float images with larger values are refused: their squares would overflow.
LARGEST = 1e12


def as_float(image: npt.ArrayLike, name: str = "image") -> npt.NDArray[np.float32]:
    """The image as float32 with a channel axis, integers scaled to [0, 1].

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like
        Bool, integer or float. Floats are taken as they are (nominally in [0, 1]).
    name : str
        What the caller calls this image; used in error texts.

    Returns
    -------
    (H, W, C) float32 array

    Raises
    ------
    ImageError
        For other shapes, empty arrays, complex or object dtypes, NaN, infinite or huge values.
    """
    array = np.asarray(image)
    if array.ndim not in (2, 3) or 0 in array.shape:
        raise ImageError(f"{name} has shape {array.shape}; pass a non-empty (H, W) or (H, W, C) array")
    if array.ndim == 2:
        array = array[..., np.newaxis]
    if array.dtype == bool:
        return array.astype(np.float32)
    if np.issubdtype(array.dtype, np.integer):
        scaled = array.astype(np.float32)
        scaled *= np.float32(1.0 / np.iinfo(array.dtype).max)
        return scaled
    if not np.issubdtype(array.dtype, np.floating):
        raise ImageError(f"{name} has dtype {array.dtype}; pass integers or floats")
    result = array.astype(np.float32)
    if not np.isfinite(result).all():
        raise ImageError(f"{name} has NaN or infinite values; replace them, or exclude those pixels with a mask")
    if max(-float(result.min()), float(result.max())) > LARGEST:
        raise ImageError(f"{name} has values beyond ±{LARGEST:g}; scale its range to [0, 1]")
    return result


def full_scale(dtype: np.dtype[Any]) -> Any:
    """What counts as 1, and as opaque, in that dtype: the largest integer, or 1.0."""
    return dtype.type(np.iinfo(dtype).max if np.issubdtype(dtype, np.integer) else 1)


def as_mask(mask: npt.ArrayLike, shape: tuple[int, int], name: str) -> Mask:
    """The mask as an (H, W) bool array of the given shape, True where it is not zero.

    Raises
    ------
    ImageError
        When the shape differs.
    """
    array = np.asarray(mask)
    if array.shape != shape:
        raise ImageError(f"{name} has shape {array.shape}, the images have {shape}; pass one value per pixel")
    return array if array.dtype == bool else array != 0


def widen(a: npt.NDArray[np.float32], b: npt.NDArray[np.float32]) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Give two (H, W, C) images the same number of channels: one-channel images are repeated.

    Raises
    ------
    ImageError
        When both have several channels but not equally many.
    """
    ca, cb = a.shape[2], b.shape[2]
    if ca == cb:
        return a, b
    if ca == 1:
        return np.broadcast_to(a, (*a.shape[:2], cb)), b
    if cb == 1:
        return a, np.broadcast_to(b, (*b.shape[:2], ca))
    raise ImageError(f"a has {ca} channels and b has {cb}; convert them to the same number, or one of them to gray")
