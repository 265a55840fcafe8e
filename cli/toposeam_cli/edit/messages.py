"""What page and server say to each other: JSON from the page, JSON with blocks of bytes to it."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

#: Longest message from a page, bytes, and most points of a stroke.
LONGEST, _MOST_POINTS = 1 << 18, 4096
#: Largest radius and distance, px of the preview.
_FARTHEST = 1e5
_KINDS = ("show", "hide", "away")
FORMATS = ("jpg", "png", "tif", "webp", "ora")
#: The crop that is drawn on the page.
BY_HAND = "box"
#: Settings that a page may choose, and their values.
SETTINGS: dict[str, tuple[str, ...]] = {
    "model": ("auto", "shift", "similarity", "plane", "rotation"),
    "projection": ("auto", "flat", "cylinder", "sphere", "panini"),
    "level": ("yes", "no"),
    "blend": ("auto", "none", "feather", "soft", "multiband", "gradient"),
    "tones": ("none", "gains", "shading"),
    "crop": ("fit", "inside", "outside", BY_HAND),
}


class MessageError(ValueError):
    """A message that no page of ours sends."""


def packed(kind: str, head: dict[str, Any], blocks: Sequence[bytes] = ()) -> bytes:
    """Return a message to the page: the length of the JSON, the JSON, and the blocks that it counts."""
    text = json.dumps({**head, "kind": kind, "sizes": [len(block) for block in blocks]}).encode()
    return struct.pack("<I", len(text)) + text + b"".join(blocks)


def parsed(text: str) -> dict[str, Any]:
    """Return a message of the page with only the values it may have.

    Raises
    ------
    MessageError
        For anything else.
    """
    return parsed_by(_MEANINGS, text)


def parsed_by(
    meanings: Mapping[str, Callable[[dict[str, Any]], dict[str, Any]]], text: str
) -> dict[str, Any]:
    """Return a message of a page whose kinds have such meanings; raises as :func:`parsed`."""
    if len(text) > LONGEST:
        raise MessageError("too long")
    try:
        message = json.loads(text)
        return meanings[message["kind"]](message) | {"kind": message["kind"]}
    except (ValueError, KeyError, TypeError, RecursionError, OverflowError) as error:
        raise MessageError(str(error)) from error


def _stroke(message: dict[str, Any]) -> dict[str, Any]:
    return {
        "id": whole_number(message["id"]),
        "done": message["done"] is True,
        "stroke": {
            "kind": one_of(message["stroke"], _KINDS),
            "layer": whole_number(message["layer"]),
            **_line(message),
        },
    }


def pairs(message: dict[str, Any], least: int, most: int) -> list[list[float]]:
    """Return the points of a message, from `least` to `most` pairs of numbers."""
    points = message["points"]
    if not isinstance(points, list) or not least <= len(points) <= most:
        raise MessageError("points")
    found = [[number(value) for value in point] for point in points]
    if any(len(pair) != 2 for pair in found):
        raise MessageError("points")
    return found


def _line(message: dict[str, Any]) -> dict[str, Any]:
    points = pairs(message, 1, _MOST_POINTS)
    radius = number(message["radius"])
    if radius <= 0:
        raise MessageError("radius")
    return {"points": points, "radius": radius}


def _point(message: dict[str, Any]) -> dict[str, Any]:
    return {"x": number(message["x"]), "y": number(message["y"])}


def _rectangle(message: dict[str, Any]) -> list[float]:
    (left, top), (width, height) = pairs({"points": message["box"]}, 2, 2)
    if min(width, height) < 1:
        raise MessageError("box")
    return [max(0.0, left), max(0.0, top), width, height]


def _settings(message: dict[str, Any]) -> dict[str, Any]:
    given = message["settings"]
    return {"settings": {name: one_of(given[name], SETTINGS[name]) for name in given}}


def number(value: Any) -> float:
    """Return a finite number, or refuse it."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise MessageError("number")
    if abs(value) > _FARTHEST:
        raise MessageError("number")
    return float(value)


def whole_number(value: Any) -> int:
    """Return a whole number from 0 on, or refuse it."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**31:
        raise MessageError("whole number")
    return value


def one_of(value: Any, known: Sequence[str]) -> str:
    """Return a word that is known, or refuse it."""
    if value not in known:
        raise MessageError("choice")
    return str(value)


def _nothing(message: dict[str, Any]) -> dict[str, Any]:
    return {}


_MEANINGS: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
    "stroke": _stroke,
    "erase": _line,
    "horizon": lambda message: {"points": pairs(message, 2, 2)},
    "crop": lambda message: {"box": _rectangle(message)},
    "undo": _nothing,
    "redo": _nothing,
    "refresh": _nothing,
    "take": lambda message: {**_point(message), "layer": whole_number(message["layer"])},
    "other": _point,
    "blend": lambda message: {"box": [whole_number(value) for value in message["box"]][:4]},
    "settings": _settings,
    "save": lambda message: {"format": one_of(message["format"], FORMATS)},
    "cancel": _nothing,
    "takeover": _nothing,
    "open": lambda message: {"files": [whole_number(number) for number in message["files"]][:1000]},
    "resume": lambda message: {"work": whole_number(message["work"])},
    "sample": lambda message: {"sample": whole_number(message["sample"])},
    "forget": lambda message: {"work": whole_number(message["work"])},
    "start": _nothing,
}
