"""GI-free: lines of seams as GIMP's Bézier strokes, and back.

A line is a flat list x, y, x, y, …; a stroke has six numbers per anchor: handle, anchor, handle.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

#: GIMP's files keep coordinates as single floats: what differs by less was not moved.
SAME_PX = 0.01


def to_stroke(points: Sequence[float]) -> list[float]:
    """A stroke of straight lines: the handles lie on their anchors."""
    return [value for index in range(0, len(points), 2) for value in [*points[index : index + 2]] * 3]


def same(stroke: Sequence[float], other: Sequence[float]) -> bool:
    """Whether nobody has moved a point."""
    return len(stroke) == len(other) and all(abs(a - b) <= SAME_PX for a, b in zip(stroke, other, strict=True))


def lines_of(
    strokes: Iterable[tuple[Sequence[float], bool, Sequence[float]]], known: Sequence[Mapping[str, Any]]
) -> tuple[list[dict[str, Any]], bool]:
    """The lines to apply.

    Parameters
    ----------
    strokes : iterable of (stroke, closed, flattened)
        What GIMP's path holds now: control points, and the line that follows its curves.
    known : sequence of mapping
        What was written there: each has ``stroke``, ``closed`` and the exact ``points``.

    Returns
    -------
    list of dict
        ``points`` and ``closed``: the exact line where the stroke is as it was written, else the flattened one.
    bool
        Whether anything differs from what was written.
    """
    lines, found = [], 0
    for stroke, closed, flattened in strokes:
        untouched = next((line for line in known if line["closed"] == closed and same(line["stroke"], stroke)), None)
        found += untouched is not None
        points = list(flattened) if untouched is None else untouched["points"]
        if len(points) >= 4:
            lines.append({"points": points, "closed": closed})
    return lines, not found == len(lines) == len(known)
