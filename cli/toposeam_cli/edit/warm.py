"""Stands in for what core will offer for strokes, with the same names, until it does."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

import toposeam as ts
from toposeam.arrays import Floats, Labels, Mask
from toposeam.layers.canvas.layer import Box, cut
from toposeam.layers.canvas.transforms import Transform


@dataclass(frozen=True, slots=True, eq=False)
class Stroke:
    """A stroke on a picture: points, px from its corner, and what it asks for."""

    points: Floats
    radius: float
    layer: int
    kind: str = "show"


def _raster(stroke: Stroke, transform: Transform, shape: tuple[int, int]) -> Mask:
    centres = stroke.points - 0.5
    points = transform.to_canvas(centres) + 0.5
    aside = transform.to_canvas(centres + np.array([stroke.radius, 0])) + 0.5
    radius = float(np.median(np.linalg.norm(aside - points, axis=1)))
    picture = Image.new("1", (shape[1], shape[0]))
    draw = ImageDraw.Draw(picture)
    if len(points) > 1:
        draw.line([tuple(p) for p in points], fill=1, width=max(1, round(2 * radius)), joint="curve")
    for x, y in points:
        draw.ellipse([x - radius, y - radius, x + radius, y + radius], fill=1)
    return np.asarray(picture)


def apply_strokes(
    labelling: ts.layers.Labelling, strokes: Sequence[Stroke], transforms: Sequence[Transform]
) -> tuple[ts.layers.Labelling, tuple[int, ...]]:
    """Return a problem in which strokes hold, and the numbers of those without pixels."""
    shape, count = labelling.canvas.shape, len(labelling.places)
    allowed = [labelling.allowed_in(k, labelling.canvas) for k in range(count)]
    first = [mask.copy() for mask in allowed]
    lost = []
    for number, stroke in enumerate(strokes):
        here = _raster(stroke, transforms[stroke.layer], shape)
        if stroke.kind == "show":
            here = here & first[stroke.layer]
            if not here.any():
                lost.append(number)
            for k in range(count):
                allowed[k][here] = k == stroke.layer
        elif stroke.kind == "hide":
            others = np.zeros(shape, bool)
            for k in range(count):
                if k != stroke.layer:
                    others |= first[k]
            here = here & others & allowed[stroke.layer]
            for k in range(count):
                if k != stroke.layer:
                    allowed[k][here] |= first[k][here]
            allowed[stroke.layer][here] = False
    parts = [
        cut(mask, labelling.canvas, place) for mask, place in zip(allowed, labelling.places, strict=True)
    ]
    return dataclasses.replace(labelling, allowed=parts), tuple(lost)


def recut(
    labelling: ts.layers.Labelling,
    label_map: ts.layers.LabelMap,
    opened: Mask | None = None,
    *,
    whole: bool = False,
) -> ts.layers.LabelMap:
    """Search a part again, or all."""
    shape, labels = labelling.canvas.shape, np.asarray(label_map.labels)
    wrong = np.zeros(shape, bool)
    for k in range(len(labelling.places)):
        wrong |= (labels == k) & ~labelling.allowed_in(k, labelling.canvas)
    if whole:
        opened = np.ones(shape, bool)
    else:
        if not wrong.any():
            return label_map
        rows, columns = np.flatnonzero(wrong.any(1)), np.flatnonzero(wrong.any(0))
        tight = Box(int(rows[0]), int(columns[0]), int(rows[-1]) + 1, int(columns[-1]) + 1)
        box = tight.grown(max(64, max(tight.shape) // 2)).shared(labelling.canvas)
        opened = np.zeros(shape, bool)
        opened[box.slices] = True
    return ts.layers.recut(labelling, label_map, opened)


def interfaces(labelling: ts.layers.Labelling, labels: Labels, box: Box) -> tuple[Any, ...]:
    """Return the interfaces of seams in a box, with their costs."""
    part = labels[box.slices]
    found = []
    ways: Any = ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:]))
    for axis, (p, q) in enumerate(ways):
        a, b = part[p], part[q]
        rows, columns = np.nonzero((a != b) & (a >= 0) & (b >= 0))
        i, j = np.minimum(a[rows, columns], b[rows, columns]), np.maximum(a[rows, columns], b[rows, columns])
        cost = np.zeros(len(rows), np.float32)
        for pair, own in labelling.costs.items():
            at = (i == pair[0]) & (j == pair[1])
            if at.any():
                beside = np.zeros(box.shape, bool)
                beside[rows[at], columns[at]] = True
                cost[at] = own.on(box, beside)[axis][rows[at], columns[at]]
        found.append(
            (columns + box.left, rows + box.top, np.full(len(rows), axis), np.stack([i, j], 1), cost)
        )
    x, y, axis_, pair_, cost_ = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return x, y, axis_, pair_, cost_
