"""Warp pictures onto the canvas: once, from their own pixels, block by block."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from toposeam import _kernels
from toposeam.arrays import Complexes, Floats, Mask
from toposeam.errors import OptionError
from toposeam.images import check_values, full_scale, in_dtype
from toposeam.layers.canvas.layer import Box, Layer
from toposeam.layers.canvas.transforms import Transform, is_move, reach

#: Side of the blocks, px, and the pixels that a spline needs beyond a block's own: its coefficients fall to a
#: thousandth over five.
_BLOCK, _MARGIN = 256, 12
#: Step at which coordinates are computed, px; between, they are interpolated linearly.
_STEP = 8


def warped_box(layer: Layer, transform: Transform) -> Box:
    """Find the rectangle of the canvas that a warped picture fills.

    Raises
    ------
    OptionError
        If the canvas shows nothing of it.
    """
    height, width = layer.image.shape[:2]
    reached = reach(transform, (width, height))
    if reached is None:
        raise OptionError(
            "the canvas shows nothing of {name}; choose another projection, as sphere",
            kind="not shown",
            name=layer.name,
        )
    (left, top), (right, bottom) = reached
    return Box(math.floor(top), math.floor(left), math.ceil(bottom) + 1, math.ceil(right) + 1)


def coordinates(transform: Transform, box: Box) -> Floats:
    """Compute x and y in the picture, px, of the canvas pixels of a box: (h, w, 2)."""
    rows, columns = box.shape
    down, across = (
        np.minimum(np.arange(-(-side // _STEP) + 1) * _STEP, side - 1) for side in (rows, columns)
    )
    coarse = transform.to_picture(np.stack(np.meshgrid(across + box.left, down + box.top), axis=-1) + 0.0)
    if _kernels.library is not None:
        knots, at = np.ascontiguousarray(coarse, float), np.empty((rows, columns, 2))
        _kernels.library.between_knots(rows, columns, _STEP, len(across), knots, at)
        return at
    points = coarse.view(np.complex128)[..., 0]  # one number each
    return (
        _between(_between(points.T, down, rows).T, across, columns).view(np.float64).reshape(rows, columns, 2)
    )


def _between(values: Complexes, knots: npt.NDArray[np.intp], count: int) -> Complexes:
    """Interpolate (n, K) values at knots linearly: (n, count)."""
    change = np.zeros_like(values)
    np.subtract(values[:, 1:], values[:, :-1], out=change[:, :-1])
    change[:, :-1] /= np.maximum(np.diff(knots), 1)
    result = change[..., np.newaxis] * np.arange(_STEP)
    result += values[..., np.newaxis]
    return result.reshape(len(values), -1)[:, :count]


def on_canvas(layer: Layer, transform: Transform) -> Layer:
    """Lay a picture on the canvas: moved by whole pixels where it is only moved, and else warped."""
    if not is_move(transform):
        return warped(layer, transform)
    x, y = transform.to_canvas(np.zeros((1, 2)))[0]
    return dataclasses.replace(layer, at=(round(float(x)), round(float(y))))


def warped(layer: Layer, transform: Transform, within: Box | None = None) -> Layer:
    """Warp a picture onto the canvas by cubic splines.

    Parameters
    ----------
    layer : Layer
        Where it lies is ignored.
    transform : Transform
        From its pixels to the canvas.
    within : Box, optional
        The part of the canvas that is wanted.

    Returns
    -------
    Layer
        Transparent where the picture shows nothing; opacity is interpolated linearly, masks take the nearest
        pixel.

    Raises
    ------
    ImageError
        Where a picture needs its `data_range`.
    OptionError
        If the canvas shows nothing of it.
    """
    box = warped_box(layer, transform)
    if within is not None:
        box = box.shared(within)
    whole = np.asarray(layer.image)
    check_values(whole, layer.title, layer.data_range)
    height, width = whole.shape[:2]
    planes, dtype = whole.reshape(height, width, -1), whole.dtype
    image = np.zeros((*box.shape, planes.shape[2]), dtype)
    opacity = np.zeros(box.shape, np.float32)
    full = float(full_scale(dtype))
    masks = {name: getattr(layer, name) for name in ("mask", "keep") if getattr(layer, name) is not None}
    warped_masks = {name: np.zeros(box.shape, bool) for name in masks}
    for top in range(box.top, box.bottom, _BLOCK):
        for left in range(box.left, box.right, _BLOCK):
            part = Box(top, left, min(top + _BLOCK, box.bottom), min(left + _BLOCK, box.right))
            at, here = coordinates(transform, part), part.within(box)
            shown = inside(at, (width, height))
            if not shown.any():
                continue
            points = at.reshape(-1, 2) if (everywhere := bool(shown.all())) else at[shown]
            values = resampled(planes, layer.white, points)
            if everywhere:  # masks take a third of the time
                image[here] = values.reshape(image[here].shape)
            else:
                image[here][shown] = values
            for name, mask in masks.items():
                rows, columns = (np.rint(at[..., axis][shown]).astype(np.intp) for axis in (1, 0))
                warped_masks[name][here][shown] = np.asarray(mask)[rows, columns]
            opacity[here] = shown
            if layer.alpha is not None:
                opacity[here][shown] = interpolated(np.asarray(layer.alpha), points) / full
    opacity = np.clip(opacity, 0, 1)
    return dataclasses.replace(
        layer,
        image=image if whole.ndim == 3 else image[..., 0],
        alpha=opacity > 0.5 if dtype.kind == "b" else in_dtype(opacity * full, dtype),
        at=(box.left, box.top),
        mask=warped_masks.get("mask"),
        keep=warped_masks.get("keep"),
    )


def inside(at: Floats, size: tuple[int, int]) -> Mask:
    """Test which (..., 2) coordinates x and y lie on a picture of that width and height."""
    edge = 1e-6
    x, y = at[..., 0], at[..., 1]
    return np.asarray((x > -edge) & (y > -edge) & (x < size[0] - 1 + edge) & (y < size[1] - 1 + edge))


def resampled(planes: npt.NDArray[Any], white: float, points: Floats) -> npt.NDArray[Any]:
    """Interpolate a picture by cubic splines.

    Parameters
    ----------
    planes : (H, W, C) array
    white : float
        Greatest value of integers.
    points : (M, 2) float array
        x and y, px; at least one.

    Returns
    -------
    (M, C) array
        Of the dtype of `planes`.
    """
    x, y = points[:, 0], points[:, 1]
    left, top = (max(math.floor(each.min()) - _MARGIN, 0) for each in (x, y))
    right, bottom = (math.ceil(each.max()) + _MARGIN + 1 for each in (x, y))
    part = np.ascontiguousarray(planes[top:bottom, left:right], np.float32)
    values = _splined(part, np.ascontiguousarray(points - [left, top]))
    if planes.dtype.kind == "b":
        return np.asarray(values > 0.5)
    if np.issubdtype(planes.dtype, np.integer):
        values = np.clip(values, 0, white)
    return in_dtype(values, planes.dtype)


def _splined(part: npt.NDArray[np.float32], points: Floats) -> npt.NDArray[np.float32]:
    """Interpolate an (h, w, C) picture by cubic splines at (M, 2) points x and y, both C-contiguous."""
    height, width, channels = part.shape
    result = np.empty((len(points), channels), np.float32)
    if _kernels.library is not None:
        room = np.empty(part.shape)
        _kernels.library.spline_values(height, width, channels, part, room, len(points), points, result)
        return result
    for c in range(channels):
        scipy.ndimage.map_coordinates(part[..., c], points[:, ::-1].T, output=result[:, c], mode="mirror")
    return result


def interpolated(plane: npt.NDArray[Any], points: Floats) -> npt.NDArray[np.float32]:
    """Interpolate a plane linearly at (M, 2) points x and y; beyond an end its values go on: (M,)."""
    result: npt.NDArray[np.float32] = scipy.ndimage.map_coordinates(
        plane, points[:, ::-1].T, order=1, mode="nearest", output=np.float32
    )
    return result
