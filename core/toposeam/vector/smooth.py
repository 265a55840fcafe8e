"""Few Bézier curves along a line of many points: what a hand can bend.

Each stretch becomes one cubic curve, by least squares over its two handles (Schneider 1990, *An algorithm for
automatically fitting digitized curves*, Graphics Gems, without held tangents), then by weights that grow
where it is too far, until the greatest distance is small; stretches are as long as the tolerance allows.
Anchors lie on points of the line, so that any curve can be replaced by the exact piece of the line that it
stands for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from toposeam.arrays import Floats, Ints
from toposeam.checks import check_kind, check_number
from toposeam.display import line_svg
from toposeam.vector.polyline import Polyline, check_length

#: How far the curves may be from the line, px: the first value with few enough anchors, else the last one.
TOLERANCES_PX: tuple[float, ...] = (2.0, 2.25, 2.5)
#: A curve on this many px of the line's extent is few enough.
FEW_PX = 40.0
#: Where the first tolerance gives this many times as many, only the last one is tried.
_FAR_MORE = 1.25

_REFITS = 6
#: What least squares leaves too far is levelled out so often, by weights (Lawson 1961), unless hopeless.
_LEVELLINGS = 20
_HOPELESS = 1.7
_FIRST_STRETCH = 16  # px along the line
#: The end of a stretch is found to this share of its length.
_SHARE = 16


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SmoothPath:
    """Cubic Bézier curves along a :class:`Polyline`.

    Examples
    --------
    >>> smooth_path(Polyline([[0, 0], [0, 90]]))
    SmoothPath(2 anchors, open)
    """

    #: (K, 4, 2): start, two handles and end of each curve, x and y in px. One begins where another ends.
    curves: Floats
    #: (K + 1,): between which positions along the line, counted in px, each curve lies.
    along: Ints
    #: Whether the last curve ends where the first begins.
    closed: bool
    #: The line it was fitted to, with a point on every px: curve k stands for
    #: ``dense[along[k] : along[k + 1] + 1]``.
    dense: Floats

    def __repr__(self) -> str:
        return f"SmoothPath({len(self.anchors)} anchors, {'closed' if self.closed else 'open'})"

    def _repr_svg_(self) -> str:
        x, y = self.anchors[0]
        bends = " ".join(" ".join(f"{x:g},{y:g}" for x, y in curve[1:]) for curve in self.curves.tolist())
        return line_svg(f"M {x:g},{y:g} C {bends}", self.dense)

    @property
    def anchors(self) -> Floats:
        """(K, 2) or, of an open line, (K + 1, 2) points that all lie on the line."""
        start: Floats = self.curves[:, 0]
        return start if self.closed else np.concatenate([start, self.curves[-1:, 3]])

    def piece(self, index: int) -> Floats:
        """The part of the line that a curve stands for, (N, 2), turning points only."""
        points = self.dense[self.along[index] : self.along[index + 1] + 1]
        step = np.diff(points, axis=0)
        turn = np.append(True, (np.abs(np.diff(step, axis=0)) > 1e-9).any(axis=1))
        turning: Floats = points[np.append(turn, True)]
        return turning

    def distance(self) -> float:
        """The farthest that any curve is from the line, or the line from the curves, px."""
        drawn = np.concatenate(
            [
                _cubic(curve, np.linspace(0, 1, 2 * int(length) + 9)[:, np.newaxis])
                for curve, length in zip(self.curves, np.diff(self.along), strict=True)
            ]
        )
        there = cKDTree(drawn).query(self.dense)[0]
        back = cKDTree(_dense(self.dense, 1 / 16)).query(drawn)[0]
        return float(max(there.max(), back.max()))


def smooth_path(line: Polyline, tolerance: float | None = None) -> SmoothPath:
    """A line as few cubic curves.

    Parameters
    ----------
    line : Polyline
    tolerance : float, optional
        How far curves and line may be from each other, px. By default 2 px, and up to 2.5 px where that would
        take more than a curve on 40 px of the line's width or height.

    Returns
    -------
    SmoothPath

    Raises
    ------
    OptionError
    PathError
        If the line is too long to be followed pixel by pixel.

    Examples
    --------
    >>> stairs = Polyline(np.repeat(np.arange(120.0), 2)[:, np.newaxis][1:] * [1, 0]
    ...                   + np.repeat(np.arange(120.0), 2)[:, np.newaxis][:-1] * [0, 1])
    >>> smooth_path(stairs)
    SmoothPath(2 anchors, open)
    """
    tolerances = TOLERANCES_PX
    if tolerance is not None:
        tolerances = (check_number("tolerance", tolerance, 0, above=True),)
    check_kind("line", line, Polyline, "a Polyline")
    check_length(line.outline)
    dense = _dense(line.outline)
    few = max(float(np.ptp(dense, axis=0).max()) / FEW_PX, 1)
    waiting = list(tolerances)
    while waiting:
        curves, along = _fit(dense, waiting.pop(0), line.closed)
        if len(curves) <= few:
            break
        if len(curves) > _FAR_MORE * few:
            waiting = waiting[-1:]
    return SmoothPath(np.array(curves), np.array(along), line.closed, dense)


def _dense(outline: Floats, spacing: float = 1.0) -> Floats:
    """The outline with points at most so far apart in x and in y, its own points among them."""
    steps = np.diff(outline, axis=0)
    count = np.maximum(np.ceil(np.abs(steps).max(axis=1) / spacing - 1e-9), 1).astype(int)
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    share = (number / np.repeat(count, count))[:, np.newaxis]
    dense = np.repeat(outline[:-1], count, axis=0) + share * np.repeat(steps, count, axis=0)
    return np.concatenate([dense, outline[-1:]])


def _fit(dense: Floats, tolerance: float, closed: bool) -> tuple[list[Floats], list[int]]:
    """Curves one after another, each as long as it may be; and where they begin and end."""
    last = len(dense) - 1
    curves: list[Floats] = []
    along = [0]
    while along[-1] < last:
        start = along[-1]
        # A closed line is at least two curves: one alone would have to begin and end at one point.
        limit = min(last, last // 2 + 1) if closed and not curves else last
        end, reach, beyond = start + 1, _FIRST_STRETCH, None
        found = _curve(dense[start : end + 1], tolerance)[0]  # one step is a straight line, which always fits
        while end < limit and (beyond is None or beyond - end > max(1, (end - start) // _SHARE)):
            tried = min(start + reach, limit) if beyond is None else (end + beyond) // 2
            curve, miss = _curve(dense[start : tried + 1], tolerance)
            if miss <= tolerance:
                end, found = tried, curve
                reach += max(_FIRST_STRETCH, reach // 2)
            else:
                beyond = tried
        curves.append(found)
        along.append(end)
    return curves, along


def _curve(points: Floats, tolerance: float) -> tuple[Floats, float]:
    """The cubic from the first to the last of some points that stays as close as the tolerance to all
    between, or the closest that was found, and its greatest distance from them.
    """
    start, end = points[0], points[-1]
    length = len(points) - 1
    share, weight = np.linspace(0, 1, length + 1), np.ones(length + 1)
    samples = np.linspace(0, 1, max(length, 8) + 1)
    tree = cKDTree(points)
    best, least = np.stack([start, start, end, end]), np.inf
    for refit in range(_REFITS + _LEVELLINGS):
        u = share[:, np.newaxis]
        rest = points - start * (1 - u) ** 3 - end * u**3
        bases = np.hstack([3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u)])
        much = np.sqrt(weight)[:, np.newaxis]
        handles = np.linalg.lstsq(bases * much, rest * much, rcond=1e-6)[0]
        curve = np.stack([start, handles[0], handles[1], end])
        drawn = _cubic(curve, samples[:, np.newaxis])
        distance, nearest = cKDTree(drawn).query(points)
        miss = float(max(distance.max(), tree.query(drawn)[0].max()))
        if miss < least:
            best, least = curve, miss
        if least <= tolerance or (refit == _REFITS and least > _HOPELESS * tolerance):
            break
        share = samples[nearest]
        if refit >= _REFITS:
            weight *= distance + 0.1 * tolerance
            weight /= weight.mean()
    return best, least


def _cubic(curve: Floats, share: Floats) -> Floats:
    """Points on cubic curves: (4, …) control points, shares in [0, 1] that broadcast with them."""
    back = 1 - share
    points: Floats = (
        back**3 * curve[0]
        + 3 * share * back**2 * curve[1]
        + 3 * share**2 * back * curve[2]
        + share**3 * curve[3]
    )
    return points
