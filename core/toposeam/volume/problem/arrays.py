"""Conversion and checks of volume and clip arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Volume
from toposeam.checks import check_whole, is_masked
from toposeam.errors import ImageError, OptionError, Term
from toposeam.images import as_float


def as_volume(volume: Any, name: str, channel_axis: int | None = None) -> Volume:
    """Return voxels with a channel axis at the end, unchanged.

    Parameters
    ----------
    volume : (D, H, W) or (D, H, W, C) array_like
    name : str
        Name of the volume in error texts.
    channel_axis : int, optional
        Axis of the channels in a four-dimensional array; last by default.

    Returns
    -------
    (D, H, W, C) array of bool, integers or floats

    Raises
    ------
    ImageError
        For other shapes, empty or masked arrays, complex or object dtypes.
    OptionError
        For an axis that the array does not have, or that leaves fewer than three.

    Examples
    --------
    >>> as_volume(np.zeros((3, 4, 5, 6)), "a", channel_axis=0).shape
    (4, 5, 6, 3)
    """
    if is_masked(volume):
        raise ImageError(
            "{array} is a masked array; pass {array}.filled(0), and where it has voxels as a mask",
            kind="array",
            array=Term(name),
        )
    try:
        array = np.asarray(volume)
    except ValueError as error:
        raise ImageError(
            "{array} is no array ({reason}); pass (D, H, W) or (D, H, W, C)",
            kind="array",
            reason=str(error),
            array=Term(name),
        ) from error
    if array.dtype.kind not in "biuf":
        raise ImageError(
            "{array} is of type {type} and dtype {dtype}; pass integers or floats",
            kind="dtype",
            type=type(volume).__name__,
            dtype=str(array.dtype),
            array=Term(name),
        )
    if array.ndim not in (3, 4) or 0 in array.shape:
        raise ImageError(
            "{array} has shape {shape!s}; pass a non-empty (D, H, W) or (D, H, W, C) array",
            kind="shape",
            shape=array.shape,
            array=Term(name),
        )
    if channel_axis is not None:
        check_whole("channel_axis", channel_axis, -array.ndim, array.ndim - 1)
        if array.ndim == 3:
            raise OptionError(
                "{parameter} is {value}, but {array} has shape {shape!s}, without channels; leave it out",
                kind="shape",
                parameter=Term("channel_axis"),
                value=channel_axis,
                shape=array.shape,
                array=Term(name),
            )
        return np.moveaxis(array, channel_axis, -1)
    return array[..., np.newaxis] if array.ndim == 3 else array


def as_shares(volume: Volume, name: str, data_range: float | None) -> npt.NDArray[np.float32]:
    """Return a (D, H, W, C) array as float32 shares of white; see :func:`toposeam.images.as_float`."""
    flat = volume.reshape(volume.shape[0] * volume.shape[1], *volume.shape[2:])
    # An array of at most four rows would be taken as (C, H, W) and refused.
    tall = flat if len(flat) > 4 else np.concatenate([flat, *[flat[:1]] * 4])
    return as_float(tall, name, data_range)[: len(flat)].reshape(volume.shape)
