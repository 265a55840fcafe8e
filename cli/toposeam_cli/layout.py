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
"""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import toposeam as ts

_KEYS = ("file", "at", "name", "mask", "keep", "visible")
_LARGEST_BYTES = 16 * 2**20
_FARTHEST_PX = 10**9


@dataclass(frozen=True, slots=True, kw_only=True)
class LayoutLayer:
    """A picture of a layout."""

    file: Path
    at: tuple[int, int]
    name: str
    mask: Path | None = None
    keep: Path | None = None


def read_layout(path: Path) -> list[LayoutLayer]:
    """The visible layers of a layout in TOML or JSON, by its extension, in the order of the file.

    Raises
    ------
    OptionError
        If it cannot be read or says something that makes no sense; the text tells where.
    """
    table = _parse(path)
    if not isinstance(table, dict) or set(table) - {"layer"} or not isinstance(table.get("layer"), list):
        surplus = ", ".join(sorted(set(table) - {"layer"})) if isinstance(table, dict) else ""
        found = f"it has {surplus}" if surplus else "it has none"
        raise ts.OptionError(f"'{path}' must hold layers, [[layer]], and nothing else, but {found}; correct it")
    layers = [_layer(path, number, entry) for number, entry in enumerate(table["layer"], start=1)]
    visible = [layer for layer in layers if layer is not None]
    names = [layer.name for layer in visible]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ts.OptionError(f"'{path}' has two layers called {twice!r}; give each a name of its own")
    return visible


def _parse(path: Path) -> Any:
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST_BYTES + 1)
        if len(content) > _LARGEST_BYTES:
            raise ts.OptionError(f"'{path}' is larger than {_LARGEST_BYTES // 2**20} MiB, which is no layout; check its name")
        text = content.decode("utf-8-sig")
    except FileNotFoundError as error:
        raise ts.OptionError(f"there is no file '{path}'; check its name and folder") from error
    except OSError as error:
        raise ts.OptionError(f"cannot read '{path}' ({error.strerror}); check its name and your right to read it") from error
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise ts.OptionError(f"'{path}' is not UTF-8 (at line {line}); save it as UTF-8") from error
    try:
        return json.loads(text) if path.suffix.lower() == ".json" else tomllib.loads(text)
    except RecursionError as error:
        raise ts.OptionError(f"'{path}' is nested too deep; keep to the layout's few keys") from error
    except ValueError as error:
        kind = "JSON" if path.suffix.lower() == ".json" else "TOML"
        raise ts.OptionError(f"'{path}' is not {kind}: {error}; correct that place") from error


def _layer(path: Path, number: int, entry: Any) -> LayoutLayer | None:
    where = f"'{path}', layer {number}"
    if not isinstance(entry, dict):
        raise ts.OptionError(f"{where} is {entry!r}; write its keys, at least file and at")
    unknown = sorted(set(entry) - set(_KEYS))
    if unknown:
        raise ts.OptionError(f"{where} has {unknown[0]!r}, which is none of {', '.join(_KEYS)}; correct or remove it")
    for key in ("file", "name", "mask", "keep"):
        if key in entry and (not isinstance(entry[key], str) or not entry[key].strip()):
            raise ts.OptionError(f"{where}: {key} is {entry[key]!r}; write a text")
    if "file" not in entry or "at" not in entry:
        raise ts.OptionError(f"{where} has no {'file' if 'file' not in entry else 'at'}; say which picture lies where, as at = [120, -4]")
    at = entry["at"]
    whole = isinstance(at, list) and len(at) == 2 and all(isinstance(value, int) and not isinstance(value, bool) for value in at)
    if not whole or max(map(abs, at)) > _FARTHEST_PX:
        raise ts.OptionError(f"{where}: at is {at!r}; write two whole numbers of pixels, as at = [120, -4]")
    if not isinstance(entry.get("visible", True), bool):
        raise ts.OptionError(f"{where}: visible is {entry['visible']!r}; write true or false")
    if not entry.get("visible", True):
        return None
    folder = path.parent
    mask, keep = (folder / entry[key] if key in entry else None for key in ("mask", "keep"))
    return LayoutLayer(
        file=folder / entry["file"], at=(at[0], at[1]), name=entry.get("name", Path(entry["file"]).name), mask=mask, keep=keep
    )
