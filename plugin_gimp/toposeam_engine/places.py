"""Find the places of the layers of a request on GIMP's canvas."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

import toposeam as ts
from toposeam.images import full_scale
from toposeam.layers.boundary.fit import fitted_boundary
from toposeam.layers.canvas.largest_rectangle import largest_full
from toposeam.layers.canvas.transforms import Transform, fitted_transforms, is_move
from toposeam.layers.canvas.warping import on_canvas
from toposeam.layers.registration.find_places import PlaceOptions, found_places

#: Options of :func:`toposeam.find_places`.
_PLACE_OPTIONS = ("model", "projection", "level")


class PlacedLayers(NamedTuple):
    """Layers in their places."""

    layers: list[ts.Layer]
    #: Their numbers among the given layers.
    numbers: list[int]
    #: The placement that was found; None if places were given.
    placement: ts.layers.Placement | None = None
    #: Whether the canvas is fitted to a rectangle.
    fits: bool = False

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
            "doubts": list(found.doubts),
            "goes_round": found.wrap is not None,
        }


def placed(
    layers: Sequence[ts.Layer], options: dict[str, Any], progress: Callable[[float], None]
) -> PlacedLayers:
    """Remove the options of places from `options`, and find the places by them."""
    places = options.pop("places", "given")
    scans = options.pop("pictures", "photographs") == "scans"
    fits = options.pop("crop", None) == "fit"
    chosen = {name: options.pop(name) for name in _PLACE_OPTIONS if name in options}
    if places == "given":
        return PlacedLayers(list(layers), list(range(len(layers))))
    if places == "near":
        return PlacedLayers(list(ts.layers.align(layers).layers), list(range(len(layers))))
    if places != "anywhere":
        raise ts.OptionError(f"places is {places!r}; give 'given', 'near' or 'anywhere'")
    if scans:
        found = ts.find_places(layers, exact=True, progress=progress)
        return PlacedLayers(_on_canvas(found.layers, layers[found.numbers[0]].at), list(found.numbers), found)
    if chosen.get("model", "auto") not in ("auto", "rotation"):
        chosen.pop("projection", None)  # cameras only

    def laid(
        pictures: Sequence[ts.Layer], transforms: Sequence[Transform], wrap: int | None
    ) -> list[ts.Layer]:
        nonlocal fits
        fits = fits and not all(map(is_move, transforms))
        boundary = fitted_boundary(pictures, transforms, wrap) if fits else None
        bent = fitted_transforms(transforms, boundary, wrap)
        return [on_canvas(*item) for item in zip(pictures, bent, strict=True)]

    found = found_places(layers, PlaceOptions(**chosen), progress, None, laid)
    laid_out = _on_canvas(found.layers, layers[found.numbers[0]].at)
    return PlacedLayers(laid_out, list(found.numbers), found, fits)


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


class Framed(NamedTuple):
    """Layers and their composition on a canvas that begins at 0,0."""

    layers: list[ts.Layer]
    found: ts.layers.Composition
    #: Width and height of the canvas, px.
    size: list[int]
    #: The part of the composition that the canvas shows, with what was filled in it.
    shown: ts.layers.Composition


def framed(place: PlacedLayers, found: ts.layers.Composition, corners: str) -> Framed:
    """Move everything so that a canvas from 0,0 holds all of it (`corners` is "keep"), its largest rectangle
    without holes ("crop"), or the rectangle that is worth most, with slivers to be filled ("fit", but for
    scans and for what was only moved).
    """
    layers, shown = place.layers, found
    if corners == "fit" and place.fits:
        shown = ts.layers.fitted(found)
    if corners != "keep" and shown.alpha is not None:
        box = largest_full(np.asarray(shown.alpha == full_scale(shown.alpha.dtype)))
        shown = shown if box is None else shown.crop(box)
    (x, y), (height, width) = shown.origin, shown.shape
    return Framed(moved(layers, -x, -y), found.moved(-x, -y), [width, height], shown.moved(-x, -y))
