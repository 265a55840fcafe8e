"""Layouts: small files that hold a whole work: which pictures lie where, and what was chosen and painted.

::

    # TOML; the same in JSON is {"layer": [{"file": "left.tif", "at": [0, 0]}, …]}
    [[layer]]                # bottommost first
    file = "left.tif"        # relative to the layout
    at = [0, 0]              # column and row of its upper left pixel
    name = "left"            # the file's name by default
    mask = "left-mask.png"   # where it may show: white
    keep = "left-keep.png"   # where nothing else may show: white
    visible = true
    turn = 0.53              # degrees clockwise round that corner; then places may have fractions
    scale = 1.002

A layer may be warped instead: by a homography from its pixels to the canvas, or by its camera. The table
``view`` then says how the canvas shows directions::

    [view]
    projection = "cylinder"  # flat, cylinder, sphere, panini
    radius = 627.38          # px per radian in the middle
    wrap = 3942              # its width, if it goes all the way round
    fov = 180.0              # instead: degrees across that it shows at most

    [[layer]]
    file = "one.jpg"
    matrix = [[1.0, 0.0, 5.5], [0.0, 1.0, -2.0], [0.0001, 0.0, 1.0]]

    [[layer]]
    file = "two.jpg"
    size = [512, 384]        # width and height of the picture, px
    yaw = 12.5               # degrees to the right, up, and clockwise
    pitch = 0.4
    roll = -0.8
    focal = 627.38           # px
    lens = [0.0, -0.014, 0.0]  # a, b, c and d, e of Hugin
    shift = [0.0, 0.0]

A picture that is warped may be bent, too, by displacements on the canvas: coefficients of a uniform cubic
B-spline on square cells, the middle ones at the middle of the picture::

    mesh = { size = [512, 384], cell = 32.0, x = [[0.0, 0.1, …], …], y = [[0.0, 0.0, …], …] }

Where the picture is fitted to a rectangle, the boundary of the canvas is bent in the same way, by
displacements from `at` on::

    [boundary]
    at = [-3, 0]
    size = [1911, 868]
    cell = 53.1
    x = [[0.0, 0.1, …], …]
    y = [[0.0, 0.0, …], …]

What was chosen has the names of the command's options; those that the command line gives win. Strokes are
painted on a picture, in its own pixels, and later ones win. Labels are the seams as they were seen at a
smaller size, near which those at full size stay. Layers are counted from 0 in the order of this file, also
those that are not visible, or called by name::

    [stitch]
    as = "photographs"
    blend = "multiband"
    crop = "outside"
    avoid = "faces.png"      # files are relative to the layout
    use-seam = ["0:1=seam.svg"]

    [[stroke]]
    layer = "one.jpg"        # or 0
    kind = "show"            # hide: it must not show there; away: no seam runs there
    radius = 14.0            # px of the picture
    points = [[812.5, 340.0], [840.0, 352.5]]  # its corners x, y, px from the picture's upper left corner

    [labels]
    file = "placed.labels.png"  # gray: the number of the layer that shows; white: none
    at = [-3.0, 0.0]         # where its upper left corner lies on the canvas
    scale = 4.0              # px of the canvas across one of its own
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

import toposeam as ts
from toposeam.layers.canvas.transforms import (
    PROJECTIONS,
    CameraTransform,
    MeshTransform,
    PlaneTransform,
    Projection,
    Transform,
    angles_of,
    as_similarity,
    is_move,
    settled,
    similarity,
    turned_camera,
    unbent,
)
from toposeam.layers.labelling.strokes import KINDS, StrokeKind
from toposeam_cli.files.regular import real_path
from toposeam_cli.files.tables import read_table

_KEYS = ("file", "name", "mask", "keep", "visible", "mesh")
#: Keys of a layer's transform, of which a layer has one group: a place, a matrix or a camera.
_PLACE, _MATRIX = ("at", "turn", "scale"), ("matrix",)
_CAMERA = ("size", "yaw", "pitch", "roll", "focal", "lens", "shift")
_MESH = ("size", "cell", "x", "y")
_VIEW = ("projection", "radius", "wrap", "fov")
#: Most layers of a layout, as of an OpenRaster file, and most strokes.
MOST_LAYERS, _MOST_STROKES = 1000, 10_000
#: Largest layout that is read, bytes: as many strokes as an hour's painting fit.
_LARGEST_BYTES = 4 * 2**20
_FARTHEST_PX = 10**9
_LARGEST_NUMBER = 1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutLayer:
    """A picture of a layout."""

    file: Path
    name: str
    transform: Transform
    mask: Path | None = None
    keep: Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutStroke:
    """What was painted with a round brush on a picture of a layout."""

    #: Its number among the visible layers.
    layer: int
    kind: StrokeKind
    #: px of the picture.
    radius: float
    #: Corners x, y of the brush's path, px from the picture's upper left corner.
    points: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutLabels:
    """A picture of which layer showed where at a smaller size."""

    file: Path
    #: x and y of its upper left corner on the canvas, px.
    at: tuple[float, float]
    #: px of the canvas across one of its own.
    scale: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """A work: pictures, where they lie, what was chosen and what was painted."""

    layers: tuple[LayoutLayer, ...]
    #: Width of a canvas that is a whole turn, px; else None.
    wrap: int | None = None
    #: How the boundary of the canvas is bent; None where it is not.
    boundary: MeshTransform | None = None
    #: What was chosen, by the names of the command's options: texts, numbers, booleans and lists of them.
    #: Files are named from the layout's folder.
    options: Mapping[str, Any] = field(default_factory=dict)
    strokes: tuple[LayoutStroke, ...] = ()
    labels: LayoutLabels | None = None
    #: The number of each layer among those of the file, which labels have, and how many the file has.
    numbers: tuple[int, ...] = ()
    count: int = 0

    @property
    def files(self) -> list[Path]:
        """The pictures' files, in the order of the layers."""
        return [layer.file for layer in self.layers]


def read_layout(path: Path) -> Layout:
    """Return the visible layers of a layout in TOML or JSON, by its extension, in the order of the file.

    Raises
    ------
    OptionError
        If it cannot be read or has an invalid value; the text names the place.
    """
    table, _ = read_table(path, "a layout", _LARGEST_BYTES)
    known = {"layer", "view", "boundary", "stitch", "stroke", "labels"}
    if not isinstance(table, dict) or set(table) - known or not isinstance(table.get("layer"), list):
        surplus = ", ".join(sorted(set(table) - known)) if isinstance(table, dict) else ""
        found = f"it has {surplus}" if surplus else "it has none"
        raise ts.OptionError(
            f"'{path}' must hold layers, [[layer]], and perhaps [view], [boundary], [stitch], [[stroke]] and "
            f"[labels], "
            f"but {found}; correct it"
        )
    if len(table["layer"]) > MOST_LAYERS:
        raise ts.OptionError(f"'{path}' has {len(table['layer'])} layers; keep to {MOST_LAYERS} at most")
    view = _view(path, table.get("view"))
    layers = [_layer(path, number, entry, view) for number, entry in enumerate(table["layer"], start=1)]
    numbers = [number for number, layer in enumerate(layers) if layer is not None]
    visible = [layer for layer in layers if layer is not None]
    names = [layer.name for layer in visible]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ts.OptionError(f"'{path}' has two layers called {twice!r}; give each a name of its own")
    options = table.get("stitch", {})
    if not isinstance(options, dict):
        raise ts.OptionError(f"'{path}': stitch is {options!r}; write [stitch] and the options below it")
    return Layout(
        layers=tuple(visible),
        wrap=view.wrap,
        boundary=_boundary(path, table["boundary"]) if "boundary" in table else None,
        options=options,
        strokes=_strokes(path, table.get("stroke", []), [_name(entry) for entry in table["layer"]], numbers),
        labels=_labels(path, table["labels"]) if "labels" in table else None,
        numbers=tuple(numbers),
        count=len(layers),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _View:
    """The projection of directions onto the canvas."""

    projection: Projection = "flat"
    radius: float = math.nan
    wrap: int | None = None
    #: Horizontal field of view, degrees.
    fov: float | None = None


def _view(path: Path, entry: Any) -> _View:
    if entry is None:
        return _View()
    where = f"'{path}', view"
    if not isinstance(entry, dict) or set(entry) - set(_VIEW) or not {"projection", "radius"} <= set(entry):
        raise ts.OptionError(f"{where} is {entry!r}; write projection, radius and perhaps wrap or fov")
    if entry["projection"] not in PROJECTIONS:
        raise ts.OptionError(
            f"{where}: projection is {entry['projection']!r}; write one of {', '.join(PROJECTIONS)}"
        )
    radius = _number(where, entry, "radius", 1.0, 1e-3, _LARGEST_NUMBER)
    wrap = entry.get("wrap")
    if wrap is not None and (isinstance(wrap, bool) or not isinstance(wrap, int) or not 1 < wrap < 10**9):
        raise ts.OptionError(f"{where}: wrap is {wrap!r}; write a whole number of pixels")
    if wrap is not None and entry["projection"] not in ("cylinder", "sphere"):
        raise ts.OptionError(
            f"{where}: projection {entry['projection']} does not go all the way round; leave wrap out, or "
            "write cylinder or sphere"
        )
    fov = _number(where, entry, "fov", math.nan, 1e-3, 360) if "fov" in entry else None
    if fov is not None and wrap is not None:
        raise ts.OptionError(
            f"{where}: a canvas with fov does not go all the way round; leave wrap or fov out"
        )
    return _View(projection=entry["projection"], radius=radius, wrap=wrap, fov=fov)


def _layer(path: Path, number: int, entry: Any, view: _View) -> LayoutLayer | None:
    where = f"'{path}', layer {number}"
    if not isinstance(entry, dict):
        raise ts.OptionError(f"{where} is {entry!r}; write its keys, at least file and at")
    known = (*_KEYS, *_PLACE, *_MATRIX, *_CAMERA)
    unknown = sorted(set(entry) - set(known))
    if unknown:
        raise ts.OptionError(
            f"{where} has {unknown[0]!r}, which is none of {', '.join(known)}; correct or remove it"
        )
    for key in ("file", "name", "mask", "keep"):
        if key in entry and (not isinstance(entry[key], str) or not entry[key].strip()):
            raise ts.OptionError(f"{where}: {key} is {entry[key]!r}; write a text")
    ways = [way for way in (_PLACE, _MATRIX, _CAMERA) if set(way) & set(entry)]
    if "file" not in entry or not ways:
        raise ts.OptionError(
            f"{where} has no {'file' if 'file' not in entry else 'at'}; say which picture lies where, as at "
            "= [120, -4]"
        )
    if len(ways) > 1:
        raise ts.OptionError(
            f"{where} says twice where it lies, by {ways[0][0]} and by {ways[1][0]}; leave one of them out"
        )
    transform = {_PLACE: _similarity, _MATRIX: _homography, _CAMERA: _camera}[ways[0]](where, entry, view)
    if "mesh" in entry:
        transform = _mesh(where, entry["mesh"], transform)
    if not isinstance(entry.get("visible", True), bool):
        raise ts.OptionError(f"{where}: visible is {entry['visible']!r}; write true or false")
    if not entry.get("visible", True):
        return None
    folder = path.parent
    mask, keep = (folder / entry[key] if key in entry else None for key in ("mask", "keep"))
    return LayoutLayer(
        file=folder / entry["file"],
        name=_name(entry),
        transform=transform,
        mask=mask,
        keep=keep,
    )


def _name(entry: Mapping[str, Any]) -> str:
    return str(entry.get("name", Path(entry["file"]).name))


def _strokes(
    path: Path, entries: Any, names: Sequence[str], numbers: Sequence[int]
) -> tuple[LayoutStroke, ...]:
    """Return the strokes on the visible layers, whose numbers among all, with their names, are given."""
    if not isinstance(entries, list) or len(entries) > _MOST_STROKES:
        found = f"{len(entries)} of them" if isinstance(entries, list) else repr(entries)[:80]
        raise ts.OptionError(
            f"'{path}': stroke is {found}; write [[stroke]] for each of {_MOST_STROKES} at most"
        )
    strokes = [_stroke(f"'{path}', stroke {k}", entry, names) for k, entry in enumerate(entries, start=1)]
    return tuple(
        replace(stroke, layer=numbers.index(stroke.layer)) for stroke in strokes if stroke.layer in numbers
    )


def _stroke(where: str, entry: Any, names: Sequence[str]) -> LayoutStroke:
    """Return a stroke with the number of its layer among all of the file."""
    known = [each.name for each in fields(LayoutStroke)]
    if not isinstance(entry, dict) or set(entry) != set(known):
        raise ts.OptionError(f"{where} is {repr(entry)[:80]}; write {', '.join(known)}, and nothing else")
    layer = entry["layer"]
    if isinstance(layer, str) and names.count(layer) == 1:
        layer = names.index(layer)
    if isinstance(layer, bool) or not isinstance(layer, int) or not 0 <= layer < len(names):
        raise ts.OptionError(
            f"{where}: layer is {layer!r}; write the name of a layer, or its number from 0 to "
            f"{len(names) - 1}"
        )
    if entry["kind"] not in KINDS:
        raise ts.OptionError(f"{where}: kind is {entry['kind']!r}; write one of {', '.join(KINDS)}")
    points = entry["points"]
    if not isinstance(points, list) or not points:
        raise ts.OptionError(f"{where}: points is {points!r}; write a list of x, y, as [[812.5, 340.0]]")
    found = [_numbers(where, {"points": point}, "points", 2) for point in points]
    return LayoutStroke(
        layer=layer,
        kind=entry["kind"],
        radius=_number(where, entry, "radius", 1.0, 1e-3, 1e6),
        points=tuple((x, y) for x, y in found),
    )


def _labels(path: Path, entry: Any) -> LayoutLabels:
    where, known = f"'{path}', labels", [each.name for each in fields(LayoutLabels)]
    if not isinstance(entry, dict) or set(entry) != set(known):
        raise ts.OptionError(f"{where} is {repr(entry)[:80]}; write {', '.join(known)}, and nothing else")
    if not isinstance(entry["file"], str) or not entry["file"].strip():
        raise ts.OptionError(f"{where}: file is {entry['file']!r}; write a text")
    left, top = _numbers(where, entry, "at", 2)
    scale = _number(where, entry, "scale", 1.0, 1.0, 1e4)
    return LayoutLabels(file=path.parent / entry["file"], at=(left, top), scale=scale)


def _similarity(where: str, entry: dict[str, Any], _: _View) -> Transform:
    turn, scale = (
        _number(where, entry, *limits) for limits in (("turn", 0.0, -180, 180), ("scale", 1.0, 0.1, 10))
    )
    at = entry.get("at")
    kinds = int if turn == 0 and scale == 1 else int | float
    fits = (
        isinstance(at, list)
        and len(at) == 2
        and all(isinstance(value, kinds) and not isinstance(value, bool) for value in at)
    )
    if not isinstance(at, list) or not fits or any(map(math.isnan, at)):
        raise ts.OptionError(f"{where}: at is {at!r}; write two whole numbers of pixels, as at = [120, -4]")
    if max(map(abs, at)) > _FARTHEST_PX:
        raise ts.OptionError(f"{where}: at is {at!r}, which lies too far away; nine digits are the most")
    return similarity((at[0], at[1]), turn, scale)


def _homography(where: str, entry: dict[str, Any], _: _View) -> Transform:
    rows = entry["matrix"]
    if not isinstance(rows, list) or len(rows) != 3:
        raise ts.OptionError(f"{where}: matrix is {rows!r}; write three rows of three numbers")
    matrix = np.array([_numbers(where, {"matrix": row}, "matrix", 3) for row in rows])
    if not abs(np.linalg.det(matrix)) > 1e-12:
        raise ts.OptionError(f"{where}: matrix has no inverse; write that of a homography")
    return PlaneTransform(-matrix if matrix[2, 2] < 0 else matrix)  # both are the same homography


def _camera(where: str, entry: dict[str, Any], view: _View) -> Transform:
    if math.isnan(view.radius):
        raise ts.OptionError(f"{where} is seen by a camera; add [view] with its projection and radius")
    turn = 2 * math.pi * view.radius
    if view.wrap is not None and abs(view.wrap - turn) > 1:
        raise ts.OptionError(
            f"{where} is seen by a camera whose whole turn is {turn:.0f} px wide, and wrap is {view.wrap}; "
            "correct that or the radius"
        )
    missing = sorted({"size", "focal"} - set(entry))
    if missing:
        raise ts.OptionError(f"{where} has no {missing[0]}; write that of its camera")
    yaw, pitch, roll = (_number(where, entry, key, 0.0, -36000, 36000) for key in ("yaw", "pitch", "roll"))
    width, height = _numbers(where, entry, "size", 2)
    a, b, c = _numbers(where, entry, "lens", 3, 0.5)
    across, down = _numbers(where, entry, "shift", 2)
    return CameraTransform(
        size=(round(width), round(height)),
        rotation=turned_camera(yaw, pitch, roll),
        focal=_number(where, entry, "focal", math.nan, 1e-3, _LARGEST_NUMBER),
        projection=view.projection,
        radius=view.radius,
        lens=(a, b, c),
        shift=(across, down),
        fov=view.fov,
    )


def _mesh(where: str, entry: Any, base: Transform, key: str = "mesh") -> MeshTransform:
    """Return a transform bent by the mesh of a layout, which stands under that key."""
    where = f"{where}, {key}"
    if not isinstance(entry, dict) or set(entry) != set(_MESH):
        raise ts.OptionError(f"{where} is {entry!r}; write its size, cell, x and y")
    width, height = (round(side) for side in _numbers(where, entry, "size", 2))
    cell = _number(where, entry, "cell", math.nan, 1, _LARGEST_NUMBER)
    rows, columns = (math.ceil(side / cell) + 3 for side in (height, width))
    planes = []
    for plane in ("x", "y"):
        given = entry[plane]
        if not isinstance(given, list) or len(given) != rows:
            raise ts.OptionError(f"{where}: {plane} is not {rows} rows of {columns} numbers; write these")
        planes.append([_numbers(where, {plane: row}, plane, columns) for row in given])
    return MeshTransform(base, (width, height), cell, np.moveaxis(np.array(planes), 0, -1))


def _boundary(path: Path, entry: Any) -> MeshTransform:
    """Return the bent boundary of a canvas."""
    where = f"'{path}', boundary"
    if not isinstance(entry, dict) or set(entry) != {"at", *_MESH}:
        raise ts.OptionError(f"{where} is {entry!r}; write its at, size, cell, x and y")
    left, top = (round(edge) for edge in _numbers(where, entry, "at", 2))
    return _mesh(f"'{path}'", {key: entry[key] for key in _MESH}, similarity((left, top)), "boundary")


def _numbers(
    where: str, entry: dict[str, Any], key: str, count: int, largest: float = _LARGEST_NUMBER
) -> list[float]:
    """Return a list of numbers; zeros if the key is missing."""
    values = entry.get(key, [0.0] * count)
    if not isinstance(values, list) or len(values) != count:
        raise ts.OptionError(f"{where}: {key} is {values!r}; write {count} numbers")
    return [_number(where, {key: value}, key, 0.0, -largest, largest) for value in values]


def _number(where: str, entry: dict[str, Any], key: str, usual: float, low: float, high: float) -> float:
    value = entry.get(key, usual)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise ts.OptionError(f"{where}: {key} is {value!r}; write a number from {low:g} to {high:g}")
    return float(value)


def layout_text(folder: Path, layout: Layout) -> str:
    """Return a layout in TOML, for :func:`read_layout`; files are named from the folder.

    Raises
    ------
    OptionError
        For names that are not UTF-8, as TOML is.
    """
    tables = []
    own = [unbent(layer.transform) for layer in layout.layers]
    cameras = [transform for transform in own if isinstance(transform, CameraTransform)]
    if cameras or layout.wrap is not None:
        radius, projection = (cameras[0].radius, cameras[0].projection) if cameras else (1.0, "sphere")
        fov = cameras[0].fov if cameras else None
        view = {"projection": projection, "radius": float(radius), "wrap": layout.wrap, "fov": fov}
        tables.append(_table("[view]", view))
    if layout.boundary is not None:
        base = cast(PlaneTransform, layout.boundary.base)
        at = [round(edge) for edge in base.matrix[:2, 2]]
        tables.append(_table("[boundary]", {"at": at, **_mesh_entry(layout.boundary)}))
    if layout.options:
        tables.append(_table("[stitch]", layout.options))
    if (labels := layout.labels) is not None:
        values = {"file": named_from(folder, labels.file), "at": list(labels.at), "scale": labels.scale}
        tables.append(_table("[labels]", values))
    for layer in layout.layers:
        masks = {"mask": layer.mask, "keep": layer.keep}
        entry = {
            "file": named_from(folder, layer.file),
            "name": layer.name,
            **_transform_entry(layer.transform),
            **{key: named_from(folder, file) for key, file in masks.items() if file is not None},
        }
        tables.append(_table("[[layer]]", entry))
    for stroke in layout.strokes:
        entry = {**asdict(stroke), "layer": layout.layers[stroke.layer].name}
        tables.append(_table("[[stroke]]", entry))
    return "\n\n".join(tables) + "\n"


def named_from(folder: Path, file: Path) -> str:
    """Name a file from a folder, as a layout does."""
    return Path(os.path.relpath(real_path(file), real_path(folder))).as_posix()


def _table(head: str, values: Mapping[str, Any]) -> str:
    """Return a table in TOML; values that are None are left out."""
    lines = (f"{key} = {_value(value)}" for key, value in values.items() if value is not None)
    return "\n".join([head, *lines])


def _value(value: Any) -> str:
    """Return a value in TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{key} = {_value(one)}' for key, one in value.items())} }}"
    if not isinstance(value, str):
        return repr(value)
    if any("\ud800" <= character <= "\udfff" for character in value):
        raise ts.OptionError(f"a layout cannot name '{value}', which is not UTF-8; rename the file")
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _mesh_entry(mesh: MeshTransform) -> dict[str, Any]:
    x, y = (plane.tolist() for plane in np.moveaxis(mesh.coefficients, -1, 0))
    return {"size": list(mesh.size), "cell": mesh.cell, "x": x, "y": y}


def _transform_entry(transform: Transform) -> dict[str, Any]:
    """Return the keys of a layer's transform, which give :func:`settled` of it when they are read."""
    transform = settled(transform)
    if isinstance(transform, MeshTransform):
        mesh = _mesh_entry(transform)
        if isinstance(transform.base, PlaneTransform):
            return {"matrix": transform.base.matrix.tolist(), "mesh": mesh}
        return {**_transform_entry(transform.base), "mesh": mesh}
    if isinstance(transform, CameraTransform):
        yaw, pitch, roll = (round(angle, 10) + 0.0 for angle in angles_of(transform.rotation))
        return {
            "size": list(transform.size),
            "yaw": yaw,
            "pitch": pitch,
            "roll": roll,
            "focal": float(transform.focal),
            "lens": [float(value) for value in transform.lens],
            "shift": [float(value) for value in transform.shift],
        }
    matrix = cast(PlaneTransform, transform).matrix
    if is_move(transform):
        return {"at": [round(matrix[0, 2]), round(matrix[1, 2])]}
    if (found := as_similarity(transform)) is not None:
        x, y, turn, scale = found
        at = [round(x, 6) + 0.0, round(y, 6) + 0.0]
        return {"at": at, "turn": round(turn, 10) + 0.0, "scale": round(scale, 12)}
    return {"matrix": matrix.tolist()}
