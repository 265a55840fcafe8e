"""Seams as SVG paths: written exactly, and read back after Inkscape, GIMP or a hand has changed them.

What is drawn, in whatever units and under whatever transforms, becomes lines in the pixels of the picture; curves are flattened.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from toposeam.errors import OptionError, PathError
from toposeam.vector.polyline import Floats, Polyline

#: Largest document that is read.
LARGEST_BYTES = 64 * 2**20
#: Most points that are read, curves flattened.
MOST_POINTS = 1_000_000
#: Farthest a flattened curve may be from the true one.
FLATNESS_PX = 0.1

_SVG = "http://www.w3.org/2000/svg"
_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"
_CONTAINERS = {"svg", "g", "a", "switch"}
_PX = {"": 1.0, "px": 1.0, "pt": 96 / 72, "pc": 16.0, "mm": 96 / 25.4, "cm": 96 / 2.54, "in": 96.0}
_LENGTH = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([a-z]*)\s*")
_UNPRINTABLE = re.compile("[^\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_HIDDEN = re.compile(r"(?:^|;)\s*display\s*:\s*none\b")

# Path data: its commands with the numbers each takes per point it draws, and its numbers.
_PER_POINT = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 1}
_TOKEN = re.compile(r"([MmLlHhVvCcSsQqTtAaZz])|[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_FOREIGN = re.compile(r"[^MmLlHhVvCcSsQqTtAaZz0-9eE+\-.,\s]")


@dataclass(frozen=True, slots=True, eq=False)
class SvgSeam:
    """What an SVG document says about a seam."""

    #: The lines, px of the picture.
    polylines: tuple[Polyline, ...]
    #: Size of the picture, px; a whole number unless the document says otherwise.
    width: float
    height: float
    #: The settings that TopoSeam wrote, None in a document without any.
    metadata: dict[str, Any] | None
    #: One name per line; the lines of one ``<path>`` share theirs.
    names: tuple[str, ...]


def write_svg(
    polylines: Sequence[Polyline], width: int, height: int, metadata: Mapping[str, Any], names: Sequence[str] | None = None
) -> str:
    """An SVG document of one path per line, the settings as JSON in ``<metadata>``.

    Parameters
    ----------
    polylines : sequence of Polyline
        Written exactly: :func:`read_svg` gives equal points.
    width, height : int
        Size of the picture, px.
    metadata : mapping
        Anything JSON can hold, NumPy scalars and arrays too.
    names : sequence of str, optional
        One per line, by default "seam 1", "seam 2" and so on. White space is collapsed, as XML does.

    Returns
    -------
    str

    Raises
    ------
    OptionError
        For a size that is not positive, a wrong number of names, or settings that JSON cannot hold.
    """
    if width <= 0 or height <= 0:
        raise OptionError(f"the picture is {width} × {height} px; an SVG document needs a positive width and height")
    if names is None:
        names = [f"seam {index + 1}" for index in range(len(polylines))]
    if len(names) != len(polylines):
        raise OptionError(f"{len(names)} names for {len(polylines)} paths; give one name per path, or none")
    try:
        settings = json.dumps(dict(metadata), default=_plain, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise OptionError(f"metadata cannot be written as JSON ({error}); use numbers, texts, lists and mappings") from error
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="{_SVG}" width="{_number(width)}" height="{_number(height)}" viewBox="0 0 {_number(width)} {_number(height)}">',
        f'  <metadata id="toposeam">{escape(settings, quote=False)}</metadata>',
    ]
    taken: set[str] = set()
    for polyline, name in zip(polylines, names, strict=True):
        title = " ".join(_UNPRINTABLE.sub(" ", name).split())
        identifier, copy = title or "seam", 1
        while identifier in taken:
            copy += 1
            identifier = f"{title or 'seam'} ({copy})"
        taken.add(identifier)
        lines += [
            f'  <path id="{escape(identifier)}" fill="none" stroke="#e6007e" stroke-width="1" d="{_path_data(polyline)}">',
            f"    <title>{escape(title, quote=False)}</title>",
            "  </path>",
        ]
    return "\n".join([*lines, "</svg>", ""])


def read_svg(source: str | bytes | os.PathLike[str], *, size: tuple[int, int] | None = None) -> SvgSeam:
    """The lines of an SVG document, in pixels.

    Paths, lines, polylines, polygons, rectangles, circles and ellipses are read, through groups, layers, transforms and units; definitions
    and what is hidden (``display: none``) are not. A name is the element's ``<title>``, else its Inkscape label, else its ``id``.

    One px is 1/96 inch, as SVG has it, with one exception: a document whose width is given in physical units and whose viewBox counts
    something else is taken to count pixels in the viewBox. GIMP writes such documents, at the picture's own resolution.

    Parameters
    ----------
    source : path-like, str or bytes
        A file, or the document itself. A str with a ``<`` in it is a document.
    size : (int, int), optional
        Width and height of the picture in px: the drawing area is scaled to it, whatever its units.

    Returns
    -------
    SvgSeam

    Raises
    ------
    PathError
        When there is no such file; when it is too large, not XML, not SVG, or declares entities; when it has no path, more than
        `MOST_POINTS` points, or coordinates that are not finite.
    """
    root = _parse(_document(source))
    if _tag(root) != "svg":
        raise PathError(f"the document is <{_tag(root) or root.tag}>, not <svg>; save the path as plain SVG")
    to_px, width, height = _viewport(root.attrib, size)
    polylines: list[Polyline] = []
    names: list[str] = []
    budget = MOST_POINTS
    with np.errstate(invalid="ignore", over="ignore"):  # whatever overflows is found not to be finite
        for element, matrix in _drawn(root, to_px):
            lines = _polylines(element, matrix, budget)
            budget -= sum(len(line.points) for line in lines)
            name = _name(element) or f"seam {len(names) + 1}"
            polylines += lines
            names += [name] * len(lines)
    if not polylines:
        raise PathError("the document has no visible path; draw one, or export the path itself, not only the picture")
    return SvgSeam(tuple(polylines), width, height, _metadata(root), tuple(names))


def read_metadata(source: str | bytes | os.PathLike[str]) -> dict[str, Any] | None:
    """The settings that TopoSeam wrote into an SVG document, None in one without any; reads and raises as :func:`read_svg`."""
    return _metadata(_parse(_document(source)))


def _number(value: float) -> str:
    """The shortest text that reads back as the same number."""
    value = float(value)
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)


def _path_data(polyline: Polyline) -> str:
    first, *rest = (f"{_number(x)},{_number(y)}" for x, y in polyline.points.tolist())
    return f"M{first} L{' '.join(rest)}{' Z' if polyline.closed else ''}"


def _plain(value: object) -> Any:
    """NumPy values, and anything with a path, as JSON knows them."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"{type(value).__name__} {value!r}")


def _document(source: str | bytes | os.PathLike[str]) -> str | bytes:
    """The text of a document, from wherever it is."""
    if isinstance(source, bytes) or (isinstance(source, str) and ("<" in source or not source.strip())):
        document: str | bytes = source
    else:
        try:
            with Path(source).open("rb") as file:
                document = file.read(LARGEST_BYTES + 1)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise PathError(f"{os.fspath(source)[:200]!r} cannot be read ({reason}); check the name of the SVG file") from error
    if len(document) > LARGEST_BYTES:
        raise PathError(f"the SVG document is larger than {LARGEST_BYTES // 2**20} MiB; save the path alone, without embedded pictures")
    if not document.strip():
        raise PathError("the SVG document is empty; export the path again")
    if isinstance(document, bytes) and document.startswith(b"\x1f\x8b"):
        raise PathError("the SVG document is compressed (.svgz); save it as plain SVG")
    return document


def _parse(document: str | bytes) -> Any:
    """The root element; entities and internal DTDs are refused, and nothing outside the document is ever loaded."""
    from defusedxml import DefusedXmlException, DTDForbidden
    from defusedxml.ElementTree import DefusedXMLParser, ParseError

    def refuse_declarations(name: str, system: str | None, public: str | None, has_declarations: int) -> None:
        # GIMP's export has a DOCTYPE that names the DTD of SVG; it is harmless, as nobody fetches it. Declarations in the document are not.
        if has_declarations:
            raise DTDForbidden(name, system, public)

    parser = DefusedXMLParser(forbid_dtd=False, forbid_entities=True, forbid_external=True)
    parser.parser.StartDoctypeDeclHandler = refuse_declarations
    try:
        parser.feed(document)
        return parser.close()
    except DefusedXmlException as error:
        raise PathError("the document declares XML entities or DTD rules, which can be hostile; save the path as plain SVG") from error
    except (ParseError, ValueError, LookupError) as error:
        raise PathError(f"the document is not XML ({error}); save or export the path as SVG") from error


def _tag(element: Any) -> str:
    """The element's name in SVG, "" for elements of other namespaces."""
    namespace, brace, name = str(element.tag).rpartition("}")
    return name if not brace or namespace == "{" + _SVG else ""


def _name(element: Any) -> str:
    titles = [child.text or "" for child in element if _tag(child) == "title"]
    for name in (*titles, element.get(_LABEL), element.get("id")):
        if name and name.strip():
            return " ".join(name.split())
    return ""


def _metadata(root: Any) -> dict[str, Any] | None:
    """The first JSON object in any ``<metadata>``; editors add elements of their own around it."""
    waiting = [(root, False)]
    while waiting:
        element, inside = waiting.pop()
        inside = inside or _tag(element) == "metadata"
        for text in (element.text, *(child.tail for child in element)) if inside else ():
            if text and text.lstrip().startswith("{"):
                try:
                    settings = json.loads(text)
                except (ValueError, RecursionError):
                    continue
                if isinstance(settings, dict):
                    return settings
        waiting += [(child, inside) for child in reversed(element)]
    return None


def _length_px(text: str | None) -> tuple[float, str]:
    """A length in px and its unit; (NaN, "") for lengths that depend on something else, as 100% does."""
    match = _LENGTH.fullmatch(text or "")
    if not match or match[2] not in _PX:
        return math.nan, ""
    return float(match[1]) * _PX[match[2]], match[2]


def _viewport(attributes: Mapping[str, str], size: tuple[int, int] | None = None) -> tuple[Floats, float, float]:
    """Matrix from the coordinates inside an ``<svg>`` element to px, and the size of its area in px."""
    (width, unit), (height, _) = _length_px(attributes.get("width")), _length_px(attributes.get("height"))
    stated = attributes.get("viewBox")
    try:
        left, top, across, down = (float(part) for part in stated.replace(",", " ").split()) if stated else (0.0, 0.0, width, height)
    except ValueError as error:
        raise PathError(f"the viewBox is {stated!r}; give it four numbers: left, top, width and height") from error
    if not (math.isfinite(left) and math.isfinite(top) and 0 < across < math.inf and 0 < down < math.inf):
        raise PathError("the document does not say how large the picture is; give <svg> a viewBox of the picture's width and height in px")
    counts_something_else = not math.isclose(width / _PX[unit], across, rel_tol=1e-3)
    if not width > 0 or not height > 0 or (unit not in ("", "px") and counts_something_else):
        width, height = across, down
    elif not math.isclose(width / across, height / down, rel_tol=1e-2) and attributes.get("preserveAspectRatio", "").strip() != "none":
        # The drawing keeps its shape, in the middle of the area.
        scale = min(width / across, height / down)
        left, across = left - (width / scale - across) / 2, width / scale
        top, down = top - (height / scale - down) / 2, height / scale
    # Editors round: 211.667 mm are 800 px.
    width, height = (float(round(value)) if round(value) and abs(value - round(value)) < 0.02 else value for value in (width, height))
    if size is not None:
        width, height = float(size[0]), float(size[1])
    x, y = width / across, height / down
    return np.array([[x, 0.0, -left * x], [0.0, y, -top * y], [0.0, 0.0, 1.0]]), width, height


def _drawn(root: Any, to_px: Floats) -> Iterator[tuple[Any, Floats]]:
    """Every visible shape in document order, with the matrix from its own coordinates to px."""
    waiting = [(child, to_px) for child in reversed(root)]
    while waiting:
        element, matrix = waiting.pop()
        tag = _tag(element)
        if (tag not in _CONTAINERS and tag not in _SHAPES) or _is_hidden(element):
            continue
        if element.get("transform"):
            matrix = matrix @ _transform(element.get("transform"))
        if tag in _SHAPES:
            yield element, matrix
            continue
        if tag == "svg":
            x, y = (_length_px(element.get(axis, "0"))[0] for axis in ("x", "y"))
            inner = _viewport(element.attrib)[0] if element.get("viewBox") else np.eye(3)
            matrix = matrix @ np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]]) @ inner
        waiting += [(child, matrix) for child in reversed(element)]


def _is_hidden(element: Any) -> bool:
    return str(element.get("display", "")).strip() == "none" or bool(_HIDDEN.search(element.get("style", "")))


def _transform(text: str) -> Floats:
    from svgelements import Matrix

    try:
        m = Matrix(text, ppi=96)
        return np.array([[m.a, m.c, m.e], [m.b, m.d, m.f], [0.0, 0.0, 1.0]], np.float64)
    except (ValueError, TypeError, AttributeError, IndexError, ArithmeticError) as error:
        raise PathError(f"the transform {text[:60]!r} cannot be read; apply or remove it") from error


#: The shapes that are read, each with the attributes that give its geometry.
_SHAPES = {
    "path": ("d",),
    "polyline": ("points",),
    "polygon": ("points",),
    "line": ("x1", "y1", "x2", "y2"),
    "rect": ("x", "y", "width", "height", "rx", "ry"),
    "circle": ("cx", "cy", "r"),
    "ellipse": ("cx", "cy", "rx", "ry"),
}


def _polylines(element: Any, matrix: Floats, budget: int) -> list[Polyline]:
    """The lines of one shape in px, at most `budget` points of them."""
    tag = _tag(element)
    shape = f"<{tag}> {_name(element)!r}"
    try:
        segments = _segments(tag, {key: element.get(key) for key in _SHAPES[tag] if element.get(key)}, budget)
        flattened = _flatten(segments, matrix, budget)
    except PathError:
        raise
    except (ValueError, TypeError, AttributeError, IndexError, ArithmeticError) as error:
        raise PathError(f"{shape} cannot be read as a path; draw or export it again") from error
    lines = []
    for points, closed in flattened:
        if not np.isfinite(points).all():
            raise PathError(f"{shape} has coordinates that are not finite numbers; draw or export it again")
        if len(points) > 1 and np.ptp(points, axis=0).any():
            lines.append(Polyline(points, closed))
    return lines


def _segments(tag: str, geometry: dict[str, str], budget: int) -> Any:
    """The shape as svgelements' path segments."""
    import svgelements

    if tag in ("path", "polyline", "polygon"):
        data = geometry.get("d", "")
        if "points" in geometry:
            data = "M" + geometry["points"] + ("Z" if tag == "polygon" else "")
        foreign = _FOREIGN.search(data)
        if foreign:
            raise ValueError(f"{foreign[0]!r} in path data")
        _check_count(_count_points(data, budget), budget)
        return svgelements.Path(data)
    kinds = {"line": svgelements.SimpleLine, "rect": svgelements.Rect, "circle": svgelements.Circle, "ellipse": svgelements.Ellipse}
    lengths = {key: _length_px(text)[0] for key, text in geometry.items() if text != "auto"}
    if any(math.isnan(length) for length in lengths.values()):
        raise ValueError(f"lengths {geometry}")
    return svgelements.Path(kinds[tag](**lengths))


def _count_points(data: str, budget: int) -> int:
    """How many points path data draws (a Z counts as one), or something above `budget`, before any is drawn."""
    count, share = 0.0, 1.0
    for token in _TOKEN.finditer(data):
        if token[1]:
            count += token[1] in "Zz"
            share = 1.0 / _PER_POINT[token[1].upper()]
        else:
            count += share
            if count > budget + 1:
                break
    return int(count)


def _check_count(count: int, budget: int) -> None:
    if count > budget:
        raise PathError(f"the paths have more than {MOST_POINTS} points; simplify them (Inkscape: Path > Simplify), or save the seam alone")


def _flatten(segments: Any, matrix: Floats, budget: int) -> list[tuple[Floats, bool]]:
    """Points in px of every subpath, and whether it is closed."""
    from svgelements import Arc, Close, CubicBezier, Move, QuadraticBezier

    lines: list[tuple[Floats, bool]] = []
    points: list[tuple[float, float]] = []  # straight runs before the matrix is applied
    pieces: list[Floats] = []
    count = 0

    def straight() -> None:
        if points:
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
            pieces.append(_bezier(_controls(curve) @ matrix[:2, :2].T + matrix[:2, 2], budget - count))
            count += len(pieces[-1])
    finish(False)
    _check_count(sum(len(line) for line, _ in lines), budget)
    return lines


def _xy(point: Any) -> tuple[float, float]:
    return float(point.x), float(point.y)


def _controls(curve: Any) -> Floats:
    """The four control points of a cubic Bézier curve, or of a quadratic one raised to a cubic."""
    if hasattr(curve, "control"):
        start, middle, end = (np.array(_xy(point)) for point in (curve.start, curve.control, curve.end))
        return np.array([start, start + (middle - start) * (2 / 3), end + (middle - end) * (2 / 3), end])
    return np.array([_xy(point) for point in (curve.start, curve.control1, curve.control2, curve.end)])


def _bezier(control: Floats, budget: int) -> Floats:
    """Points of a cubic Bézier curve after its first one, at equal steps of its parameter, within `FLATNESS_PX` of the curve.

    The curve lies in the hull of its control points: it is straight when they are that close to the chord. Else a chord over a step h is
    off by at most h² max|B''| / 8, and max|B''| = 6 max|second difference of the control points|.
    """
    chord, inner = control[3] - control[0], control[1:3] - control[0]
    along = np.clip(inner @ chord / max(chord @ chord, np.finfo(float).tiny), 0.0, 1.0)
    if np.hypot(*(inner - along[:, np.newaxis] * chord).T).max() <= FLATNESS_PX:
        return control[3:]
    bend = float(np.hypot(*np.diff(control, 2, axis=0).T).max())
    if not math.isfinite(bend):
        return np.full((1, 2), math.nan)
    steps = max(1, math.ceil(math.sqrt(6 * bend / (8 * FLATNESS_PX))))
    _check_count(steps, budget)
    t = np.arange(1, steps + 1)[:, np.newaxis] / steps
    p0, p1, p2, p3 = control
    points: Floats = (1 - t) ** 3 * p0 + 3 * (1 - t) ** 2 * t * p1 + 3 * (1 - t) * t**2 * p2 + t**3 * p3
    return points
