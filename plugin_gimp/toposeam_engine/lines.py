"""Lines of seams as the asker needs them: exact, and as few curves for people to bend."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

import toposeam as ts
from toposeam.arrays import Floats
from toposeam.vector.smooth import TOLERANCES_PX

#: Longer lines are followed less closely at once: they wander too much for few curves.
_LONG_PX = 1500
#: A line that was found may end so many points farther on than one that was traced again.
_REACH = 5


def lines_of(
    paths: Iterable[ts.vector.Polyline], shift: Floats, known: Sequence[Mapping[str, Any]] = ()
) -> list[dict[str, Any]]:
    """Return the curves of lines, and the exact pieces that each of these stands for; where a known line, on
    the asker's canvas, ran the same way, its curves are kept, and people wait for the others.
    """
    lines = []
    for path in paths:
        line = ts.vector.Polyline(path.points + shift, path.closed)
        curves, pieces = _like_known(line, known) or _smooth(line, at_once=bool(known))
        lines.append({"closed": line.closed, "curves": curves, "pieces": pieces})
    return lines


def _smooth(
    line: ts.vector.Polyline, *, at_once: bool = False
) -> tuple[list[list[float]], list[list[float]]]:
    tolerance = TOLERANCES_PX[-1] if at_once or line.length > _LONG_PX else None
    smooth = ts.vector.smooth_path(line, tolerance)
    pieces = [smooth.piece(index).ravel().tolist() for index in range(len(smooth.curves))]
    return smooth.curves.reshape(-1, 8).tolist(), pieces


class _Alike(NamedTuple):
    """How far a line runs as a known one does, in points a pixel apart."""

    first: int
    last: int
    #: By how many points the known one begins before it, and ends after it.
    before: int
    after: int
    known: Mapping[str, Any]


def _like_known(
    line: ts.vector.Polyline, known: Sequence[Mapping[str, Any]]
) -> tuple[list[list[float]], list[list[float]]] | None:
    """Curves and pieces of which those at both ends are a known line's; None where nothing is alike."""
    new = _dense(line.points)
    found = [_alike(new, other) for other in known if not line.closed and not other["closed"]]
    best = max(found, key=lambda alike: alike.first + alike.last, default=None)
    if best is None or best.first + best.last < 2:
        return None
    curves, pieces = list(best.known["curves"]), list(best.known["pieces"])
    if best.first == len(new):
        return curves, pieces
    sizes = [len(_dense(np.reshape(piece, (-1, 2)))) - 1 for piece in pieces]
    begin, left, end, right = -best.before, 0, len(new) - 1 + best.after, len(pieces)
    while left < right and begin + sizes[left] < best.first:
        begin += sizes[left]
        left += 1
    while right > left and len(new) - 1 - (end - sizes[right - 1]) < best.last:
        right -= 1
        end -= sizes[right]
    begin, end = max(begin, 0), min(end, len(new) - 1)
    if end <= begin:
        return None
    fitted, exact = _smooth(ts.vector.Polyline(new[begin : end + 1]), at_once=True)
    return [*curves[:left], *fitted, *curves[right:]], [*pieces[:left], *exact, *pieces[right:]]


def _alike(new: Floats, other: Mapping[str, Any]) -> _Alike:
    old = _dense(_points(other["pieces"]))
    before, after = _place(old, new[0]), _place(old[::-1], new[-1])
    old = old[before : len(old) - after]
    count = min(len(old), len(new))
    first = _same(old[:count], new[:count])
    last = min(_same(old[::-1][:count], new[::-1][:count]), count - first)
    return _Alike(first, last, before, after, other)


def _place(line: Floats, point: Floats) -> int:
    """Where among the first points of a line one lies; 0 where it does not."""
    near = np.flatnonzero((np.abs(line[:_REACH] - point) < 1e-6).all(axis=1))
    return int(near[0]) if len(near) else 0


def _same(old: Floats, new: Floats) -> int:
    """How many points agree from the start."""
    same = (np.abs(old - new) <= 1e-6).all(axis=1)
    return len(old) if bool(same.all()) else int(same.argmin())


def _points(pieces: Sequence[Sequence[float]]) -> Floats:
    """The points of pieces, one after another."""
    parts = [np.reshape(piece, (-1, 2)) for piece in pieces]
    joined: Floats = np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
    return joined


def _dense(points: Floats) -> Floats:
    """Points at most a pixel apart along a line, its own among them."""
    steps = np.diff(points, axis=0)
    count = np.maximum(np.ceil(np.abs(steps).max(axis=1) - 1e-9), 1).astype(int)
    at = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    dense = np.repeat(points[:-1], count, axis=0) + (at / np.repeat(count, count))[:, None] * np.repeat(
        steps, count, axis=0
    )
    return np.concatenate([dense, points[-1:]])
