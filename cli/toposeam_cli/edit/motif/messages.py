"""What the page of motifs says to the server."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import toposeam as ts
from toposeam.motif.recipe import STYLES
from toposeam.motif.symmetry import shift_of
from toposeam_cli.edit.messages import (
    MessageError,
    number,
    one_of,
    pairs,
    parsed_by,
    whole_number,
)

#: Most inks of a motif on the page: two textures of four channels hold them.
MOST_LAYERS = 8
#: Endings of files that show the motif growing, and all kinds of files that are saved.
GROWTHS = (".webp", ".mp4", ".growing.svg")
FORMATS = ("png", "tif", "svg", "pdf", "toml", *(ending[1:] for ending in GROWTHS))
#: Sliders, and the ranges of their values.
SLIDERS = {"mass": (0.05, 0.7), "ambient": (0.0, 1.0), "penalty": (1.0, 6.0), "filter_radius": (0.0, 8.0)}
#: Most motifs across and down a saved sheet, and px of one.
_MOST_COUNT, _MOST_PX = 32, 8192
_ROLES = ("sources", "sinks")
#: Most places that one line lays.
_MOST_SPOTS = 60


def parsed(text: str) -> dict[str, Any]:
    """Return a message of the page with only the values it may have.

    Raises
    ------
    MessageError
        For anything else.
    """
    return parsed_by(_MEANINGS, text)


def _dice(message: dict[str, Any]) -> dict[str, Any]:
    return {
        "seed": whole_number(message["seed"]),
        "style": None if message["style"] is None else one_of(message["style"], tuple(STYLES)),
        "repeat": None if message["repeat"] is None else _rule(message),
    }


def _repeat(message: dict[str, Any]) -> dict[str, Any]:
    return {"repeat": _rule(message)}


def _rule(message: dict[str, Any]) -> str:
    rule = message["repeat"]
    if isinstance(rule, str) and shift_of(rule) is not None:
        return rule
    return one_of(rule, ts.motif.REPEATS)


def _set(message: dict[str, Any]) -> dict[str, Any]:
    name = one_of(message["name"], tuple(SLIDERS))
    low, high = SLIDERS[name]
    value = number(message["value"])
    if not low <= value <= high:
        raise MessageError("value")
    return {"name": name, "value": value, "layer": _layer(message), "done": message["done"] is True}


def _layer(message: dict[str, Any]) -> int | None:
    return None if message["layer"] is None else whole_number(message["layer"])


def _inside(message: dict[str, Any], most: int) -> list[list[float]]:
    found = pairs(message, 1, most)
    if any(not 0 <= value <= 1 for pair in found for value in pair):
        raise MessageError("points")
    return found


def _radius(message: dict[str, Any]) -> float:
    radius = number(message["radius"])
    if not 0 < radius <= 1:
        raise MessageError("radius")
    return radius


def _add(message: dict[str, Any]) -> dict[str, Any]:
    return {
        "layer": _layer(message),
        "role": one_of(message["role"], _ROLES),
        "points": _inside(message, _MOST_SPOTS),
    }


def _move(message: dict[str, Any]) -> dict[str, Any]:
    return {
        "layer": whole_number(message["layer"]),
        "role": one_of(message["role"], _ROLES),
        "index": whole_number(message["index"]),
        "points": _inside(message, 1),
        "done": message["done"] is True,
    }


def _line(message: dict[str, Any]) -> dict[str, Any]:
    return {"points": _inside(message, 2048), "radius": _radius(message)}


def _colour(value: Any) -> list[float]:
    if not isinstance(value, list) or len(value) != 3:
        raise MessageError("colour")
    found = [number(channel) for channel in value]
    if any(not 0 <= channel <= 1 for channel in found):
        raise MessageError("colour")
    return found


def _colours(message: dict[str, Any]) -> dict[str, Any]:
    inks = message["inks"]
    if not isinstance(inks, list) or not 1 <= len(inks) <= MOST_LAYERS:
        raise MessageError("inks")
    return {
        "paper": _colour(message["paper"]),
        "inks": [_colour(ink) for ink in inks],
        "inking": one_of(message["inking"], ("transparent", "opaque")),
        "done": message["done"] is True,
    }


def _layers(message: dict[str, Any]) -> dict[str, Any]:
    count = whole_number(message["count"])
    if not 1 <= count <= MOST_LAYERS:
        raise MessageError("count")
    return {"count": count}


def _save(message: dict[str, Any]) -> dict[str, Any]:
    columns, rows, px = (whole_number(message[name]) for name in ("columns", "rows", "px"))
    if not (1 <= columns <= _MOST_COUNT and 1 <= rows <= _MOST_COUNT and 16 <= px <= _MOST_PX):
        raise MessageError("size")
    return {"format": one_of(message["format"], FORMATS), "columns": columns, "rows": rows, "px": px}


def _nothing(message: dict[str, Any]) -> dict[str, Any]:
    return {}


_MEANINGS: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
    "dice": _dice,
    "style": lambda message: {"style": one_of(message["style"], tuple(STYLES)), "layer": _layer(message)},
    "repeat": _repeat,
    "set": _set,
    "layers": _layers,
    "colours": _colours,
    "add": _add,
    "move": _move,
    "wall": _line,
    "erase": _line,
    "relatives": lambda message: {"seed": whole_number(message["seed"])},
    "relative": lambda message: {"number": whole_number(message["number"])},
    "finish": _nothing,
    "undo": _nothing,
    "redo": _nothing,
    "save": _save,
    "cancel": _nothing,
    "takeover": _nothing,
}
