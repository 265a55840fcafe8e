"""Find the places of the layers of a request on GIMP's canvas."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

import toposeam as ts
from toposeam.images import full_scale
from toposeam.layers.canvas.largest_rectangle import largest_full

#: Options of :func:`toposeam.find_places`.
_PLACE_OPTIONS = ("model", "projection", "level")


class PlacedLayers(NamedTuple):
    """Layers in their places."""

    layers: list[ts.Layer]
    #: Their numbers among the given layers.
    numbers: list[int]
    #: The placement that was found; None if places were given.
    placement: ts.layers.Placement | None = None

    @property
    def about(self) -> dict[str, Any]:
        """The part of the answer that GIMP tells its user about the places."""
        found = self.placement
        if found is None:
            return {"numbers": self.numbers}
        apart = {number for group in found.other_groups for number in group}
        return {
            "numbers": self.numbers,
            "strangers": [number for number in found.left_out if number not in apart],
            "other_groups": [list(group) for group in found.other_groups],
            "misfits": [
                {"between": [self.numbers[i], self.numbers[j]], "off": round(residual.farthest, 1)}
                for (i, j), residual in found.misfits
            ],
            "doubts": list(found.doubts),
            "goes_round": found.wrap is not None,
        }


def placed(
    layers: Sequence[ts.Layer], options: dict[str, Any], progress: Callable[[float], None]
) -> PlacedLayers:
    """Remove the options of places from `options`, and find the places by them."""
    places = options.pop("places", "given")
    scans = options.pop("pictures", "photographs") == "scans"
    chosen = {name: options.pop(name) for name in _PLACE_OPTIONS if name in options}
    if places == "given":
        return PlacedLayers(list(layers), list(range(len(layers))))
    if places == "near":
        return PlacedLayers(list(ts.layers.align(layers).layers), list(range(len(layers))))
    if places != "anywhere":
        raise ts.OptionError(f"places is {places!r}; give 'given', 'near' or 'anywhere'")
    if scans:
        found = ts.find_places(layers, exact=True, progress=progress)
    else:
        if chosen.get("model", "auto") not in ("auto", "rotation"):
            chosen.pop("projection", None)  # cameras only
        found = ts.find_places(layers, **chosen, progress=progress)
    return PlacedLayers(_on_canvas(found.layers, layers[found.numbers[0]].at), list(found.numbers), found)


def _on_canvas(layers: Sequence[ts.Layer], first: tuple[int, int]) -> list[ts.Layer]:
    """Move layers together so that the first one keeps its place.

    If that would put a layer left of the canvas or above it, all are moved just onto the canvas.
    """
    left, top = (min(layer.at[axis] for layer in layers) for axis in (0, 1))
    x, y = layers[0].at
    return moved(layers, max(first[0] - x, -left), max(first[1] - y, -top))


def moved(layers: Sequence[ts.Layer], right: int, down: int) -> list[ts.Layer]:
    """Return the layers moved right and down by px."""
    return [dataclasses.replace(layer, at=(layer.at[0] + right, layer.at[1] + down)) for layer in layers]


def framed(
    layers: Sequence[ts.Layer], found: ts.layers.Composition, *, crop: bool
) -> tuple[list[ts.Layer], ts.layers.Composition, list[int]]:
    """Move everything so that a canvas from 0,0 holds it, or its largest rectangle without holes.

    Also returns the width and height of that canvas.
    """
    height, width = found.shape
    box = None
    if crop and found.alpha is not None:
        box = largest_full(np.asarray(found.alpha == full_scale(found.alpha.dtype)))
    top, left, bottom, right = box or (0, 0, height, width)
    x, y = found.origin[0] + left, found.origin[1] + top
    return moved(layers, -x, -y), found.moved(-x, -y), [right - left, bottom - top]
