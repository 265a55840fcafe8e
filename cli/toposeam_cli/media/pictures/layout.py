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
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import toposeam as ts
from toposeam_cli.files.tables import read_table

_KEYS = ("file", "at", "name", "mask", "keep", "visible", "turn", "scale")
#: As many as an OpenRaster file may have.
_MOST_LAYERS = 1000
_FARTHEST_PX = 10**9


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutLayer:
    """A picture of a layout."""

    file: Path
    at: tuple[float, float]
    name: str
    mask: Path | None = None
    keep: Path | None = None
    #: Degrees clockwise, and a factor.
    turn: float = 0.0
    scale: float = 1.0


def read_layout(path: Path) -> list[LayoutLayer]:
    """Return the visible layers of a layout in TOML or JSON, by its extension, in the order of the file.

    Raises
    ------
    OptionError
        If it cannot be read or says something that makes no sense; the text tells where.
    """
    table, _ = read_table(path, "a layout")
    if not isinstance(table, dict) or set(table) - {"layer"} or not isinstance(table.get("layer"), list):
        surplus = ", ".join(sorted(set(table) - {"layer"})) if isinstance(table, dict) else ""
        found = f"it has {surplus}" if surplus else "it has none"
        raise ts.OptionError(
            f"'{path}' must hold layers, [[layer]], and nothing else, but {found}; correct it"
        )
    if len(table["layer"]) > _MOST_LAYERS:
        raise ts.OptionError(f"'{path}' has {len(table['layer'])} layers; keep to {_MOST_LAYERS} at most")
    layers = [_layer(path, number, entry) for number, entry in enumerate(table["layer"], start=1)]
    visible = [layer for layer in layers if layer is not None]
    names = [layer.name for layer in visible]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ts.OptionError(f"'{path}' has two layers called {twice!r}; give each a name of its own")
    return visible


def _layer(path: Path, number: int, entry: Any) -> LayoutLayer | None:
    where = f"'{path}', layer {number}"
    if not isinstance(entry, dict):
        raise ts.OptionError(f"{where} is {entry!r}; write its keys, at least file and at")
    unknown = sorted(set(entry) - set(_KEYS))
    if unknown:
        raise ts.OptionError(
            f"{where} has {unknown[0]!r}, which is none of {', '.join(_KEYS)}; correct or remove it"
        )
    for key in ("file", "name", "mask", "keep"):
        if key in entry and (not isinstance(entry[key], str) or not entry[key].strip()):
            raise ts.OptionError(f"{where}: {key} is {entry[key]!r}; write a text")
    if "file" not in entry or "at" not in entry:
        raise ts.OptionError(
            f"{where} has no {'file' if 'file' not in entry else 'at'}; say which picture lies where, as at "
            "= [120, -4]"
        )
    turn, scale = (
        _number(where, entry, *limits) for limits in (("turn", 0.0, -180, 180), ("scale", 1.0, 0.1, 10))
    )
    at = entry["at"]
    kinds = int if turn == 0 and scale == 1 else int | float
    fits = (
        isinstance(at, list)
        and len(at) == 2
        and all(isinstance(value, kinds) and not isinstance(value, bool) for value in at)
    )
    if fits and max(map(abs, at)) > _FARTHEST_PX:
        raise ts.OptionError(f"{where}: at is {at!r}, which lies too far away; nine digits are the most")
    if not fits or not max(map(abs, at)) <= _FARTHEST_PX:
        raise ts.OptionError(f"{where}: at is {at!r}; write two whole numbers of pixels, as at = [120, -4]")
    if not isinstance(entry.get("visible", True), bool):
        raise ts.OptionError(f"{where}: visible is {entry['visible']!r}; write true or false")
    if not entry.get("visible", True):
        return None
    folder = path.parent
    mask, keep = (folder / entry[key] if key in entry else None for key in ("mask", "keep"))
    return LayoutLayer(
        file=folder / entry["file"],
        at=(at[0], at[1]),
        name=entry.get("name", Path(entry["file"]).name),
        mask=mask,
        keep=keep,
        turn=turn,
        scale=scale,
    )


def _number(where: str, entry: dict[str, Any], key: str, usual: float, low: float, high: float) -> float:
    value = entry.get(key, usual)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise ts.OptionError(f"{where}: {key} is {value!r}; write a number from {low:g} to {high:g}")
    return float(value)


def layout_text(folder: Path, layers: Sequence[LayoutLayer]) -> str:
    """Return a layout in TOML, for :func:`read_layout`; files in or below the folder are named from there.

    Raises
    ------
    OptionError
        For names that are not UTF-8, as TOML is.
    """
    entries = []
    for layer in layers:
        file = os.path.relpath(layer.file.resolve(), folder.resolve())
        turned = layer.turn != 0 or layer.scale != 1
        x, y = (f"{value:.3f}" if turned else f"{round(value)}" for value in layer.at)
        if any("\udc80" <= character <= "\udcff" for character in file + layer.name):
            raise ts.OptionError(f"a layout cannot name '{file}', which is not UTF-8; rename the file")
        lines = [
            "[[layer]]",
            f"file = {json.dumps(Path(file).as_posix(), ensure_ascii=False)}",
            f"at = [{x}, {y}]",
        ]
        lines.append(f"name = {json.dumps(layer.name, ensure_ascii=False)}")
        if turned:
            lines += [f"turn = {layer.turn:.6f}", f"scale = {layer.scale:.8f}"]
        entries.append("\n".join(lines))
    return "\n\n".join(entries) + "\n"
