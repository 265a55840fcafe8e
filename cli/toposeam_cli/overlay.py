"""The seam drawn over a picture."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

import toposeam as ts

_LINE = np.array([230, 30, 40], np.uint8)
_HALO = np.array([255, 255, 255], np.uint8)


def draw_seam(image: npt.NDArray[Any], seam: ts.Seam) -> npt.NDArray[np.uint8]:
    """The picture with the seam in red on a white halo, thick enough to be seen at the picture's size.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array
    seam : Seam
        On the same canvas.

    Returns
    -------
    (H, W, 3) uint8 array
    """
    height, width = image.shape[:2]
    drawn = to_rgb8(image)
    beside = np.zeros((height, width), bool)
    for line in seam.paths:
        _mark(line, beside)
    radius = max(0, round(min(height, width) / 500))
    core = ndimage.distance_transform_edt(~beside) <= radius
    halo = ndimage.distance_transform_edt(~core) <= max(1, radius)
    drawn[halo] = _HALO
    drawn[core] = _LINE
    return drawn


def to_rgb8(image: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """A copy of any picture as (H, W, 3) uint8."""
    top = np.iinfo(image.dtype).max if np.issubdtype(image.dtype, np.integer) else 1.0
    scaled = image if image.dtype == np.uint8 else np.clip(np.rint(image / top * 255), 0, 255).astype(np.uint8)
    if scaled.ndim == 2:
        scaled = scaled[..., np.newaxis]
    return np.array(np.broadcast_to(scaled, (*scaled.shape[:2], 3)) if scaled.shape[2] == 1 else scaled[..., :3])


def _mark(line: ts.Polyline, beside: npt.NDArray[np.bool_]) -> None:
    """Mark the pixels whose corners the line visits (one pixel of the four around each corner, always the same one)."""
    points = line.points if not line.closed else np.vstack([line.points, line.points[:1]])
    steps = np.diff(points, axis=0)
    count = np.maximum(np.ceil(np.abs(steps).max(axis=1)).astype(int), 1)
    start = np.repeat(points[:-1], count, axis=0)
    share = np.concatenate([np.arange(n) / n for n in count]) if len(count) else np.zeros(0)
    dense = np.vstack([start + np.repeat(steps, count, axis=0) * share[:, np.newaxis], points[-1:]])
    column = np.clip(np.floor(dense[:, 0]).astype(int), 0, beside.shape[1] - 1)
    row = np.clip(np.floor(dense[:, 1]).astype(int), 0, beside.shape[0] - 1)
    beside[row, column] = True
