"""Strokes between the canvas that the page shows and the pixels of the picture that they were painted on."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

import toposeam as ts
from toposeam.arrays import Floats, Mask
from toposeam.layers.canvas.transforms import NOWHERE, Transform

#: Points that are farther away than this were not seen by the picture, px.
_FAR = abs(NOWHERE) / 10
#: A blob is covered by at most so many discs, of at least this radius, px.
_MOST_DISCS, _LEAST_RADIUS = 60, 2.0


@dataclass(frozen=True, slots=True, eq=False)
class CanvasTransform:
    """A transform to a canvas that begins at its own upper left pixel."""

    whole: Transform
    #: (x, y) of that pixel in the coordinates of the layers.
    origin: tuple[int, int]

    def to_canvas(self, points: Floats) -> Floats:
        """Map (..., 2) points of the picture; NaN where the canvas does not show them."""
        return np.asarray(self.whole.to_canvas(points) - self.origin)

    def to_picture(self, points: Floats) -> Floats:
        """Map (..., 2) points of the canvas; far outside where the picture does not show them."""
        return self.whole.to_picture(points + np.array(self.origin, float))


def on_picture(
    points: Floats, radius: float, layer: int, transform: Transform, kind: Any = "show"
) -> ts.layers.Stroke | None:
    """Return a stroke of the canvas as one of a picture; None where the picture sees none of its points.

    Parameters
    ----------
    points : (n, 2) float array
        x and y on the canvas, px, counted from the corner of its upper left pixel.
    radius : float
        px of the canvas.
    """
    centres = points - 0.5
    at = transform.to_picture(centres)
    aside = transform.to_picture(centres + np.array([radius, 0.0]))
    seen = (np.abs(at) < _FAR).all(axis=1) & (np.abs(aside) < _FAR).all(axis=1)
    if not seen.any():
        return None
    there = float(np.median(np.linalg.norm(aside[seen] - at[seen], axis=1)))
    return ts.layers.Stroke(points=at[seen] + 0.5, radius=max(there, 0.5), layer=layer, kind=kind)


def on_canvas(stroke: ts.layers.Stroke, transform: Transform) -> tuple[Floats, float]:
    """Return the points of a stroke on the canvas, and its radius there, px."""
    centres = np.asarray(stroke.points, float) - 0.5
    at, aside = transform.to_canvas(centres), transform.to_canvas(centres + np.array([stroke.radius, 0.0]))
    seen = np.isfinite(at).all(axis=1) & np.isfinite(aside).all(axis=1)
    if not seen.any():
        return np.zeros((0, 2)), 0.0
    return at[seen] + 0.5, float(np.median(np.linalg.norm(aside[seen] - at[seen], axis=1)))


def discs_of(mask: Mask) -> list[tuple[float, float, float]]:
    """Cover a mask by discs that lie inside it: x, y and radius of each, px from its upper left corner."""
    depth = scipy.ndimage.distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    rows, columns = np.indices(mask.shape)
    left, found = np.where(mask, depth, 0), list[tuple[float, float, float]]()
    enough = 0.03 * np.count_nonzero(mask)
    while len(found) < _MOST_DISCS:
        y, x = np.unravel_index(int(np.argmax(left)), mask.shape)
        radius = float(depth[y, x])
        if left[y, x] <= 0 or (radius < _LEAST_RADIUS and found):
            break
        found.append((float(x) + 0.5, float(y) + 0.5, radius))
        left[(rows - y) ** 2 + (columns - x) ** 2 < radius**2] = 0
        if np.count_nonzero(left) < enough:
            break
    return found


def without(strokes: Sequence[ts.layers.Stroke], rubbed: Sequence[Mask]) -> list[ts.layers.Stroke]:
    """Return what is left of strokes; `rubbed` says per stroke, (n,) bool, which of its points are gone."""
    left: list[ts.layers.Stroke] = []
    for stroke, gone in zip(strokes, rubbed, strict=True):
        if not gone.any():
            left.append(stroke)
            continue
        runs = np.split(np.arange(len(gone)), np.flatnonzero(np.diff(gone.astype(np.int8))) + 1)
        left += [
            dataclasses.replace(stroke, points=stroke.points[run])
            for run in runs
            if len(run) and not gone[run[0]]
        ]
    return left
