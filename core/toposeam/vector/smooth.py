"""Few Bézier curves along a line of many points, for editing by hand.

Each stretch becomes one cubic curve, by least squares over its two handles (Schneider 1990, *An algorithm for
automatically fitting digitized curves*, Graphics Gems, without held tangents), then by weights that grow
where the curve is too far away, until the greatest distance is small. Stretches are as long as the tolerance
allows.
Anchors lie on points of the line, so that any curve can be replaced by the exact piece of the line that it
stands for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from toposeam.arrays import Floats, Ints
from toposeam.checks import check_kind, check_number
from toposeam.display import line_svg
from toposeam.vector.polyline import Polyline, check_length

#: Largest distance between curves and line, px: the first value that gives few enough curves, else the last.
TOLERANCES_PX: tuple[float, ...] = (2.0, 2.25, 2.5)
#: Least extent of the line per curve, px, at which curves are few enough.
FEW_PX = 40.0
#: Number of curves, as a multiple of few enough, above which all tolerances but the last are skipped.
_MANY_CURVES = 1.25

#: Least-squares fits of a curve, each with the parameters of the nearest points of the one before.
_REFITS = 6
#: Further fits, with weights that grow where the curve is too far (Lawson 1961); and the distance, as a
#: multiple of the tolerance, above which they are not tried.
_REWEIGHTINGS = 20
_HOPELESS = 1.3
#: Length of the first stretch that is tried, px along the line.
_FIRST_STRETCH_PX = 16
#: The end of a stretch is found to one part in this many of its length.
_STRETCH_PARTS = 16


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
        """Return the part of the line that a curve stands for, (N, 2), turning points only."""
        points = self.dense[self.along[index] : self.along[index + 1] + 1]
        step = np.diff(points, axis=0)
        turn = np.append(True, (np.abs(np.diff(step, axis=0)) > 1e-9).any(axis=1))
        turning: Floats = points[np.append(turn, True)]
        return turning

    def distance(self) -> float:
        """Compute the largest distance of any curve from the line, and of the line from the curves, px."""
        drawn = np.concatenate(
            [
                _cubic(curve, np.linspace(0, 1, 2 * int(length) + 9)[:, np.newaxis])
                for curve, length in zip(self.curves, np.diff(self.along), strict=True)
            ]
        )
        there = scipy.spatial.cKDTree(drawn).query(self.dense)[0]
        back = scipy.spatial.cKDTree(_dense(self.dense, 1 / 16)).query(drawn)[0]
        return float(max(there.max(), back.max()))


def smooth_path(line: Polyline, tolerance: float | None = None) -> SmoothPath:
    """Fit few cubic curves to a line.

    Parameters
    ----------
    line : Polyline
    tolerance : float, optional
        Largest distance between curves and line, px. By default 2 px, and up to 2.5 px where that would
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
        if len(curves) > _MANY_CURVES * few:
            waiting = waiting[-1:]
    return SmoothPath(np.array(curves), np.array(along), line.closed, dense)


def _dense(outline: Floats, spacing: float = 1.0) -> Floats:
    """Insert points into an outline, so that neighbours are at most `spacing` apart in x and in y."""
    steps = np.diff(outline, axis=0)
    count = np.maximum(np.ceil(np.abs(steps).max(axis=1) / spacing - 1e-9), 1).astype(int)
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    share = (number / np.repeat(count, count))[:, np.newaxis]
    dense = np.repeat(outline[:-1], count, axis=0) + share * np.repeat(steps, count, axis=0)
    return np.concatenate([dense, outline[-1:]])


def _fit(dense: Floats, tolerance: float, closed: bool) -> tuple[list[Floats], list[int]]:
    """Fit curves one after another, each as long as it may be; returns them, and where they begin and end."""
    last = len(dense) - 1
    curves: list[Floats] = []
    along = [0]
    while along[-1] < last:
        start = along[-1]
        # A closed line is at least two curves: one alone would have to begin and end at one point.
        limit = min(last, last // 2 + 1) if closed and not curves else last
        end, reach, beyond = start + 1, _FIRST_STRETCH_PX, None
        found = _curve(dense[start : end + 1], tolerance)[0]  # one step is a straight line, which always fits
        while end < limit and (beyond is None or beyond - end > max(1, (end - start) // _STRETCH_PARTS)):
            tried = min(start + reach, limit) if beyond is None else (end + beyond) // 2
            curve, miss = _curve(dense[start : tried + 1], tolerance)
            if miss <= tolerance:
                end, found = tried, curve
                reach += max(_FIRST_STRETCH_PX, reach // 2)
            else:
                beyond = tried
        curves.append(found)
        along.append(end)
    return curves, along


def _curve(points: Floats, tolerance: float) -> tuple[Floats, float]:
    """Fit a cubic from the first to the last of some points to those between.

    Returns one within the tolerance, or the closest that was found, and its greatest distance from them.
    """
    start, end = points[0], points[-1]
    length = len(points) - 1
    share, weight = np.linspace(0, 1, length + 1), np.ones(length + 1)
    samples = np.linspace(0, 1, max(length, 8) + 1)
    tree = scipy.spatial.cKDTree(points)
    best, least = np.stack([start, start, end, end]), np.inf
    for refit in range(_REFITS + _REWEIGHTINGS):
        u = share[:, np.newaxis]
        rest = points - start * (1 - u) ** 3 - end * u**3
        bases = np.hstack([3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u)])
        handles = _least_squares(bases, rest, weight)
        if handles is None:
            handles = start + np.array([[1.0], [2.0]]) / 3 * (end - start)
        curve = np.stack([start, handles[0], handles[1], end])
        drawn = _cubic(curve, samples[:, np.newaxis])
        distance, nearest = scipy.spatial.cKDTree(drawn).query(points)
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


def _least_squares(bases: Floats, rest: Floats, weight: Floats) -> Floats | None:
    """Return the (2, 2) handles for which Σ weight · |bases · handles − rest|² is least; None if they are
    undetermined.
    """
    weighted = (bases * weight[:, np.newaxis]).T
    (a, b), (_b, c) = weighted @ bases
    determinant = a * c - b * b
    if determinant <= 1e-9 * a * c:
        return None
    handles: Floats = np.array([[c, -b], [-b, a]]) @ (weighted @ rest) / determinant
    return handles


def _cubic(curve: Floats, share: Floats) -> Floats:
    """Evaluate cubic curves: (4, …) control points, parameters in [0, 1] that broadcast with them."""
    back = 1 - share
    points: Floats = (
        back**3 * curve[0]
        + 3 * share * back**2 * curve[1]
        + 3 * share**2 * back * curve[2]
        + share**3 * curve[3]
    )
    return points
