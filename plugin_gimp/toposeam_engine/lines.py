"""Lines of seams for the asker: exact, and as a few curves that people can bend."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

import toposeam as ts
from toposeam.arrays import Floats
from toposeam.vector.smooth import TOLERANCES_PX

#: Length above which curves follow a line less closely, px, as it winds too much for a few curves.
_LONG_PX = 1500
#: Most points by which a found line may extend beyond one that was traced again.
_REACH = 5


def lines_of(
    paths: Iterable[ts.vector.Polyline], shift: Floats, known: Sequence[Mapping[str, Any]] = ()
) -> list[dict[str, Any]]:
    """Return the curves of lines, and the exact pieces of each curve. Where a known line, on the asker's
    canvas, runs the same way its curves are kept. Beside known lines others are fitted coarsely at once, as
    people wait for them.
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
    """The agreement of a line with a known one, in points a pixel apart."""

    first: int
    last: int
    #: Points by which the known line begins before it, and ends after it.
    before: int
    after: int
    known: Mapping[str, Any]


def _like_known(
    line: ts.vector.Polyline, known: Sequence[Mapping[str, Any]]
) -> tuple[list[list[float]], list[list[float]]] | None:
    """Return curves and pieces, of which those at both ends are a known line's; None if the lines do not
    agree.
    """
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
    """Return the index of a point among the first points of a line; 0 if it is none of them."""
    near = np.flatnonzero((np.abs(line[:_REACH] - point) < 1e-6).all(axis=1))
    return int(near[0]) if len(near) else 0


def _same(old: Floats, new: Floats) -> int:
    """Count the equal points from the start on."""
    same = (np.abs(old - new) <= 1e-6).all(axis=1)
    return len(old) if bool(same.all()) else int(same.argmin())


def _points(pieces: Sequence[Sequence[float]]) -> Floats:
    """Join the points of pieces."""
    parts = [np.reshape(piece, (-1, 2)) for piece in pieces]
    joined: Floats = np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
    return joined


def _dense(points: Floats) -> Floats:
    """Return points at most a pixel apart along a line, which include its own."""
    steps = np.diff(points, axis=0)
    count = np.maximum(np.ceil(np.abs(steps).max(axis=1) - 1e-9), 1).astype(int)
    at = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    dense = np.repeat(points[:-1], count, axis=0) + (at / np.repeat(count, count))[:, None] * np.repeat(
        steps, count, axis=0
    )
    return np.concatenate([dense, points[-1:]])
