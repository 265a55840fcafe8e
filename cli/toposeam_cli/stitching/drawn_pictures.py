"""Pictures beside the joined one, drawn where they are read: who shows where, and the seams over it."""

from __future__ import annotations

from typing import Any

import numpy as np

import toposeam as ts
from toposeam.arrays import Bytes, Floats
from toposeam.images import Windows, full_scale
from toposeam.layers.canvas.tile_map import new_map


class LabelPicture(Windows):
    """The label map in grays: black for the first layer to white for the last, black where none shows."""

    def __init__(self, composed: ts.layers.Composition) -> None:
        super().__init__(composed.shape, np.uint8)
        self._composed = composed
        grays = np.rint(np.linspace(0, 255, len(composed.names))).astype(np.uint8)
        self._grays = np.append(grays, np.uint8(0))

    def read(self, rows: slice, columns: slice) -> Bytes:
        """Return some rows and columns."""
        found: Bytes = self._grays[self._composed.labels(rows, columns)]
        return found


class Overlay(Windows):
    """A picture with its seams in red, bordered in white."""

    def __init__(self, composed: ts.layers.Composition, pixels: Any) -> None:
        super().__init__((*pixels.shape[:2], 3), np.uint8)
        self._pixels = pixels
        self._marks = _marks(composed)

    def read(self, rows: slice, columns: slice) -> Bytes:
        """Return some rows and columns."""
        part, marks = np.asarray(self._pixels[rows, columns]), self._marks[rows, columns]
        planes = part if part.ndim == 3 else part[..., np.newaxis]
        share = planes / float(full_scale(planes.dtype)) * 255
        drawn = np.repeat(share, 3 // planes.shape[2], axis=2).clip(0, 255).astype(np.uint8)
        drawn[marks == 1], drawn[marks == 2] = 255, (230, 30, 40)
        return drawn


def _marks(composed: ts.layers.Composition) -> Bytes:
    """(H, W) map: 2 on seams, 1 on their border."""
    height, width = composed.shape
    radius = max(1, round(min(composed.shape) / 500))
    corner = np.array([composed.view.left, composed.view.top])
    marks: Bytes = new_map(composed.shape, 0, np.uint8)
    for value, reach in ((1, 2 * radius), (2, radius)):
        for seam in composed.outlines:
            for path in seam.paths:
                for x, y in (np.floor(_each_pixel(path.outline)).astype(int) - corner).tolist():
                    rows = slice(max(y - reach, 0), min(y + reach + 1, height))
                    columns = slice(max(x - reach, 0), min(x + reach + 1, width))
                    if rows.start < rows.stop and columns.start < columns.stop:
                        marks[rows, columns] = value
    return marks


def _each_pixel(outline: Floats) -> Floats:
    """(K, 2): points of a line at most 1 px apart in x and in y, its ends among them."""
    along = np.append(0.0, np.cumsum(np.abs(np.diff(outline, axis=0)).max(axis=1)))
    at = np.append(np.arange(along[-1]), along[-1])
    return np.column_stack([np.interp(at, along, outline[:, axis]) for axis in (0, 1)])
