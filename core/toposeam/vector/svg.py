"""Seams as SVG paths: written exactly, and read back after Inkscape, GIMP or a hand has changed them.

Shapes in any units and under any transforms become lines in the pixels of the picture; curves are flattened.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Any

import numpy as np

from toposeam.arrays import Floats
from toposeam.checks import check_pair
from toposeam.errors import OptionError, PathError, Term
from toposeam.sentence import counted
from toposeam.vector.polyline import Polyline
from toposeam.vector.svg_document import NAMESPACE, document_of, name_of, parse, settings_of, tag_of
from toposeam.vector.svg_shapes import PX, SHAPES, Budget, length_px, polylines_of, transform_of

_CONTAINERS = {"svg", "g", "a", "switch"}
_UNPRINTABLE = re.compile("[^\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_HIDDEN = re.compile(r"(?:^|;)\s*display\s*:\s*none\b")

#: Longest side of a picture, px.
LARGEST_PX = 1e9


@dataclass(frozen=True, slots=True, eq=False)
class SvgSeam:
    """The lines and settings of a seam in an SVG document.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 12, 6))
    >>> read = ts.vector.read_svg(ts.find_seam(a, b).to_svg())
    >>> (read.width, read.height), len(read.polylines)
    ((6.0, 12.0), 1)
    """

    #: The lines, px of the picture.
    polylines: tuple[Polyline, ...]
    #: Size of the picture, px; a whole number unless the document says otherwise.
    width: float
    height: float
    #: The settings that TopoSeam wrote, None in a document without any.
    metadata: dict[str, Any] | None
    #: One name per line; the lines of one ``<path>`` share theirs.
    names: tuple[str, ...]

    def __repr__(self) -> str:
        return f"SvgSeam({counted(len(self.polylines), 'line')} on {self.width:g} × {self.height:g} px)"

    def _repr_svg_(self) -> str:
        width, height = math.ceil(self.width), math.ceil(self.height)
        return write_svg(self.polylines, width, height, self.metadata or {}, self.names)


def write_svg(
    polylines: Sequence[Polyline],
    width: int,
    height: int,
    metadata: Mapping[str, Any],
    names: Sequence[str] | None = None,
    origin: tuple[float, float] = (0.0, 0.0),
) -> str:
    """Write an SVG document of one path per line, with the settings as JSON in ``<metadata>``.

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
    origin : (float, float)
        x and y of the picture's upper left corner, px: the ``viewBox`` begins there. If the settings have a
        `canvas`, its width and height, the lines are those of the canvas, and are read as such.

    Returns
    -------
    str

    Raises
    ------
    OptionError
        For a size that is not positive, a wrong number of names, or settings that JSON cannot hold.
    """
    if width <= 0 or height <= 0:
        raise OptionError(
            "the picture is {width} × {height} px; an SVG document needs a positive width and height",
            kind="number",
            width=width,
            height=height,
        )
    if names is None:
        names = [f"seam {index + 1}" for index in range(len(polylines))]
    if len(names) != len(polylines):
        raise OptionError(
            "{count} names for {wanted} paths; give one name per path, or none",
            kind="count",
            parameter=Term("names"),
            count=len(names),
            wanted=len(polylines),
        )
    try:
        settings = json.dumps(dict(metadata), default=_plain, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise OptionError(
            "{parameter} cannot be written as JSON ({reason}); use {allowed}",
            kind="type",
            parameter=Term("metadata"),
            value=metadata,
            reason=str(error),
            allowed="numbers, texts, lists and mappings",
        ) from error
    corner = " ".join(map(_number, origin))
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="{NAMESPACE}" width="{_number(width)}" height="{_number(height)}" viewBox="{corner} '
        f'{_number(width)} {_number(height)}">',
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
            f'  <path id="{escape(identifier)}" fill="none" stroke="#e6007e" stroke-width="1" '
            f'd="{_path_data(polyline)}">',
            f"    <title>{escape(title, quote=False)}</title>",
            "  </path>",
        ]
    return "\n".join([*lines, "</svg>", ""])


def read_svg(source: str | bytes | os.PathLike[str], *, size: tuple[int, int] | None = None) -> SvgSeam:
    """Read the lines of an SVG document, in pixels.

    Paths, lines, polylines, polygons, rectangles, circles and ellipses are read, through groups, layers,
    transforms and units; definitions and hidden elements (``display: none``) are not. A name is the element's
    ``<title>``, else its Inkscape label, else its ``id``.

    One px is 1/96 inch, as SVG has it, with one exception: a document whose width is given in physical units
    and whose viewBox counts something else is taken to count pixels in the viewBox. GIMP writes such
    documents, at the picture's own resolution.

    A document of a part of a canvas (:meth:`toposeam.layers.Composition.to_svg`) is one of the canvas.

    Parameters
    ----------
    source : path-like, str or bytes
        A file, or the document itself. A str with a ``<`` in it is a document.
    size : (int, int), optional
        Width and height of the picture in px: the drawing area is scaled to it.

    Returns
    -------
    SvgSeam

    Raises
    ------
    PathError
        When there is no such file; when it is too large, not XML, not SVG, or declares entities; when it has
        no path, more elements, segments or points than are read, or coordinates that are not finite.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 12, 6))
    >>> seam = ts.find_seam(a, b)
    >>> bool((ts.vector.read_svg(seam.to_svg()).polylines[0].points == seam.paths[0].points).all())
    True
    """
    size = None if size is None else check_pair("size", size, 1)
    root = parse(document_of(source))
    if tag_of(root) != "svg":
        raise PathError(
            "the document is <{tag}>, not <svg>; save the path as plain SVG",
            kind="not SVG",
            tag=str(tag_of(root) or root.tag),
        )
    to_px, width, height = _viewport(root.attrib, size)
    polylines: list[Polyline] = []
    names: list[str] = []
    budget = Budget()
    with np.errstate(invalid="ignore", over="ignore"):  # overflow is found as coordinates that are not finite
        for element, matrix in _drawn(root, to_px, budget):
            lines = polylines_of(element, matrix, budget)
            name = name_of(element) or f"seam {len(names) + 1}"
            polylines += lines
            names += [name] * len(lines)
    if not polylines:
        raise PathError(
            "the document has no visible path; draw one, or export the path itself, not only the picture",
            kind="no path",
        )
    settings = settings_of(root)
    if size is None and (canvas := _canvas_of(settings)) is not None:
        corner = -to_px[:2, 2]
        polylines = [replace(line, points=line.points + corner) for line in polylines]
        width, height = canvas
    return SvgSeam(tuple(polylines), width, height, settings, tuple(names))


def _canvas_of(settings: Mapping[str, Any] | None) -> tuple[float, float] | None:
    """Return width and height of the canvas that settings name, px; None where they name none."""
    stated = (settings or {}).get("canvas")
    if not (isinstance(stated, list) and len(stated) == 2):
        return None
    if not all(isinstance(side, int) and 0 < side <= LARGEST_PX for side in stated):
        return None
    return float(stated[0]), float(stated[1])


def read_metadata(source: str | bytes | os.PathLike[str]) -> dict[str, Any] | None:
    """Read the settings that TopoSeam wrote into an SVG document; None if there are none.

    Sources and errors are those of :func:`read_svg`.
    """
    return settings_of(parse(document_of(source)))


def _number(value: float) -> str:
    """Write the shortest text that reads back as the same number."""
    value = float(value)
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)


def _path_data(polyline: Polyline) -> str:
    first, *rest = (f"{_number(x)},{_number(y)}" for x, y in polyline.points.tolist())
    return f"M{first} L{' '.join(rest)}{' Z' if polyline.closed else ''}"


def _plain(value: object) -> Any:
    """Convert NumPy values and path-like objects for JSON."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"{type(value).__name__} {value!r}")


def _viewport(
    attributes: Mapping[str, str], size: tuple[int, int] | None = None
) -> tuple[Floats, float, float]:
    """Compute the matrix from coordinates inside an ``<svg>`` element to px, and the size of its area, px."""
    (width, unit), (height, _) = length_px(attributes.get("width")), length_px(attributes.get("height"))
    stated = attributes.get("viewBox")
    try:
        left, top, across, down = (
            (float(part) for part in stated.replace(",", " ").split())
            if stated
            else (0.0, 0.0, width, height)
        )
    except ValueError as error:
        raise PathError(
            "the viewBox is {stated}; give it four numbers: left, top, width and height",
            kind="picture size",
            stated=repr(stated),
        ) from error
    if not (math.isfinite(left) and math.isfinite(top) and 0 < across < math.inf and 0 < down < math.inf):
        raise PathError(
            "the document does not say how large the picture is; give <svg> a viewBox of the picture's width "
            "and height in px",
            kind="picture size",
        )
    counts_something_else = not math.isclose(width / PX[unit], across, rel_tol=1e-3)
    if not width > 0 or not height > 0 or (unit not in ("", "px") and counts_something_else):
        width, height = across, down
    elif (
        not math.isclose(width / across, height / down, rel_tol=1e-2)
        and attributes.get("preserveAspectRatio", "").strip() != "none"
    ):
        # The drawing keeps its shape, in the middle of the area.
        scale = min(width / across, height / down)
        left, across = left - (width / scale - across) / 2, width / scale
        top, down = top - (height / scale - down) / 2, height / scale
    if not (0 < width <= LARGEST_PX and 0 < height <= LARGEST_PX):
        raise PathError(
            "the document says that the picture is {width:g} × {height:g} px; give <svg> the picture's "
            "width and height",
            kind="picture size",
            width=width,
            height=height,
        )
    # Editors round: 211.667 mm are 800 px.
    width, height = (
        float(round(value)) if round(value) and abs(value - round(value)) < 0.02 else value
        for value in (width, height)
    )
    if size is not None:
        width, height = float(size[0]), float(size[1])
    x, y = width / across, height / down
    return np.array([[x, 0.0, -left * x], [0.0, y, -top * y], [0.0, 0.0, 1.0]]), width, height


def _drawn(root: Any, to_px: Floats, budget: Budget) -> Iterator[tuple[Any, Floats]]:
    """Yield every visible shape in document order, with the matrix from its own coordinates to px."""
    waiting = [(child, to_px) for child in reversed(root)]
    while waiting:
        element, matrix = waiting.pop()
        tag = tag_of(element)
        if (tag not in _CONTAINERS and tag not in SHAPES) or _is_hidden(element):
            continue
        if element.get("transform"):
            matrix = matrix @ transform_of(element.get("transform"), budget)
        if tag in SHAPES:
            yield element, matrix
            continue
        if tag == "svg":
            x, y = (length_px(element.get(axis, "0"))[0] for axis in ("x", "y"))
            inner = _viewport(element.attrib)[0] if element.get("viewBox") else np.eye(3)
            matrix = matrix @ np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]]) @ inner
        waiting += [(child, matrix) for child in reversed(element)]


def _is_hidden(element: Any) -> bool:
    return str(element.get("display", "")).strip() == "none" or bool(_HIDDEN.search(element.get("style", "")))
