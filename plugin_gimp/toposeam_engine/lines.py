"""Lines of seams for the asker: exact, and as a few curves that people can bend."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

import toposeam as ts
from toposeam.arrays import Floats
from toposeam.vector.smooth import TOLERANCES_PX

#: Length above which curves follow a line less closely, px, as it winds too much for a few curves.
_LONG_PX = 1500

#: The control points of a curve, and the exact line that it stands for.
_Curve = tuple[list[float], list[float]]


def lines_of(
    paths: Iterable[ts.vector.Polyline], shift: Floats, known: Sequence[Mapping[str, Any]] = ()
) -> list[dict[str, Any]]:
    """Return the curves of lines. Where a line runs as a known curve does, on the asker's canvas, that is
    kept. Beside known lines others are fitted coarsely at once, as people wait for them.
    """
    pieces = [
        (curve, piece, _dense(np.reshape(piece, (-1, 2))))
        for line in known
        for curve, piece in zip(line["curves"], line["pieces"], strict=True)
    ]
    lines = []
    for path in paths:
        line = ts.vector.Polyline(path.points + shift, path.closed)
        curves = list(_kept(line, pieces)) or _fitted(line, at_once=bool(known))
        lines.append(
            {
                "closed": line.closed,
                "curves": [curve for curve, _piece in curves],
                "pieces": [piece for _curve, piece in curves],
            }
        )
    return lines


def _fitted(line: ts.vector.Polyline, *, at_once: bool) -> list[_Curve]:
    tolerance = TOLERANCES_PX[-1] if at_once or line.length > _LONG_PX else None
    smooth = ts.vector.smooth_path(line, tolerance)
    curves = smooth.curves.reshape(-1, 8).tolist()
    return [(curve, smooth.piece(index).ravel().tolist()) for index, curve in enumerate(curves)]


def _kept(
    line: ts.vector.Polyline, pieces: Sequence[tuple[list[float], list[float], Floats]]
) -> Iterator[_Curve]:
    """Yield the curves of a line of which some are known, and fit others between them; none if none is
    known.
    """
    points = _dense(line.outline)
    count = len(points) - line.closed
    at = {point: index for index, point in enumerate(map(tuple, points[:count].tolist()))}
    found: list[tuple[int, int, _Curve]] = []
    for curve, piece, along in pieces:
        start = at.get(tuple(along[0].tolist()))
        if start is None or not (line.closed or start + len(along) <= count):
            continue
        if len(along) <= len(points) and (points[(start + np.arange(len(along))) % count] == along).all():
            found.append((start, start + len(along) - 1, (curve, piece)))
    if not found:
        return
    found.sort(key=lambda one: one[0])
    end = found[-1][1] - count if line.closed else 0
    for start, last, known in found:
        yield from _between(points[np.arange(end, start + 1) % count])
        yield known
        end = last
    if not line.closed:
        yield from _between(points[end:])


def _between(points: Floats) -> list[_Curve]:
    """Return the curves along points between two known curves, which may meet."""
    return _fitted(ts.vector.Polyline(points), at_once=True) if len(points) > 1 else []


def _dense(points: Floats) -> Floats:
    """Return points at most a pixel apart along a line, which include its own; repeated ones once."""
    steps = np.diff(points, axis=0)
    count = np.ceil(np.abs(steps).max(axis=1) - 1e-9).astype(int)
    at = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    dense = np.repeat(points[:-1], count, axis=0) + (at / np.repeat(count, count))[:, None] * np.repeat(
        steps, count, axis=0
    )
    return np.concatenate([dense, points[-1:]])
