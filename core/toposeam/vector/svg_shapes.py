"""The shapes of SVG as lines in pixels: path data, curves flattened, transforms applied."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from toposeam.arrays import Floats
from toposeam.errors import PathError
from toposeam.vector.polyline import Polyline
from toposeam.vector.svg_document import name_of, tag_of

#: Most points that are read, those of flattened curves included.
MOST_POINTS = 1_000_000
#: Most segments that are read, apart from straight lines as TopoSeam writes them.
MOST_SEGMENTS = 100_000
#: Largest distance of a flattened curve from the true one, px.
FLATNESS_PX = 0.1

#: Units of length, in px.
PX = {"": 1.0, "px": 1.0, "pt": 96 / 72, "pc": 16.0, "mm": 96 / 25.4, "cm": 96 / 2.54, "in": 96.0}
_LENGTH = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([a-z]*)\s*")

# Path data: its commands with the numbers each takes per point it draws, and its numbers.
_PER_POINT = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 1}
_TOKEN = re.compile(r"([MmLlHhVvCcSsQqTtAaZz])|[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_FOREIGN = re.compile(r"[^MmLlHhVvCcSsQqTtAaZz0-9eE+\-.,\s]")

_STRAIGHT = frozenset("MLZ0123456789.eE+-, \t\r\n")
#: A path that goes on after it was closed; and how often one may, as svgelements rereads all of it each time.
_GOES_ON = re.compile(r"[Zz](?![\s,]*(?:[Mm]|$))")
_MOST_GOING_ON = 100
#: Number of other segments that take as long to read as an arc.
_ARC_SEGMENTS = 5
_SIMPLIFY = "simplify them (Inkscape: Path > Simplify), or save the seam alone"
#: Longest text of a length, characters; longer ones are slow to match.
_LONGEST_LENGTH_TEXT = 100

#: The shapes that are read, each with the attributes that give its geometry.
SHAPES = {
    "path": ("d",),
    "polyline": ("points",),
    "polygon": ("points",),
    "line": ("x1", "y1", "x2", "y2"),
    "rect": ("x", "y", "width", "height", "rx", "ry"),
    "circle": ("cx", "cy", "r"),
    "ellipse": ("cx", "cy", "rx", "ry"),
}


def length_px(text: str | None) -> tuple[float, str]:
    """Read a length in px and its unit; (NaN, "") for lengths that depend on something else, as 100% does."""
    match = _LENGTH.fullmatch(text or "") if len(text or "") <= _LONGEST_LENGTH_TEXT else None
    if not match or match[2] not in PX:
        return math.nan, ""
    return float(match[1]) * PX[match[2]], match[2]


class Budget:
    """The points and segments that may still be read, so that hostile documents take some seconds at most."""

    def __init__(self) -> None:
        self.points = MOST_POINTS
        self.segments = MOST_SEGMENTS

    def spend_points(self, count: int) -> None:
        """Take points away.

        Raises
        ------
        PathError
            If fewer are left.
        """
        self.points -= count
        if self.points < 0:
            raise PathError(
                "the paths have more than {most} points; {remedy}",
                kind="too complex",
                most=MOST_POINTS,
                remedy=_SIMPLIFY,
            )

    def spend_segments(self, count: int) -> None:
        """Take segments away, or a number of them that takes as long to read.

        Raises
        ------
        PathError
            If fewer are left.
        """
        self.segments -= count
        if self.segments < 0:
            raise PathError(
                "the paths have more than {most} segments; {remedy}",
                kind="too complex",
                most=MOST_SEGMENTS,
                remedy=_SIMPLIFY,
            )


def transform_of(text: str, budget: Budget) -> Floats:
    """Read the (3, 3) matrix of a ``transform`` attribute."""
    from svgelements import Matrix

    budget.spend_segments(1 + len(text) // 20)
    try:
        m = Matrix(text, ppi=96)
        return np.array([[m.a, m.c, m.e], [m.b, m.d, m.f], [0.0, 0.0, 1.0]], np.float64)
    except (ValueError, TypeError, AttributeError, IndexError, ArithmeticError) as error:
        raise PathError(
            "the transform {transform} cannot be read; apply or remove it",
            kind="unreadable",
            transform=repr(text[:60]),
        ) from error


def polylines_of(element: Any, matrix: Floats, budget: Budget) -> list[Polyline]:
    """Read the lines of one shape, in px."""
    tag = tag_of(element)
    shape = f"<{tag}> {name_of(element)!r}"
    geometry = {key: element.get(key) for key in SHAPES[tag] if element.get(key)}
    try:
        if tag in ("path", "polyline", "polygon"):
            flattened = _path(_path_data(tag, geometry), matrix, budget)
        else:
            flattened = _flatten(_segments(tag, geometry, budget), matrix, budget)
    except PathError:
        raise
    except (ValueError, TypeError, AttributeError, IndexError, ArithmeticError) as error:
        raise PathError(
            "{shape} cannot be read as a path; draw or export it again", kind="unreadable", shape=shape
        ) from error
    lines = []
    for points, closed in flattened:
        if not np.isfinite(points).all():
            raise PathError(
                "{shape} has coordinates that are not finite numbers; draw or export it again",
                kind="number",
                shape=shape,
            )
        if len(points) > 1 and np.ptp(points, axis=0).any():
            lines.append(Polyline(points, closed))
    return lines


def _path_data(tag: str, geometry: dict[str, str]) -> str:
    data = geometry.get("d", "")
    if "points" in geometry:
        data = "M" + geometry["points"] + ("Z" if tag == "polygon" else "")
    foreign = _FOREIGN.search(data)
    if foreign:
        raise ValueError(f"{foreign[0]!r} in path data")
    return data


def _path(data: str, matrix: Floats, budget: Budget) -> list[tuple[Floats, bool]]:
    """Read path data: the points in px of every subpath, and whether it is closed."""
    from svgelements import Path

    count = _count_points(data, budget.points)
    straight = None
    if count <= budget.points:
        straight = _straight(data, matrix)
    if straight is not None:
        budget.spend_segments(1 + len(straight))
        budget.spend_points(sum(len(points) for points, _ in straight))
        return straight
    budget.spend_segments((1 + count) * (_ARC_SEGMENTS if "A" in data.upper() else 1))
    if len(_GOES_ON.findall(data)) > _MOST_GOING_ON:
        raise PathError(
            "a path goes on after it was closed more than {most} times; {remedy}",
            kind="too complex",
            most=_MOST_GOING_ON,
            remedy=_SIMPLIFY,
        )
    return _flatten(Path(data), matrix, budget)


def _straight(data: str, matrix: Floats) -> list[tuple[Floats, bool]] | None:
    """Read path data as TopoSeam writes it, of M, L and Z alone; None for any other."""
    start, *subpaths = data.split("M")
    if start.strip() or not _STRAIGHT.issuperset(data):
        return None
    lines = []
    for subpath in map(str.strip, subpaths):
        closed = subpath.endswith("Z")
        runs = [run.replace(",", " ").split() for run in subpath.removesuffix("Z").split("L")]
        if any(not run or len(run) % 2 for run in runs):
            return None
        try:
            points = np.array([number for run in runs for number in run], np.float64).reshape(-1, 2)
        except ValueError:  # another Z, or numbers without anything between them
            return None
        lines.append((points @ matrix[:2, :2].T + matrix[:2, 2], closed))
    return lines


def _segments(tag: str, geometry: dict[str, str], budget: Budget) -> Any:
    """Convert a line, rectangle, circle or ellipse to svgelements' path segments."""
    import svgelements

    budget.spend_segments(4 * _ARC_SEGMENTS)
    kinds = {
        "line": svgelements.SimpleLine,
        "rect": svgelements.Rect,
        "circle": svgelements.Circle,
        "ellipse": svgelements.Ellipse,
    }
    lengths = {key: length_px(text)[0] for key, text in geometry.items() if text != "auto"}
    if any(math.isnan(length) for length in lengths.values()):
        raise ValueError(f"lengths {geometry}")
    return svgelements.Path(kinds[tag](**lengths))


def _count_points(data: str, budget: int) -> int:
    """Count the points that path data draws, before any is drawn; a Z counts as one.

    The count ends above `budget`.
    """
    count, share, commands = 0.0, 1.0, 0
    for token in _TOKEN.finditer(data):
        if token[1]:
            commands += 1
            count += token[1] in "Zz"
            share = 1.0 / _PER_POINT[token[1].upper()]
        else:
            count += share
        if max(count, commands) > budget + 1:
            break
    return int(max(count, commands))


def _flatten(segments: Any, matrix: Floats, budget: Budget) -> list[tuple[Floats, bool]]:
    """Flatten segments: the points in px of every subpath, and whether it is closed."""
    from svgelements import Arc, Close, CubicBezier, Move, QuadraticBezier

    lines: list[tuple[Floats, bool]] = []
    points: list[tuple[float, float]] = []  # straight runs before the matrix is applied
    pieces: list[Floats] = []

    def straight() -> None:
        if points:
            budget.spend_points(len(points))
            pieces.append(np.array(points) @ matrix[:2, :2].T + matrix[:2, 2])
            points.clear()

    def finish(closed: bool) -> None:
        straight()
        if pieces:
            lines.append((np.concatenate(pieces), closed))
            pieces.clear()

    start = None
    for segment in segments:
        if isinstance(segment, Move):
            finish(False)
            start = _xy(segment.end)
            points.append(start)
            continue
        if start is None:
            raise ValueError("path data must begin with a move")
        if isinstance(segment, Close):
            finish(True)
            continue
        if not points and not pieces:  # drawing goes on after a Z, from where the closed line began
            points.append(start)
        if isinstance(segment, Arc) and segment.rx and segment.ry:
            curves = list(segment.as_cubic_curves())
        elif isinstance(segment, CubicBezier | QuadraticBezier):
            curves = [segment]
        else:
            curves = []
            points.append(_xy(segment.end))
        for curve in curves:
            straight()
            pieces.append(_bezier(_controls(curve) @ matrix[:2, :2].T + matrix[:2, 2], budget))
    finish(False)
    return lines


def _xy(point: Any) -> tuple[float, float]:
    return float(point.x), float(point.y)


def _controls(curve: Any) -> Floats:
    """Return the four control points of a cubic Bézier curve, or of a quadratic one raised to a cubic."""
    if hasattr(curve, "control"):
        start, middle, end = (np.array(_xy(point)) for point in (curve.start, curve.control, curve.end))
        return np.array([start, start + (middle - start) * (2 / 3), end + (middle - end) * (2 / 3), end])
    return np.array([_xy(point) for point in (curve.start, curve.control1, curve.control2, curve.end)])


def _bezier(control: Floats, budget: Budget) -> Floats:
    """Flatten a cubic Bézier curve: its points after the first one, at equal steps of the parameter.

    The lines between them lie within `FLATNESS_PX` of the curve.

    The curve lies in the hull of its control points: it is straight when they are that close to the chord.
    Else a chord over a step h is off by at most h² max|B''| / 8, and max|B''| = 6 max|second difference of
    the control points|.
    """
    chord, inner = control[3] - control[0], control[1:3] - control[0]
    along = np.clip(inner @ chord / max(chord @ chord, np.finfo(float).tiny), 0.0, 1.0)
    if np.hypot(*(inner - along[:, np.newaxis] * chord).T).max() <= FLATNESS_PX:
        budget.spend_points(1)
        return control[3:]
    bend = float(np.hypot(*np.diff(control, 2, axis=0).T).max())
    if not math.isfinite(bend):
        return np.full((1, 2), math.nan)
    steps = max(1, math.ceil(math.sqrt(6 * bend / (8 * FLATNESS_PX))))
    budget.spend_points(steps)
    t = np.arange(1, steps + 1)[:, np.newaxis] / steps
    p0, p1, p2, p3 = control
    points: Floats = (1 - t) ** 3 * p0 + 3 * (1 - t) ** 2 * t * p1 + 3 * (1 - t) * t**2 * p2 + t**3 * p3
    return points
