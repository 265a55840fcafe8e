"""Pictures turned and scaled on their way to the canvas."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.checks import check_kind, check_number, check_numbers
from toposeam.errors import OptionError
from toposeam.images import Mask, check_values, full_scale, in_dtype
from toposeam.layers.canvas.layer import Layer

Floats = npt.NDArray[np.float64]


def placed(layer: Layer, *, at: tuple[float, float], turn: float = 0.0, scale: float = 1.0) -> Layer:
    """The layer at a place, resampled by cubic splines if it is turned or scaled.

    Parameters
    ----------
    layer : Layer
    at : (float, float)
        x and y of the centre of its upper left pixel on the canvas, px. Rounded where nothing is turned or
        scaled: whole pixels are not resampled.
    turn : float
        Degrees clockwise, round that pixel.
    scale : float
        Factor.

    Returns
    -------
    Layer
        Where it was resampled, transparent beyond the edges of what it was.

    Raises
    ------
    ImageError, OptionError
        For numbers out of range; where a picture that is turned or scaled needs its `data_range`.

    Examples
    --------
    >>> placed(Layer(np.zeros((20, 30))), at=(4.2, -1.7))
    Layer('layer', 30 × 20 px at 4,-2, float64)
    >>> placed(Layer(np.zeros((20, 30))), at=(0, 0), scale=1.5)
    Layer('layer', 45 × 30 px at 0,0, float64)
    """
    check_kind("layer", layer, Layer, "a Layer")
    place = check_numbers("at", at)
    if place.shape != (2,):
        raise OptionError(f"at is of shape {place.shape}; pass two numbers, x and y in px")
    u, v = place.tolist()
    check_number("turn", turn, -180, 180)
    check_number("scale", scale, 0, above=True)
    if turn == 0 and scale == 1:
        return dataclasses.replace(layer, at=(round(u), round(v)))
    a, b = scale * math.cos(math.radians(turn)), scale * math.sin(math.radians(turn))
    height, width = layer.image.shape[:2]
    x, y = np.array([0, width - 1, 0, width - 1]), np.array([0, 0, height - 1, height - 1])
    across, down = a * x - b * y + u, b * x + a * y + v
    left, top = math.floor(across.min()), math.floor(down.min())
    shape = math.ceil(down.max()) + 1 - top, math.ceil(across.max()) + 1 - left
    inverse = np.array([[a, -b], [b, a]]) / (a * a + b * b)  # takes (y, x) of the canvas to (y, x) of it
    base = inverse @ np.array([top - v, left - u])
    inside = _inside(inverse, base, shape, (height, width))
    dtype = layer.image.dtype
    whole = np.asarray(layer.image)
    check_values(whole, layer.title, layer.data_range)
    planes = whole.reshape(height, width, -1)
    image = np.zeros((*shape, planes.shape[2]), dtype)
    for channel in range(planes.shape[2]):
        values = _warped(planes[..., channel], inverse, base, shape, 3)
        if np.issubdtype(dtype, np.integer):
            values = np.clip(values, 0, layer.white)
        image[..., channel] = in_dtype(np.where(inside, values, np.float32(0)), dtype)
    opacity = inside.astype(np.float32)
    if layer.alpha is not None:
        opacity *= np.clip(
            _warped(np.asarray(layer.alpha), inverse, base, shape, 1) / float(full_scale(dtype)), 0, 1
        )
    alpha = in_dtype(opacity * float(full_scale(dtype)), dtype)
    mask, keep = (
        None if given is None else inside & (_warped(np.asarray(given), inverse, base, shape, 0) > 0.5)
        for given in (layer.mask, layer.keep)
    )
    return Layer(
        image if layer.image.ndim == 3 else image[..., 0],
        alpha=alpha,
        at=(left, top),
        name=layer.name,
        mask=mask,
        keep=keep,
        data_range=layer.data_range,
    )


def _inside(inverse: Floats, base: Floats, shape: tuple[int, int], size: tuple[int, int]) -> Mask:
    """(h, w) bool: where the turned picture has pixels."""
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    result: Mask = np.ones(shape, bool)
    for axis in (0, 1):
        there = inverse[axis, 0] * rows + inverse[axis, 1] * columns + base[axis]
        result &= (there > -1e-6) & (there < size[axis] - 1 + 1e-6)
    return result


def _warped(
    plane: npt.NDArray[Any], inverse: Floats, base: Floats, shape: tuple[int, int], order: int
) -> npt.NDArray[np.float32]:
    result: npt.NDArray[np.float32] = scipy.ndimage.affine_transform(
        plane.astype(np.float32), inverse, base, shape, order=order, mode="nearest"
    )
    return result
