"""What is drawn on a motif's cell: a recipe, and walls that no stroke crosses."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from toposeam.arrays import Floats, Mask
from toposeam.motif.recipe import Recipe, pack_base, unpack_base
from toposeam.motif.symmetry import HEXAGONAL, operations, shift_of

#: Longest side of the picture that walls are painted on, px: that of a recipe's base.
_BASE_SIDE = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class Wall:
    """A line of a brush that keeps strokes out."""

    #: x and y in cells, along the sides of the cell; for hexagonal groups, along the lattice vectors.
    points: tuple[tuple[float, float], ...]
    #: Half its width, in widths of the cell.
    radius: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Sketch:
    """A motif as it is drawn: everything that undo takes back."""

    #: Without walls.
    recipe: Recipe
    walls: tuple[Wall, ...] = ()

    def whole(self) -> Recipe:
        """Return the recipe with the walls in its base image.

        Walls are black in an image that is else white, or the least conducting tone of the recipe's own.
        """
        recipe = self.recipe
        if not self.walls:
            return recipe
        if recipe.base:
            shown = unpack_base(recipe.base)
            blocked = float(shown.min() if recipe.base_strength >= 0 else shown.max())
            strength, law = recipe.base_strength or 1.0, recipe.base_law
        else:
            shown, blocked, strength, law = _white(recipe), 0.0, 1.0, "brightness"
        walled = np.where(_walled(self, (shown.shape[0], shown.shape[1])), np.float32(blocked), shown)
        return dataclasses.replace(recipe, base=pack_base(walled), base_strength=strength, base_law=law)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, for JSON."""
        return {
            "recipe": self.recipe.to_dict(),
            "walls": [{"points": wall.points, "radius": wall.radius} for wall in self.walls],
        }

    @classmethod
    def from_dict(cls, record: Mapping[str, Any]) -> Sketch:
        """Make a sketch from the values of `to_dict`.

        Raises
        ------
        OptionError, KeyError, TypeError, ValueError
            For other values.
        """
        walls = tuple(
            Wall(points=tuple((float(x), float(y)) for x, y in one["points"]), radius=float(one["radius"]))
            for one in record["walls"]
        )
        return cls(recipe=Recipe.from_dict(record["recipe"]), walls=walls)


def erased(sketch: Sketch, points: Sequence[Sequence[float]], radius: float) -> Sketch:
    """Return a sketch without the sources, sinks and parts of walls under a line of the eraser.

    Parameters
    ----------
    sketch : Sketch
    points : sequence of (x, y), in cells
    radius : float
        In widths of the cell.

    Raises
    ------
    OptionError
        If no source or no sink would be left.
    """
    recipe = sketch.recipe
    layers = []
    for layer in recipe.layers:
        kept = {
            name: tuple(
                spot
                for spot, hit in zip(spots, _touched(recipe, spots, points, radius), strict=True)
                if not hit
            )
            for name, spots in (("sources", layer.sources), ("sinks", layer.sinks))
        }
        layers.append(dataclasses.replace(layer, sources=kept["sources"], sinks=kept["sinks"]))
    walls = []
    for wall in sketch.walls:
        hit = _touched(recipe, wall.points, points, radius + wall.radius / 2)
        runs = np.split(np.arange(len(hit)), np.flatnonzero(np.diff(hit.astype(np.int8))) + 1)
        walls += [
            dataclasses.replace(wall, points=tuple(wall.points[index] for index in run))
            for run in runs
            if len(run) and not hit[run[0]]
        ]
    return Sketch(recipe=dataclasses.replace(recipe, layers=tuple(layers)), walls=tuple(walls))


def _white(recipe: Recipe) -> np.ndarray:
    """Return an even base image of a recipe's shape."""
    rows, columns = recipe.size
    shrink = min(1.0, _BASE_SIDE / max(rows, columns))
    return np.ones((max(1, round(rows * shrink)), max(1, round(columns * shrink))), np.float32)


def _walled(sketch: Sketch, shape: tuple[int, int]) -> Mask:
    """Return which pixels of a base image of a shape lie on walls, (h, w) bool."""
    recipe = sketch.recipe
    h, w = shape
    y, x = np.meshgrid((np.arange(h) + 0.5) / h, (np.arange(w) + 0.5) / w, indexing="ij")
    if recipe.repeat in HEXAGONAL:  # the base stands upright round a lattice point, one cell long
        along = max(h, w)
        y, x = (y - 0.5) * h / along, (x - 0.5) * w / along
    else:
        y = y * recipe.size[0] / recipe.size[1]
    pixels = np.column_stack([x.ravel(), y.ravel()])
    found = np.zeros(h * w, bool)
    for wall in sketch.walls:
        tree = cKDTree(_images(recipe, _dense(wall)))
        near, _ = tree.query(pixels, distance_upper_bound=max(wall.radius, 0.7 / max(h, w)))
        found |= np.isfinite(near)
    return found.reshape(shape)


def _dense(wall: Wall) -> Floats:
    """Return places along a wall, nearer to each other than its radius, not across the cell's border."""
    places = np.array(wall.points, float)
    parts = [places[:1]]
    for first, second in itertools.pairwise(places):
        length = float(np.abs(second - first).max())
        count = max(1, math.ceil(length / max(wall.radius / 2, 1 / 512)))
        if length > 0.5:  # it went on at the opposite border
            parts.append(second[np.newaxis])
        else:
            parts.append(first + (second - first) * (np.arange(1, count + 1) / count)[:, np.newaxis])
    return np.concatenate(parts)


def _images(recipe: Recipe, places: Floats) -> Floats:
    """Return where the rule lays places of a cell, there and in the cells round it, in widths of the cell."""
    found = []
    for (a, b), (c, d), (t, u) in operations(recipe.repeat):
        found.append(places @ np.array([[a, c], [b, d]], float) + np.array([t, u]) / 2)
    inside = np.concatenate(found)
    if recipe.repeat in ("none", "reflect", "rotate"):
        return _on_paper(recipe, inside)
    shift, around = shift_of(recipe.repeat), []
    inside %= 1.0
    for row in (-1, 0, 1):
        for column in (-1, 0, 1):
            moved = np.array([column, row], float)
            if shift is not None:
                axis, share = shift
                moved[1 - axis] += (row if axis == 1 else column) * float(share)
            around.append(inside + moved)
            if shift is not None:  # a row that is moved has copies on both sides
                around.append(inside + moved - np.eye(2)[1 - shift[0]])
    return _on_paper(recipe, np.concatenate(around))


def _on_paper(recipe: Recipe, places: Floats) -> Floats:
    """Return places of a cell on paper, in widths of the cell."""
    if recipe.repeat in HEXAGONAL:
        return np.column_stack([places[:, 0] - places[:, 1] / 2, places[:, 1] * math.sqrt(0.75)])
    on_paper: Floats = places * np.array([1.0, recipe.size[0] / recipe.size[1]])
    return on_paper


def _touched(
    recipe: Recipe,
    spots: Sequence[Sequence[float]],
    points: Sequence[Sequence[float]],
    radius: float,
) -> Mask:
    """Return which spots lie under a line, or have a copy there, (n,) bool."""
    if not spots:
        return np.zeros(0, bool)
    line = _images(recipe, np.array(points, float))
    own = _on_paper(recipe, np.array([spot[:2] for spot in spots], float))
    near, _ = cKDTree(line).query(own, distance_upper_bound=radius)
    return np.asarray(np.isfinite(near))
