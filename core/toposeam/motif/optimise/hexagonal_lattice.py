"""Layers on a hexagonal lattice: densities at the nodes of a sheared cell, and the rectangular printed tile.

The lattice vectors are (1, 0) and (-1/2, √3/2) cells. A rectangle of 1 × √3 cells holds two cells and repeats
by translation.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import gcd

import numpy as np
import numpy.typing as npt
from scipy.ndimage import map_coordinates, spline_filter, uniform_filter1d

from toposeam.arrays import Floats, Ints
from toposeam.heat.plate_triangles import TrianglePlate
from toposeam.motif.optimise.conduction import SPOT_RADIUS, LayerProblem, filter_radius, power, void_of
from toposeam.motif.recipe.recipe import LayerRecipe, Point, Recipe
from toposeam.motif.symmetry.rules import symmetry

#: Offsets of lattice points to search for the nearest one, which may lie beyond the cell's border.
_AROUND = [(u, v) for u in (-1, 0, 1) for v in (-1, 0, 1)]
#: Side of the square round a lattice point that a base image covers, in cells.
_BASE_WIDTH = 1.0


def tile_size(cells: int) -> tuple[int, int]:
    """Return rows and columns of the rectangular tile of a cell with that many elements along its sides."""
    return round(cells * np.sqrt(3.0)), cells


@dataclass(frozen=True, eq=False)
class HexagonalProblem(LayerProblem):
    """A layer with densities at nodes; a triangle's density is the mean of its corners'."""

    @classmethod
    def at(
        cls, layer: LayerRecipe, recipe: Recipe, shape: tuple[int, int], taken: Floats | None = None
    ) -> LayerProblem:
        """Return the layer of a recipe on a cell of the given shape; `taken` is the ink before it."""
        orbits = symmetry(recipe.repeat, shape)
        nominal, domain = cls.nominal_of(recipe, shape), cls.domain_of(layer, recipe, shape)
        spots = (_spots(points, shape) for points in (layer.sources, layer.sinks))
        plate = TrianglePlate(*cls.loads(layer, orbits, nominal, domain, *spots))
        radius, free = filter_radius(recipe, shape), cls.left_free(layer, recipe, shape, taken, domain)
        return cls(plate, _at_triangles(nominal), orbits, recipe.repeat, radius, void_of(layer), free, domain)

    @staticmethod
    def reduced(density: Floats, repeat: str, shape: tuple[int, int]) -> Floats:
        """Take every second, fourth … node."""
        step = len(density) // shape[0]
        return density[::step, ::step]

    @staticmethod
    def base_on_elements(
        brightness: npt.NDArray[np.float32], shape: tuple[int, int]
    ) -> npt.NDArray[np.floating]:
        """Resample a base image, upright round every lattice point."""
        return _shown_round_lattice_points(brightness, shape)

    def conductivity(self, density: Floats, penalty: Floats | float) -> Floats:
        """Compute the conductivity of every triangle, (2, h, w)."""
        return super().conductivity(_at_triangles(density), penalty)

    def sensitivity(self, density: Floats, penalty: Floats | float, energy: Floats) -> Floats:
        """Compute ∂Π/∂ρ of every node: the sum of a third of that of each of its six triangles."""
        slope = power(_at_triangles(density), penalty - 1.0)
        slope *= -(1.0 - self.void) * penalty / 3
        slope *= self.nominal
        slope *= energy
        first, second = slope
        both = first + second
        nodes: Floats = both + np.roll(both, (1, 1), (0, 1)) + np.roll(first, 1, 1) + np.roll(second, 1, 0)
        return nodes

    def refine(self, density: Floats, shape: tuple[int, int]) -> Floats:
        """Interpolate the densities on a lattice with twice as many nodes along each side."""
        return refined(density, shape)


def refined(nodes: npt.NDArray[np.floating], shape: tuple[int, int]) -> Floats:
    """Interpolate a lattice on another number of nodes along each side."""
    rows, columns = (np.arange(many) * (side / many) for many, side in zip(shape, nodes.shape, strict=True))
    v, u = np.meshgrid(rows, columns, indexing="ij")
    fine: Floats = map_coordinates(nodes, [v, u], order=3, mode="grid-wrap")
    return fine


def _at_triangles(nodes: Floats) -> Floats:
    """Average the corners of the first and of the second triangle of every rhombus: (2, h, w)."""
    right, below, opposite = np.roll(nodes, -1, 1), np.roll(nodes, -1, 0), np.roll(nodes, (-1, -1), (0, 1))
    return np.stack([nodes + right + opposite, nodes + below + opposite]) / 3


def _spots(points: tuple[Point, ...], shape: tuple[int, int]) -> Floats:
    """Return discs round points in the lattice's metric, with relative strengths, as a field of sum 1."""
    side = shape[0]
    radius = max(SPOT_RADIUS * side, 0.75)
    field, along = np.zeros(shape), np.arange(side)
    reach = (radius + 0.5) * 2 / np.sqrt(3.0)
    for x, y, strength in points:
        spot = np.zeros(shape)
        for i, j in _AROUND:
            du, dv = along - (x + i) * side, along - (y + j) * side
            near = np.ix_(np.abs(dv) <= reach, np.abs(du) <= reach)
            across, down = du[near[1]], dv[near[0]]
            gap = across * across + down * down - across * down
            spot[near] = np.maximum(spot[near], np.clip(radius + 0.5 - np.sqrt(gap), 0.0, 1.0))
        field += spot * (strength / spot.sum())
    total = field.sum()
    return field / total if total > 0 else field


def _shown_round_lattice_points(brightness: npt.NDArray[np.float32], shape: tuple[int, int]) -> Floats:
    """Resample a picture, upright round every lattice point, with a longer side of one cell."""
    side = shape[0]
    v, u = np.meshgrid(np.arange(side) / side, np.arange(side) / side, indexing="ij")
    x, y, gap = np.zeros(shape), np.zeros(shape), np.full(shape, np.inf)
    for i, j in _AROUND:
        px, py = (u + i) - (v + j) / 2, (v + j) * np.sqrt(0.75)
        nearer = np.hypot(px, py) < gap
        gap[nearer] = np.hypot(px, py)[nearer]
        x[nearer], y[nearer] = px[nearer], py[nearer]
    rows, columns = brightness.shape
    scale = max(rows, columns) / _BASE_WIDTH
    resampled: Floats = map_coordinates(
        brightness.astype(np.float64),
        [y * scale + rows / 2, x * scale + columns / 2],
        order=1,
        mode="nearest",
    )
    return resampled


def to_tile(lattice: npt.NDArray[np.floating], repeat: str, size: tuple[int, int]) -> npt.NDArray[np.float32]:
    """Resample densities at a lattice's nodes to a rectangular tile, (rows, columns) float32.

    Cubic splines along the lattice vectors are averaged over the turns by 120°, so that the tile has the
    whole symmetry of the group. On 2n × 2n pixels every node of an n × n lattice lies on the centre of a
    pixel: node (u, v) in row v and column 2u - v.
    """
    side = lattice.shape[0]
    field = lattice.astype(np.float64)
    shrink = max(side / size[1], np.sqrt(3.0) * side / size[0])
    if shrink > 1:
        width = 2 * round(shrink / 2) + 1
        for axis in (0, 1):
            field = uniform_filter1d(field, width, axis=axis, mode="wrap")
        field = symmetry(repeat, lattice.shape).mean(field)
    coefficients = np.pad(spline_filter(field, order=3, mode="grid-wrap"), (1, 2), mode="wrap")
    v = 2 * side * ((np.arange(size[0]) + 0.5) / size[0] - 0.25 / side)
    x = side * ((np.arange(size[1]) + 0.5) / size[1] - 0.25 / side)
    level, falling = _rows_between(coefficients, v), _rows_between(coefficients.T, -v)
    common = gcd(side, size[1])
    whole = np.arange(common) * (side // common)  # pixels of a row that lie whole nodes from each other
    apart = size[1] // common
    result = np.empty(size)
    for first in range(apart):
        at = x[first]
        result[:, first::apart] = (
            _columns_between(level, at + v / 2, whole)
            + _columns_between(falling, at - v / 2, whole)
            + _nodes_between(coefficients, -at - v / 2, v / 2 - at, -whole)
        )
    return np.clip(result / 3, 0.0, 1.0).astype(np.float32)


def _rows_between(coefficients: Floats, places: Floats) -> Floats:
    """Interpolate rows of a spline, (n + 3, n + 3) with its margins: (places, n + 3)."""
    whole, weights = _spline_weights(places)
    rows = whole % (len(coefficients) - 3)
    lines = np.zeros((len(places), coefficients.shape[1]))
    for tap, weight in enumerate(weights):
        lines += weight[:, np.newaxis] * coefficients[rows + tap]
    return lines


def _columns_between(lines: Floats, places: Floats, moved: Ints) -> Floats:
    """Interpolate each line at its own place and at whole distances from it: (lines, distances)."""
    whole, weights = _spline_weights(places)
    wide = lines.shape[1]
    at = (whole[:, np.newaxis] + moved) % (wide - 3) + wide * np.arange(len(lines))[:, np.newaxis]
    flat, found = lines.ravel(), np.zeros(at.shape)
    for tap, weight in enumerate(weights):
        found += weight[:, np.newaxis] * flat[tap:].take(at)
    return found


def _nodes_between(coefficients: Floats, rows: Floats, columns: Floats, moved: Ints) -> Floats:
    """Interpolate a spline at places, and at whole distances from them along both: (places, distances)."""
    (down, weights), (across, beside) = _spline_weights(rows), _spline_weights(columns)
    wide = coefficients.shape[1]
    at = (down[:, np.newaxis] + moved) % (wide - 3) * wide + (across[:, np.newaxis] + moved) % (wide - 3)
    flat, found = coefficients.ravel(), np.zeros(at.shape)
    for row, weight in enumerate(weights):
        for column, other in enumerate(beside):
            found += (weight * other)[:, np.newaxis] * flat[row * wide + column :].take(at)
    return found


def _spline_weights(places: Floats) -> tuple[Ints, tuple[Floats, Floats, Floats, Floats]]:
    """Return the whole part of places, and the weights of the four nodes round each by cubic B-splines."""
    whole = np.floor(places).astype(np.int64)
    after = places - whole
    before = 1 - after
    inner = [(4 - 6 * part**2 + 3 * part**3) / 6 for part in (after, before)]
    return whole, (before**3 / 6, inner[0], inner[1], after**3 / 6)
