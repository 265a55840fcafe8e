"""A joined picture at reduced size, laid from its pictures without a seam: gray, and where they show."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from toposeam.arrays import Floats32, Mask
from toposeam.images import full_scale
from toposeam.layers.canvas.layer import Box, Layer
from toposeam.layers.canvas.transforms import ReducedTransform, Transform
from toposeam.layers.canvas.warping import coordinates, inside

#: Longer side, px.
_SIDE = 512
#: Distance from the border of a picture that counts as near, px.
_EDGE = 3.0
#: Values of a picture that are reduced at once.
_AT_ONCE = 1 << 24


@dataclass(frozen=True, slots=True, eq=False)
class Overview:
    """A canvas at reduced size."""

    #: (H, W) gray of full scale 1; where nothing shows, that of the nearest pixel that does.
    gray: Floats32
    #: (H, W), where some picture is opaque.
    cover: Mask
    #: (H, W), near the border of a picture.
    edges: Mask
    #: px of the canvas per px, and x and y of the upper left corner on the canvas in px of the overview.
    scale: float
    at: tuple[int, int]


def overview(
    layers: Sequence[Layer], transforms: Sequence[Transform], whole: Box, wrap: int | None
) -> Overview:
    """Lay reduced pictures on a reduced canvas; each fades towards its own border.

    Parameters
    ----------
    layers : sequence of Layer
        Where they lie is ignored.
    transforms : sequence of Transform
        From their pixels to the canvas.
    whole : Box
        What they fill of the canvas.
    wrap : int, optional
        Width of a round canvas, px, which is that of `whole`.
    """
    scale = max(1.0, max(whole.shape) / _SIDE)
    if wrap is not None:
        scale = wrap / round(wrap / scale)
    top, left = math.floor(whole.top / scale), math.floor(whole.left / scale)
    bottom, right = math.ceil(whole.bottom / scale), math.ceil(whole.right / scale)
    if wrap is not None:
        right = left + round(wrap / scale)
    box = Box(top, left, bottom, right)
    total, weight = np.zeros(box.shape, np.float32), np.zeros(box.shape, np.float32)
    cover, edges = np.zeros(box.shape, bool), np.zeros(box.shape, bool)
    turns = (0,) if wrap is None else (-box.shape[1], 0, box.shape[1])
    for layer, transform in zip(layers, transforms, strict=True):
        height, width = layer.image.shape[:2]
        factor = max(1, int(scale))
        small, opaque = _reduced(layer, factor)
        rows, columns = small.shape
        reduced = ReducedTransform(transform, scale, (width / columns, height / rows))
        for turn in turns:
            at = coordinates(reduced, box.moved(0, turn))
            here = inside(at, (columns, rows))
            if not here.any():
                continue
            x, y = at[here].T
            own = np.minimum(np.minimum(x, columns - 1 - x), np.minimum(y, rows - 1 - y)) + 1
            edges[here] |= own < _EDGE
            nearest = np.rint(y).astype(np.intp), np.rint(x).astype(np.intp)
            own = np.where(opaque[nearest], own, 1e-3)
            total[here] += own * scipy.ndimage.map_coordinates(small, (y, x), order=1, mode="nearest")
            weight[here] += own
            cover[here] |= opaque[nearest]
    gray: Floats32 = np.asarray(total / np.maximum(weight, 1e-6), np.float32)
    return Overview(closed(gray, cover) if cover.any() else gray, cover, edges, scale, (left, top))


def closed(values: Floats32, known: Mask) -> Floats32:
    """Return values that are continued by the nearest known ones."""
    nearest = scipy.ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(values[tuple(nearest)])


def _reduced(layer: Layer, factor: int) -> tuple[Floats32, Mask]:
    """Return the gray of a layer by squares of pixels, and which of them are opaque."""
    height, width = layer.image.shape[:2]
    across, down = max(1, width // factor), max(1, height // factor)
    wide, tall = min(factor, width), min(factor, height)
    gray, opaque = np.zeros((down, across), np.float32), np.ones((down, across), bool)
    mask = None if layer.mask is None else np.asarray(layer.mask)
    step = max(1, _AT_ONCE // (width * factor))
    for first in range(0, down, step):
        last = min(first + step, down)
        part = slice(first * tall, last * tall), slice(0, across * wide)
        pixels = np.asarray(layer.image[part])
        kind = np.float32 if pixels.dtype.kind == "f" else np.uint32
        lines = pixels.reshape(last - first, tall, -1).sum(axis=1, dtype=kind)
        squares = lines.reshape(last - first, across, -1)
        count = tall * squares.shape[2]
        gray[first:last] = squares.sum(axis=2) / np.float32(count * layer.white)
        for values, least in ((layer.alpha, full_scale(layer.image.dtype)), (mask, True)):
            if values is not None:
                own = np.asarray(values[part]).reshape(last - first, tall, across, wide)
                opaque[first:last] &= own.min(axis=(1, 3)) >= least
    return (gray if opaque.all() or not opaque.any() else closed(gray, opaque)), opaque
