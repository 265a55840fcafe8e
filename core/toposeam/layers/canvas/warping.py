"""Pictures warped onto the canvas: once, from their own pixels, block by block."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy
from scipy.sparse import csr_array

from toposeam.errors import OptionError
from toposeam.images import Mask, check_values, full_scale, in_dtype
from toposeam.layers.canvas.layer import Box, Layer
from toposeam.layers.canvas.transforms import Floats, Transform, is_move, reach

#: Side of the blocks, px; beyond a block's own pixels a spline needs so many (its coefficients fall to a
#: thousandth over five).
_BLOCK, _MARGIN = 256, 12
#: Points whose weights are held at a time.
_POINTS = 1 << 12
#: Coordinates are computed at every so many px and between them linearly.
_STEP = 8

Complex = npt.NDArray[np.complex128]


def warped_box(layer: Layer, transform: Transform) -> Box:
    """The rectangle of the canvas that a warped picture fills.

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
    """(h, w, 2) x and y in the picture of the canvas pixels of a box."""
    rows, columns = box.shape
    down, across = (np.minimum(np.arange(-(-side // _STEP) + 1) * _STEP, side - 1) for side in box.shape)
    coarse = transform.to_picture(np.stack(np.meshgrid(across + box.left, down + box.top), axis=-1) + 0.0)
    points = coarse.view(np.complex128)[..., 0]  # one number each
    return _between(_between(points.T, down, rows).T, across, columns).view(np.float64).reshape(*box.shape, 2)


def _between(values: Complex, knots: npt.NDArray[np.intp], count: int) -> Complex:
    """(n, count) linear interpolation of (n, K) values at knots."""
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


def warped(layer: Layer, transform: Transform) -> Layer:
    """Warp a picture onto the canvas by cubic splines.

    Parameters
    ----------
    layer : Layer
        Where it lies is ignored.
    transform : Transform
        From its pixels to the canvas.

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
            image[here][shown] = resampled(planes, layer.white, at[shown])
            rows, columns = (np.rint(at[shown][:, axis]).astype(np.intp) for axis in (1, 0))
            for name, mask in masks.items():
                warped_masks[name][here][shown] = np.asarray(mask)[rows, columns]
            opacity[here] = shown
            if layer.alpha is not None:
                opacity[here][shown] = interpolated(np.asarray(layer.alpha), at[shown]) / full
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
    """Where (..., 2) coordinates x and y lie on a picture of that width and height."""
    edge = 1e-6
    x, y = at[..., 0], at[..., 1]
    return np.asarray((x > -edge) & (y > -edge) & (x < size[0] - 1 + edge) & (y < size[1] - 1 + edge))


def resampled(planes: npt.NDArray[Any], white: float, points: Floats) -> npt.NDArray[Any]:
    """(M, C) values of an (H, W, C) picture at (M, 2) points x and y, by cubic splines, in its dtype.

    Parameters
    ----------
    planes : (H, W, C) array
    white : float
        Where integers end.
    points : (M, 2) float array
        At least one.
    """
    height, width = planes.shape[:2]
    left, top = np.floor(points.min(axis=0)).astype(int) - _MARGIN
    right, bottom = np.floor(points.max(axis=0)).astype(int) + _MARGIN + 1
    part = planes[max(top, 0) : bottom, max(left, 0) : right].astype(np.float32)
    beyond = (max(-top, 0), max(bottom - height, 0)), (max(-left, 0), max(right - width, 0)), (0, 0)
    if any(map(any, beyond)):
        part = np.pad(part, beyond, mode="reflect")
    values = _splined(part, points - [left, top])
    if planes.dtype.kind == "b":
        return np.asarray(values > 0.5)
    if np.issubdtype(planes.dtype, np.integer):
        values = np.clip(values, 0, white)
    return in_dtype(values, planes.dtype)


def _splined(planes: npt.NDArray[np.float32], points: Floats) -> npt.NDArray[np.float32]:
    """(M, C) values of the cubic spline through (h, w, C) planes at (M, 2) points x and y, some pixels from
    the border.

    The value at a point is a sum of 4 × 4 coefficients, with the same weights in all channels; those of many
    points are a sparse matrix. ``benchmarks/warping.py`` has scipy.ndimage.map_coordinates beside it.
    """
    height, width, channels = planes.shape
    coefficients = [
        scipy.ndimage.spline_filter(planes[..., channel], 3, np.float32, mode="mirror").ravel()
        for channel in range(channels)
    ]
    result = np.empty((len(points), channels), np.float32)
    taps = (np.arange(4, dtype=np.int32)[:, np.newaxis] * width + np.arange(4, dtype=np.int32)).ravel()
    for start in range(0, len(points), _POINTS):
        whole = np.floor(points[start : start + _POINTS])
        weights = _cubic_weights((points[start : start + _POINTS] - whole).astype(np.float32))
        x, y = whole.T.astype(np.int32) - 1
        size = len(x)
        matrix = csr_array(
            (
                np.einsum("mi,mj->mij", weights[:, 1], weights[:, 0]).ravel(),
                ((x + y * np.int32(width))[:, np.newaxis] + taps).ravel(),
                np.arange(0, 16 * size + 1, 16, dtype=np.int32),
            ),
            shape=(size, height * width),
        )
        for channel, values in enumerate(coefficients):
            result[start : start + size, channel] = matrix @ values
    return result


def _cubic_weights(fraction: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(..., 4) values of the cubic B-spline at distances 1 + t, t, 1 - t, 2 - t."""
    rest = 1 - fraction
    weights = np.empty((*fraction.shape, 4), np.float32)
    weights[..., 0], weights[..., 3] = rest * rest * rest / 6, fraction * fraction * fraction / 6
    for column, t in ((1, fraction), (2, rest)):
        weights[..., column] = (t * t * (t - 2)) / 2 + np.float32(2 / 3)
    return weights


def interpolated(plane: npt.NDArray[Any], points: Floats) -> npt.NDArray[np.float32]:
    """(M,) values of a plane at (M, 2) points x and y, linearly; beyond an end, its values."""
    result: npt.NDArray[np.float32] = scipy.ndimage.map_coordinates(
        plane, points[:, ::-1].T, order=1, mode="nearest", output=np.float32
    )
    return result
