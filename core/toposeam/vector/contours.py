r"""Contours of a density as smooth closed paths that repeat exactly.

Marching squares gives a polygon per contour; stretches of it become cubic Bézier curves, fitted by least
squares with the ends' tangents held (Schneider 1990, *An algorithm for automatically fitting digitized
curves*, Graphics Gems). Where a stretch begins and ends depends only on where it lies in the repeated cell,
so that the contours to the left and right of a border are the same curve.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Ints, Mask
from toposeam.checks import check_range
from toposeam.errors import ImageError, Term

#: Distance of the rows and columns of pixel centres where curves end, px.
ANCHORS_PX = 12
#: Width of the margin in which contours go on beyond the border, px: so wide that no curve that enters the
#: picture is cut.
MARGIN_PX = ANCHORS_PX + 4
#: Largest distance of a curve from its polygon, px.
TOLERANCE_PX = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class CurvePath:
    """Closed loops of cubic Bézier curves, filled by the even-odd rule.

    `curves` is (N, 4, 2): start, two handles and end of every curve, x and y in px; `starts` holds the number
    of each loop's first curve.
    """

    curves: Floats
    starts: Ints

    def data(self, scale: float = 1.0, digits: int = 2) -> str:
        """Write SVG path data, with coordinates times `scale` rounded to a number of digits.

        Every loop ends exactly where it began.
        """
        units = np.rint(self.curves * (scale * 10**digits)).astype(np.int64)
        loops = np.split(units, self.starts[1:]) if len(units) else []
        return " ".join(_loop_data(loop, digits) for loop in loops)

    def pieces(self) -> list[CurvePath]:
        """Divide a contour into its connected pieces: each outline with the holes in it.

        Holes run the other way round than outlines.
        """
        if not len(self.curves):
            return []
        loops = np.split(self.curves, self.starts[1:])
        polygons = [_polygon_of(loop) for loop in loops]
        areas = np.array([_signed_area(polygon) for polygon in polygons])
        way = np.sign(areas[np.argmax(np.abs(areas))])  # the largest loop lies in no other
        outlines = [index for index in np.argsort(np.abs(areas)) if way * areas[index] > 0]
        members: dict[int, list[int]] = {index: [index] for index in sorted(outlines)}
        for hole in np.flatnonzero(way * areas <= 0):
            point = polygons[hole][0]
            around = (index for index in outlines if abs(areas[index]) > abs(areas[hole]))
            home = next((index for index in around if _is_inside(point, polygons[index])), None)
            if home is not None:
                members[home].append(int(hole))
        pieces = []
        for own in members.values():
            curves = [loops[index] for index in own]
            starts = np.cumsum([0, *(len(each) for each in curves[:-1])])
            pieces.append(CurvePath(np.concatenate(curves), starts.astype(np.int64)))
        return pieces


def contour(
    density: npt.ArrayLike, level: float, *, periodic: bool = True, tolerance_px: float = TOLERANCE_PX
) -> CurvePath:
    """Trace the boundary of the area where a density exceeds a level.

    Parameters
    ----------
    density : (H, W) array_like
        Values at pixel centres: row y, column x lies at (x + 1/2, y + 1/2).
    level : float
    periodic : bool
        Whether the density continues with its opposite side beyond each border; the contours then go on for
        `MARGIN_PX` there, and curves that start a period apart are the same. Otherwise the border's values
        are repeated.
    tolerance_px : float
        Largest distance of a curve from the polygon of marching squares, positive.

    Returns
    -------
    CurvePath
        Higher densities inside. Empty where the level is never exceeded.

    Raises
    ------
    ImageError
        For other shapes, or NaN and infinite densities.
    OptionError
        For a tolerance that is not positive.
    """
    values = np.asarray(density, np.float64)
    if values.ndim != 2 or not values.size:
        raise ImageError(
            "{parameter} has shape {shape!s}; pass a non-empty (H, W) array",
            kind="shape",
            parameter=Term("density"),
            shape=values.shape,
        )
    return contour_beyond(
        np.pad(values, MARGIN_PX, mode="wrap" if periodic else "edge"), level, tolerance_px=tolerance_px
    )


def contour_beyond(window: npt.ArrayLike, level: float, *, tolerance_px: float = TOLERANCE_PX) -> CurvePath:
    """Trace the contour of a density that includes its margin: (H + 2m, W + 2m) values, m = `MARGIN_PX`.

    Otherwise as :func:`contour`.
    """
    values = np.asarray(window, np.float64)
    if values.ndim != 2 or min(values.shape) <= 2 * MARGIN_PX or not np.isfinite(values).all():
        raise ImageError(
            "{parameter} has shape {shape!s}, margins included; pass an (H, W) array of finite numbers",
            kind="shape",
            parameter=Term("density"),
            shape=values.shape,
        )
    check_range(0, above=True, tolerance_px=tolerance_px)
    polygons = _polygons(values, level)
    if not polygons:
        return CurvePath(np.zeros((0, 4, 2)), np.zeros(0, np.int64))
    height, width = (size - 2 * MARGIN_PX for size in values.shape)
    polygons = [_from_its_first_anchor(points, width, height) for points in polygons]
    points = np.concatenate(polygons)
    begin = np.cumsum([0, *(len(polygon) for polygon in polygons)])
    ends = _anchors(points, width, height)
    ends[begin[:-1]] = True
    edge = _outside(points, width, height)
    ends |= edge & _turns(points, begin)
    curves, first = _fit(points, begin, ends, edge, _tangents(points, begin), tolerance_px)
    loop = np.searchsorted(begin, first, side="right") - 1
    return CurvePath(curves, np.flatnonzero(np.diff(loop, prepend=-1)).astype(np.int64))


def _polygon_of(loop: Floats) -> Floats:
    """Sample a loop of (N, 4, 2) curves at their starts, thirds and two thirds: (3 N, 2)."""
    share = np.array([0.0, 1 / 3, 2 / 3])[:, np.newaxis]
    weights = np.stack(
        [(1 - share) ** 3, 3 * share * (1 - share) ** 2, 3 * share**2 * (1 - share), share**3], axis=1
    )[..., 0]
    sampled: Floats = np.einsum("sk,nkd->nsd", weights, loop).reshape(-1, 2)
    return sampled


def _signed_area(polygon: Floats) -> float:
    x, y = polygon.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2


def _is_inside(point: Floats, polygon: Floats) -> bool:
    """Test by the even-odd rule whether a point lies in a polygon."""
    if (point < polygon.min(axis=0)).any() or (point > polygon.max(axis=0)).any():
        return False
    (x, y), following = polygon.T, np.roll(polygon, -1, axis=0).T
    crossed = (y > point[1]) != (following[1] > point[1])
    rise = following[1] - y
    at = x + (point[1] - y) * (following[0] - x) / np.where(crossed, rise, 1.0)
    return bool(np.count_nonzero(crossed & (at > point[0])) % 2)


def _polygons(values: Floats, level: float) -> list[Floats]:
    """Trace closed polygons round the values that exceed a level; outside of the array values are low.

    Each has at least three points, of which the last does not repeat the first.
    """
    from contourpy import LineType, contour_generator

    ring = min(level, float(values.min())) - 1e6  # contours close on the window's edge
    ringed = np.pad(values, 1, constant_values=ring)
    rows, columns = (np.arange(size) - MARGIN_PX - 0.5 for size in ringed.shape)
    found = contour_generator(columns, rows, ringed, line_type=LineType.Separate).lines(level)
    polygons = []
    for line in found:
        points = np.asarray(line, np.float64)[:-1]
        points = points[(points != np.roll(points, 1, axis=0)).any(axis=1)]
        if len(points) >= 3:
            polygons.append(points)
    return polygons


def _anchors(points: Floats, width: int, height: int) -> Mask:
    """Mark the points on the rows and columns of pixel centres where curves end; periodic in the cell."""
    x, y = points.T - 0.5
    column, row = np.rint(x), np.rint(y)
    on_column = (np.abs(x - column) < 1e-9) & (column % width % ANCHORS_PX == 0)
    on_row = (np.abs(y - row) < 1e-9) & (row % height % ANCHORS_PX == 0)
    found: Mask = on_column | on_row
    return found


def _outside(points: Floats, width: int, height: int) -> Mask:
    """Mark the points on the window's edge, where contours were cut."""
    low, high = 0.5 - MARGIN_PX, MARGIN_PX - 0.5
    beyond: Mask = np.any((points < low) | (points > np.array([width + high, height + high])), axis=1)
    return beyond


def _from_its_first_anchor(points: Floats, width: int, height: int) -> Floats:
    """Rotate a loop to begin at an anchor; without one, at its topmost point (of these the leftmost)."""
    at = np.flatnonzero(_anchors(points, width, height))
    start = (
        int(at[0]) if len(at) else int(np.lexsort((np.round(points[:, 0], 6), np.round(points[:, 1], 6)))[0])
    )
    return np.roll(points, -start, axis=0)


def _neighbour(values: Floats, begin: Ints, step: int) -> Floats:
    """Return the value `step` points further on in the same loop."""
    index = np.arange(len(values))
    size, start = (np.repeat(per_loop, np.diff(begin)) for per_loop in (np.diff(begin), begin[:-1]))
    moved: Floats = values[start + (index - start + step) % size]
    return moved


def _turns(points: Floats, begin: Ints) -> Mask:
    """Mark the points where the polygon changes its direction."""
    before, after = points - _neighbour(points, begin, -1), _neighbour(points, begin, 1) - points
    turns: Mask = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) > 1e-6
    return turns


def _tangents(points: Floats, begin: Ints) -> Floats:
    """Compute unit directions of travel at every point, from its two neighbours on either side."""
    direction = np.zeros_like(points)
    for step in (1, 2):
        direction += _neighbour(points, begin, step) - _neighbour(points, begin, -step)
    length = np.hypot(*direction.T)
    straight = _neighbour(points, begin, 1) - points
    direction = np.where(length[:, None] > 1e-9, direction, straight)
    tangent: Floats = direction / np.maximum(np.hypot(*direction.T), 1e-12)[:, None]
    return tangent


def _fit(
    points: Floats, begin: Ints, ends: Mask, edge: Mask, tangent: Floats, tolerance: float
) -> tuple[Floats, Ints]:
    """Fit curves from end to end; a stretch whose curve misses the polygon is halved.

    Returns their control points, and the index of the point at which each starts.
    """
    loop_of = np.repeat(np.arange(len(begin) - 1), np.diff(begin))
    first = np.flatnonzero(ends)
    last = np.append(first[1:], begin[-1])  # the index after a loop's last point stands for its first point
    done: list[Floats] = []
    done_first: list[Ints] = []
    while len(first):
        control, miss = _curves(points, tangent, edge, begin, loop_of, first, last)
        good = (miss <= tolerance) | (last - first <= 1)
        done.append(control[good])
        done_first.append(first[good])
        first, last = first[~good], last[~good]
        middle = (first + last) // 2
        first, last = np.concatenate([first, middle]), np.concatenate([middle, last])
    order = np.argsort(np.concatenate(done_first))
    return np.concatenate(done)[order], np.concatenate(done_first)[order]


def _curves(
    points: Floats, tangent: Floats, edge: Mask, begin: Ints, loop_of: Ints, first: Ints, last: Ints
) -> tuple[Floats, Floats]:
    """Fit the best cubic curve from point `first` to point `last` of each stretch.

    Returns the control points, and the largest distance of each curve from the points between.
    """
    loop = loop_of[first]
    # Points of all stretches one after another, both ends included.
    count = last - first + 1
    stretch = np.repeat(np.arange(len(first)), count)
    offset = np.arange(len(stretch)) - np.repeat(np.cumsum(count) - count, count)
    index = first[stretch] + offset
    index = np.where(
        index == begin[loop + 1][stretch], begin[loop][stretch], index
    )  # the loop's end is its beginning
    p = points[index]
    step = np.hypot(*np.diff(p, axis=0, prepend=p[:1]).T)
    step[offset == 0] = 0.0
    travelled = np.cumsum(step)
    travelled -= travelled[offset == 0][stretch]
    starts, stops = index[offset == 0], index[np.append(np.flatnonzero(offset == 0)[1:], len(index)) - 1]
    length = np.bincount(stretch, step)
    u = travelled / np.maximum(length, 1e-12)[stretch]
    a, d = points[starts], points[stops]
    t0, t1 = tangent[starts], -tangent[stops]
    straight = edge[starts] | edge[stops] | (length < 1e-9)
    b0, b1, b2, b3 = (1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3
    a0, a1 = t0[stretch] * b1[:, None], t1[stretch] * b2[:, None]
    rest = p - (a[stretch] * (b0 + b1)[:, None] + d[stretch] * (b2 + b3)[:, None])
    n = len(first)
    c00, c01, c11, x0, x1 = (
        np.bincount(stretch, (left * right).sum(axis=1), n)
        for left, right in ((a0, a0), (a0, a1), (a1, a1), (a0, rest), (a1, rest))
    )
    determinant = c00 * c11 - c01**2
    usable = determinant > 1e-9 * np.maximum(c00 * c11, 1e-300)
    safe = np.where(usable, determinant, 1.0)
    reach0, reach1 = (x0 * c11 - x1 * c01) / safe, (x1 * c00 - x0 * c01) / safe
    usable &= (reach0 > 0.05 * length) & (reach1 > 0.05 * length) & (reach0 < length) & (reach1 < length)
    reach0, reach1 = np.where(usable, reach0, length / 3), np.where(usable, reach1, length / 3)
    b, c = a + t0 * reach0[:, None], d + t1 * reach1[:, None]
    b, c = (
        np.where(straight[:, None], a + (d - a) * share, curved) for share, curved in ((1 / 3, b), (2 / 3, c))
    )
    curve = (
        a[stretch] * b0[:, None]
        + b[stretch] * b1[:, None]
        + c[stretch] * b2[:, None]
        + d[stretch] * b3[:, None]
    )
    miss = np.zeros(n)
    np.maximum.at(miss, stretch, np.hypot(*(curve - p).T))
    return np.stack([a, b, c, d], axis=1), miss


def _loop_data(loop: Ints, digits: int) -> str:
    """Write one loop in relative coordinates, which are short; rounded differences add up exactly."""
    begin = loop[0, 0]
    relative = (loop[:, 1:] - loop[:, :1]).reshape(-1, 6)
    unit = 10**digits
    numbers = [[_decimal(value, unit, digits) for value in row] for row in relative.tolist()]
    x, y = (_decimal(value, unit, digits) for value in begin.tolist())
    return f"M{x},{y}c{' '.join(' '.join(row) for row in numbers)}z"


def _decimal(value: int, unit: int, digits: int) -> str:
    """Write the shortest decimal of value / unit."""
    whole, part = divmod(abs(value), unit)
    sign = "-" if value < 0 else ""
    if not part:
        return f"{sign}{whole}" if whole else "0"
    return f"{sign}{whole or ''}.{part:0{digits}d}".rstrip("0")
