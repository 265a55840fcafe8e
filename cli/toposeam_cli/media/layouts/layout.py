"""Layouts: small files that say which pictures lie where.

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
B-spline on square cells, those of the picture's first pixel in the second row and column::

    mesh = { size = [512, 384], cell = 32.0, x = [[0.0, 0.1, …], …], y = [[0.0, 0.0, …], …] }
"""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
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
    is_move,
    similarity,
    unbent,
)
from toposeam_cli.files.regular import real_path
from toposeam_cli.files.tables import read_table
from toposeam_cli.media.layouts.camera_angles import angles_of, turned_camera

_KEYS = ("file", "name", "mask", "keep", "visible", "mesh")
#: Keys of a layer's transform, of which a layer has one group: a place, a matrix or a camera.
_PLACE, _MATRIX = ("at", "turn", "scale"), ("matrix",)
_CAMERA = ("size", "yaw", "pitch", "roll", "focal", "lens", "shift")
_VIEW = ("projection", "radius", "wrap", "fov")
#: Most layers of a layout, as of an OpenRaster file.
_MOST_LAYERS = 1000
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
class Layout:
    """Pictures and where they lie."""

    layers: tuple[LayoutLayer, ...]
    #: Width of a canvas that is a whole turn, px; else None.
    wrap: int | None = None


def read_layout(path: Path) -> Layout:
    """Return the visible layers of a layout in TOML or JSON, by its extension, in the order of the file.

    Raises
    ------
    OptionError
        If it cannot be read or has an invalid value; the text names the place.
    """
    table, _ = read_table(path, "a layout")
    known = {"layer", "view"}
    if not isinstance(table, dict) or set(table) - known or not isinstance(table.get("layer"), list):
        surplus = ", ".join(sorted(set(table) - known)) if isinstance(table, dict) else ""
        found = f"it has {surplus}" if surplus else "it has none"
        raise ts.OptionError(
            f"'{path}' must hold layers, [[layer]], and perhaps [view], but {found}; correct it"
        )
    if len(table["layer"]) > _MOST_LAYERS:
        raise ts.OptionError(f"'{path}' has {len(table['layer'])} layers; keep to {_MOST_LAYERS} at most")
    view = _view(path, table.get("view"))
    layers = [_layer(path, number, entry, view) for number, entry in enumerate(table["layer"], start=1)]
    visible = [layer for layer in layers if layer is not None]
    names = [layer.name for layer in visible]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ts.OptionError(f"'{path}' has two layers called {twice!r}; give each a name of its own")
    return Layout(layers=tuple(visible), wrap=view.wrap)


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
        name=entry.get("name", Path(entry["file"]).name),
        transform=transform,
        mask=mask,
        keep=keep,
    )


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


def _mesh(where: str, entry: Any, base: Transform) -> Transform:
    """Return a transform bent by the mesh of a layout."""
    where = f"{where}, mesh"
    if not isinstance(entry, dict) or set(entry) != {"size", "cell", "x", "y"}:
        raise ts.OptionError(f"{where} is {entry!r}; write its size, cell, x and y")
    width, height = (round(side) for side in _numbers(where, entry, "size", 2))
    cell = _number(where, entry, "cell", math.nan, 1, _LARGEST_NUMBER)
    rows, columns = (math.ceil(side / cell) + 3 for side in (height, width))
    planes = []
    for key in ("x", "y"):
        given = entry[key]
        if not isinstance(given, list) or len(given) != rows:
            raise ts.OptionError(f"{where}: {key} is not {rows} rows of {columns} numbers; write these")
        planes.append([_numbers(where, {key: row}, key, columns) for row in given])
    return MeshTransform(base, (width, height), cell, np.moveaxis(np.array(planes), 0, -1))


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
    """Return a layout in TOML, for :func:`read_layout`; files in or below the folder are named from there.

    Raises
    ------
    OptionError
        For names that are not UTF-8, as TOML is.
    """
    entries = []
    own = [unbent(layer.transform) for layer in layout.layers]
    cameras = [transform for transform in own if isinstance(transform, CameraTransform)]
    if cameras or layout.wrap is not None:
        radius, projection = (cameras[0].radius, cameras[0].projection) if cameras else (1.0, "sphere")
        lines = ["[view]", f"projection = {json.dumps(projection)}", f"radius = {radius!r}"]
        if layout.wrap is not None:
            lines.append(f"wrap = {layout.wrap}")
        if cameras and cameras[0].fov is not None:
            lines.append(f"fov = {cameras[0].fov!r}")
        entries.append("\n".join(lines))
    for layer in layout.layers:
        file = os.path.relpath(real_path(layer.file), real_path(folder))
        if any("\udc80" <= character <= "\udcff" for character in file + layer.name):
            raise ts.OptionError(f"a layout cannot name '{file}', which is not UTF-8; rename the file")
        lines = [
            "[[layer]]",
            f"file = {json.dumps(Path(file).as_posix(), ensure_ascii=False)}",
            f"name = {json.dumps(layer.name, ensure_ascii=False)}",
            *_transform_lines(layer.transform),
        ]
        entries.append("\n".join(lines))
    return "\n\n".join(entries) + "\n"


def _transform_lines(transform: Transform) -> list[str]:
    if isinstance(transform, MeshTransform):
        x, y = (plane.round(4).tolist() for plane in np.moveaxis(transform.coefficients, -1, 0))
        mesh = f"{{ size = {list(transform.size)}, cell = {transform.cell!r}, x = {x!r}, y = {y!r} }}"
        if isinstance(transform.base, PlaneTransform):
            return [f"matrix = {transform.base.matrix.tolist()!r}", f"mesh = {mesh}"]
        return [*_transform_lines(transform.base), f"mesh = {mesh}"]
    if isinstance(transform, CameraTransform):
        yaw, pitch, roll = angles_of(transform.rotation)
        values = {
            "size": list(transform.size),
            "yaw": yaw,
            "pitch": pitch,
            "roll": roll,
            "focal": float(transform.focal),
            "lens": [float(value) for value in transform.lens],
            "shift": [float(value) for value in transform.shift],
        }
        return [f"{key} = {value!r}" for key, value in values.items()]
    matrix = cast(PlaneTransform, transform).matrix
    if is_move(transform):
        return [f"at = [{round(matrix[0, 2])}, {round(matrix[1, 2])}]"]
    if not matrix[2, :2].any() and matrix[0, 0] == matrix[1, 1] and matrix[0, 1] == -matrix[1, 0]:
        a, b = matrix[:2, 0] / matrix[2, 2]
        x, y = matrix[:2, 2] / matrix[2, 2]
        return [
            f"at = [{x:.3f}, {y:.3f}]",
            f"turn = {math.degrees(math.atan2(b, a)):.6f}",
            f"scale = {math.hypot(a, b):.8f}",
        ]
    return [f"matrix = {matrix.tolist()!r}"]
