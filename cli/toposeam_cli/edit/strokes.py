"""Strokes between the canvas that the page shows and the pixels of the picture that they were painted on."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

import toposeam as ts
from toposeam.arrays import Floats, Labels, Mask
from toposeam.layers.canvas.transforms import NOWHERE, Transform

#: Points that are farther away than this were not seen by the picture, px.
_FAR = abs(NOWHERE) / 10
#: Radius of the stroke that sends a seam elsewhere, px of the preview.
_OTHER_WAY_PX = 22.0
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


def drawn(strokes: Sequence[ts.layers.Stroke], transforms: Sequence[Transform]) -> list[dict[str, Any]]:
    """Return strokes as they lie on the canvas, for a page that draws them."""
    found = []
    for stroke in strokes:
        points, radius = on_canvas(stroke, transforms[stroke.layer])
        if len(points):
            own = {"radius": round(radius, 1), "points": np.round(points, 1).tolist()}
            found.append({"kind": stroke.kind, "layer": stroke.layer, **own})
    return found


def horizon_of(points: Floats, labels: Labels, transforms: Sequence[Transform]) -> str | None:
    """Return a (2, 2) line of the canvas as ``--horizon`` takes it, on the picture that shows in its middle;
    None where none does, or it does not see the ends.
    """
    (x, y), (height, width) = points.mean(axis=0), labels.shape
    layer = int(labels[int(y), int(x)]) if 0 <= x < width and 0 <= y < height else -1
    line = on_picture(points, 1.0, layer, transforms[layer]) if layer >= 0 else None
    if line is None or len(line.points) < 2:
        return None
    return f"{layer}=" + ",".join(f"{value:.3f}" for value in (line.points - 0.5).ravel())


def other_way(x: float, y: float, labels: Labels) -> list[dict[str, Any]]:
    """Return a stroke that keeps seams away from a place of the canvas."""
    layer = int(labels[min(int(y), labels.shape[0] - 1), min(int(x), labels.shape[1] - 1)])
    return [{"kind": "away", "layer": max(layer, 0), "radius": _OTHER_WAY_PX, "points": [[x, y]]}]


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


def under(stroke: ts.layers.Stroke, transform: CanvasTransform, points: Floats, radius: float) -> Mask:
    """(n,) bool: which points of a stroke lie under a stroke of the canvas."""
    own, width = on_canvas(stroke, transform)
    if len(own) != len(stroke.points):
        return np.zeros(len(stroke.points), bool)
    distance = np.linalg.norm(own[:, np.newaxis] - points[np.newaxis], axis=2).min(axis=1)
    return np.asarray(distance < radius + width / 2)


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
