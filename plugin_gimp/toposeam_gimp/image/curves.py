"""GI-free: lines of seams as GIMP's Bézier strokes, and back.

A line is a flat list x, y, x, y, …; a stroke has six numbers per anchor: handle, anchor, handle. A curve of a
stroke runs from one anchor to the next: eight numbers, start, two handles, end.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

#: Difference below which coordinates count as equal, px, as GIMP's files keep single floats.
SAME_PX = 0.01
#: Approximate step along bent curves, px.
_STEP_PX = 1.5
_MOST_STEPS = 2000

Line = list[float]
Stroke = tuple[Sequence[float], bool]


def stroke_of(curves: Sequence[Sequence[float]], closed: bool) -> Line:
    """Return the stroke of curves, each of which begins at the end of the one before."""
    stroke: Line = []
    before = curves[-1][4:6] if closed else curves[0][:2]
    for curve in curves:
        stroke += [*before, *curve[:4]]
        before = curve[4:6]
    if not closed:
        stroke += [*before, *curves[-1][6:8], *curves[-1][6:8]]
    # In the precision of GIMP's files, so that it is equal after a file was opened again.
    return list(struct.unpack(f"{len(stroke)}f", struct.pack(f"{len(stroke)}f", *stroke)))


def curves_of(stroke: Sequence[float], closed: bool) -> list[list[float]]:
    """Return the curves of a stroke."""
    anchors = [stroke[index : index + 6] for index in range(0, len(stroke), 6)]
    if closed:
        anchors = [*anchors, *anchors[:1]]
    return [[*first[2:4], *first[4:6], *second[:2], *second[2:4]] for first, second in pairwise(anchors)]


def lines_of(strokes: Iterable[Stroke], known: Sequence[Mapping[str, Any]]) -> tuple[list[Any], bool]:
    """Return the lines to apply.

    Parameters
    ----------
    strokes : iterable of (stroke, closed)
        The present strokes of GIMP's path.
    known : sequence of mapping
        The record of the written strokes: each has ``stroke``, ``closed``, and ``pieces``, the exact line of
        each of its curves.

    Returns
    -------
    list of dict
        ``points`` and ``closed``: the exact pieces of unchanged curves, and the curves themselves where they
        were bent.
    bool
        Whether anything differs from what was written.
    """
    exact = {
        _key(curve): piece
        for line in known
        for curve, piece in zip(curves_of(line["stroke"], line["closed"]), line["pieces"], strict=True)
    }
    lines, wanted, found = [], 0, 0
    for stroke, closed in strokes:
        points: Line = []
        for curve in curves_of(stroke, closed):
            piece = exact.get(_key(curve))
            wanted, found = wanted + 1, found + (piece is not None)
            part = followed(curve) if piece is None else piece
            points += part[2:] if points[-2:] == list(part[:2]) else part
        if closed and points[:2] == points[-2:]:
            points = points[:-2]
        if len(points) >= 4:
            lines.append({"points": points, "closed": closed})
    return lines, not wanted == found == len(exact)


def followed(curve: Sequence[float]) -> Line:
    """Return the points along a curve, with both its ends."""
    corners = [(curve[index], curve[index + 1]) for index in range(0, 8, 2)]
    start, first, second, end = corners
    if first == start and second == end:
        return [*start, *end]
    length = sum(math.dist(a, b) for a, b in pairwise(corners))
    steps = min(max(math.ceil(length / _STEP_PX), 1), _MOST_STEPS)
    points: Line = []
    for step in range(steps + 1):
        share = step / steps
        weights = (1 - share) ** 3, 3 * share * (1 - share) ** 2, 3 * share**2 * (1 - share), share**3
        points += [
            sum(weight * corner[axis] for weight, corner in zip(weights, corners, strict=True))
            for axis in (0, 1)
        ]
    return [*start, *points[2:-2], *end]


def _key(curve: Sequence[float]) -> tuple[int, ...]:
    return tuple(round(value / SAME_PX) for value in curve)
