"""Seams drawn over a picture."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.images import full_scale

_LINE = np.array([230, 30, 40], np.uint8)
_HALO = np.array([255, 255, 255], np.uint8)


def draw_seams(image: npt.NDArray[Any], seams: Iterable[ts.Seam]) -> npt.NDArray[np.uint8]:
    """The picture with its seams in red on a white halo, thick enough to be seen at the picture's size.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array
    seams : iterable of Seam
        On the same canvas.

    Returns
    -------
    (H, W, 3) uint8 array
    """
    drawn = to_rgb8(image)
    visited = [_pixels(line) for seam in seams for line in seam.paths]
    if not visited:
        return drawn
    column, row = np.unique(np.concatenate(visited), axis=0).T
    radius = max(0, round(min(drawn.shape[:2]) / 500))
    _stamp(drawn, row, column, radius + max(1, radius), _HALO)
    _stamp(drawn, row, column, radius, _LINE)
    return drawn


def to_rgb8(image: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """A copy of any picture as (H, W, 3) uint8."""
    top = full_scale(image.dtype)
    scaled = image if image.dtype == np.uint8 else np.clip(np.rint(image / top * 255), 0, 255).astype(np.uint8)
    if scaled.ndim == 2:
        scaled = scaled[..., np.newaxis]
    return np.array(np.broadcast_to(scaled, (*scaled.shape[:2], 3)) if scaled.shape[2] == 1 else scaled[..., :3])


def _pixels(line: ts.Polyline) -> npt.NDArray[np.intp]:
    """Column and row, (N, 2), of the pixels whose corners the line visits (one of the four around each corner, always the same one)."""
    points = line.outline
    steps = np.diff(points, axis=0)
    count = np.maximum(np.ceil(np.abs(steps).max(axis=1)).astype(int), 1)
    start = np.repeat(points[:-1], count, axis=0)
    share = np.concatenate([np.arange(n) / n for n in count])
    dense = np.vstack([start + np.repeat(steps, count, axis=0) * share[:, np.newaxis], points[-1:]])
    pixels: npt.NDArray[np.intp] = np.floor(dense).astype(np.intp)
    return pixels


def _stamp(
    drawn: npt.NDArray[np.uint8], row: npt.NDArray[np.intp], column: npt.NDArray[np.intp], radius: int, colour: npt.NDArray[np.uint8]
) -> None:
    """Colour every pixel of the picture that is within a radius of the given ones."""
    height, width = drawn.shape[:2]
    # A corner on the lower or right border of the picture has its pixel beyond.
    row, column = np.minimum(row, height - 1), np.minimum(column, width - 1)
    for down in range(-radius, radius + 1):
        for right in range(-radius, radius + 1):
            if down**2 + right**2 <= radius**2:
                drawn[np.clip(row + down, 0, height - 1), np.clip(column + right, 0, width - 1)] = colour
