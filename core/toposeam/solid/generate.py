r"""A motif's third dimension: the ways that heat takes down a block.

A block stands on its floor. Heat enters at the recipe's sources, which lie at random heights, and everywhere
(`ambient`); it leaves by its sinks, on the floor. Material of a given mass goes where it helps, by the same
steps as on a plate: k (ε + (1 - ε) ρ^p), the filter, optimality criteria, from coarse to fine. The rule of
repetition holds on every floor: p4m makes a rosette, and what joins itself to the side does so as a block.

*Projected.* What is solid in the end is where the density exceeds the level that leaves as much as the mass.
Of that, only pieces which stand on the floor are kept, so that it can be printed, and no crumbs: those with
less than a tenth of the largest piece. Its surface is found by marching cubes, and is closed: floor, ceiling
and sides are part of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats
from toposeam.checks import check_function, check_kind, check_range, check_whole
from toposeam.errors import OptionError, Term
from toposeam.heat.block import Block
from toposeam.heat.threads import one_thread
from toposeam.motif.optimise.conduction import VOID, power
from toposeam.motif.optimise.layer import THINNEST, TOLERANCE
from toposeam.motif.recipe.recipe import LayerRecipe, Point, Recipe
from toposeam.motif.symmetry.rules import GENERATORS, Symmetry, symmetry
from toposeam.optimize.oc import OCOptions, oc_step
from toposeam.volume.mesh import Mesh, closed_mesh

#: Rules that a block can have: those of one cell that are the same on every floor.
REPEATS = ("none", "reflect", "translate", *GENERATORS)
#: Most cubes, and the least side.
_MOST, _LEAST = 4_200_000, 8
#: Coarser blocks have at least so many cubes across.
_COARSEST = 12
#: Iterations at full size and on the blocks between.
_LAST, _BETWEEN = 5, 8
#: Radius of the filter, cubes, and of sources and sinks, as a share of the shortest side.
_SMOOTH, _SPOT = 1.5, 0.03
#: Heights of random sources.
_HEIGHTS = (0.45, 1.0)
#: Convection of all sinks together.
_CONVECTION = 4.0
#: Pieces with less than this share of the largest one's cubes are crumbs.
_CRUMB = 0.1


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Solid:
    """What :func:`generate_solid` returns.

    Examples
    --------
    >>> import toposeam as ts
    >>> recipe = ts.motif.random_recipe(16, layers=1, seed=1, iterations=6)
    >>> solid = ts.solid.generate_solid(recipe, 16)
    >>> solid.density.shape
    (16, 16, 16)
    """

    #: (d, h, w) float32 in [0, 1], the floor first.
    density: npt.NDArray[np.float32]
    #: Makes it again, together with the depth.
    recipe: Recipe
    #: Compliance of every iteration's design.
    history: tuple[float, ...]

    @property
    def filled(self) -> npt.NDArray[np.bool_]:
        """(d, h, w): where it is solid, and holds together with the floor."""
        return self._projected()[0] > 0

    @property
    def pieces(self) -> int:
        """How many pieces it has that only the floor holds together."""
        return int(ndimage.label(self.filled, np.ones((3, 3, 3)))[1])

    def mesh(self, element: float = 1.0) -> Mesh:
        """Its surface: closed, every edge between two triangles, facing outwards.

        Parameters
        ----------
        element : float
            Side of one cube, in mm.

        Raises
        ------
        OptionError
        OverlapError
            When nothing stands on the floor.
        """
        check_range(0, 1e6, above=True, element=element)
        return closed_mesh(self._projected()[0], element)

    def _projected(self) -> tuple[npt.NDArray[np.float32], float]:
        """The density above (below: under 0) the level of equal mass; below it everywhere but on the pieces
        that are kept.
        """
        field = ndimage.gaussian_filter(self.density, 0.5, mode="nearest")
        level = float(np.quantile(field, 1.0 - float(self.density.mean())))
        above = field - np.float32(level)
        pieces, _ = ndimage.label(above > 0, np.ones((3, 3, 3)))
        standing = np.unique(pieces[0])
        cubes = np.bincount(pieces.ravel())[standing[standing > 0]]
        kept = standing[standing > 0][cubes >= _CRUMB * cubes.max(initial=0)]
        above[(above > 0) & ~np.isin(pieces, kept)] = -1e-3
        return above, level

    def __repr__(self) -> str:
        depth, rows, columns = self.density.shape
        return (
            f"Solid({columns} × {rows} × {depth} cubes, repeat={self.recipe.repeat!r}, "
            f"seed={self.recipe.seed})"
        )


def generate_solid(recipe: Recipe, depth: int, *, progress: Callable[[float], None] | None = None) -> Solid:
    """Let heat build a solid.

    Parameters
    ----------
    recipe : Recipe
        Of a motif with one layer: its size is the block's plan, its sources, sinks, mass, penalty and rule
        are the block's. Base images and the filter's radius are not used.
    depth : int
        The block's height, in cubes.
    progress : callable, optional
        Called with the share done, in [0, 1].

    Returns
    -------
    Solid
        The same for the same recipe and depth.

    Raises
    ------
    OptionError

    Examples
    --------
    >>> import toposeam as ts
    >>> recipe = ts.motif.random_recipe(16, layers=1, seed=1, iterations=6, repeat="p4m")
    >>> ts.solid.generate_solid(recipe, 24).mesh(2.5).closed
    True
    """
    check_function("progress", progress)
    check_kind("recipe", recipe, Recipe, "a Recipe")
    check_whole("depth", depth, _LEAST)
    if len(recipe.layers) != 1:
        raise OptionError(
            "the recipe has {count} layers; a solid is of one material, give one",
            kind="count",
            parameter=Term("layers"),
            count=len(recipe.layers),
        )
    if recipe.repeat not in REPEATS:
        raise OptionError(
            "{parameter} {value} has no block; use one of {allowed}",
            kind="choice",
            parameter=Term("repeat"),
            value=recipe.repeat,
            allowed=tuple(REPEATS),
        )
    if recipe.base:
        raise OptionError(
            "a solid knows no base image; leave it out", kind="conflict", parameter=Term("base")
        )
    shape = (depth, *recipe.size)
    if math.prod(shape) > _MOST or min(shape) < _LEAST:
        raise OptionError(
            "the block has {width} × {height} × {depth} cubes; give sides from {least}, and {most:,} cubes "
            "at most",
            kind="shape",
            parameter=Term("depth"),
            value=depth,
            width=shape[2],
            height=shape[1],
            depth=depth,
            least=_LEAST,
            most=_MOST,
        )
    with one_thread():
        return _optimised(recipe, shape, progress)


def _optimised(
    recipe: Recipe, shape: tuple[int, int, int], progress: Callable[[float], None] | None
) -> Solid:
    layer = recipe.layers[0]
    plan = _plan(shape, recipe.iterations)
    density: Floats | None = None
    warm: Floats | None = None
    history: list[float] = []
    for size, count in plan:
        orbits = symmetry(recipe.repeat, (size[1], size[2]))
        joined = recipe.repeat not in ("none", "reflect")
        block = Block(*_loads(layer, recipe.seed, size, orbits), joined)
        if density is None:
            density = np.full(size, layer.mass)
        else:
            density = _on_floors(orbits, _doubled(density))
            density = np.clip(density * (layer.mass / density.mean()), THINNEST, 1.0)
            warm = None if warm is None else _doubled(warm)
        for _ in range(count):
            k = VOID + (1 - VOID) * power(density, layer.penalty)
            state = block.solve(k, warm, tolerance=TOLERANCE)
            warm = state.cubes
            slope = -(1 - VOID) * layer.penalty * power(density, layer.penalty - 1) * state.energy
            density = _moved(density, _filtered(density, slope, joined), layer.mass, recipe.move, orbits)
            history.append(state.compliance)
            if progress is not None:
                progress(_done(plan, len(history)))
    assert density is not None  # noqa: S101
    return Solid(density=density.astype(np.float32), recipe=recipe, history=tuple(history))


def _plan(shape: tuple[int, int, int], iterations: int) -> list[tuple[tuple[int, int, int], int]]:
    """Blocks from coarse to fine, and how many iterations run on each."""
    shapes = [shape]
    while len(shapes) < 4 and all(side % 4 == 0 and side // 2 >= _COARSEST for side in shapes[0]):
        d, h, w = shapes[0]
        shapes.insert(0, (d // 2, h // 2, w // 2))
    counts, left = [0] * len(shapes), iterations
    for index in range(len(shapes) - 1, 0, -1):
        counts[index] = min(left, _LAST if index == len(shapes) - 1 else _BETWEEN)
        left -= counts[index]
    counts[0] = left
    return [(size, count) for size, count in zip(shapes, counts, strict=True) if count]


def _done(plan: list[tuple[tuple[int, int, int], int]], iterations: int) -> float:
    """The share of all cubes that were worked on."""
    whole = sum(math.prod(size) * count for size, count in plan)
    so_far = 0.0
    for size, count in plan:
        so_far += math.prod(size) * min(count, iterations)
        iterations -= min(count, iterations)
    return so_far / whole


def _loads(
    layer: LayerRecipe, seed: int, shape: tuple[int, int, int], orbits: Symmetry
) -> tuple[Floats, Floats]:
    """Heat, one in all, and convection."""
    rng = np.random.default_rng([seed, 3])
    heights = rng.uniform(*_HEIGHTS, len(layer.sources))
    sources = _spots(layer.sources, heights, shape)
    sinks = _spots(layer.sinks, np.zeros(len(layer.sinks)), shape)
    heat = (1 - layer.ambient) * sources + layer.ambient / math.prod(shape)
    return _on_floors(orbits, heat), _on_floors(orbits, _CONVECTION * sinks)


def _spots(points: tuple[Point, ...], heights: Floats, shape: tuple[int, int, int]) -> Floats:
    """Balls with the given relative strengths, one in all."""
    radius = max(_SPOT * min(shape), 0.9)
    z, y, x = (np.arange(side) + 0.5 for side in shape)
    field = np.zeros(shape)
    for (px, py, strength), pz in zip(points, heights, strict=True):
        away = np.sqrt(
            (z[:, None, None] - pz * shape[0]) ** 2
            + (y[:, None] - py * shape[1]) ** 2
            + (x - px * shape[2]) ** 2
        )
        ball = np.clip(radius + 0.5 - away, 0.0, 1.0)
        field += ball * (strength / max(ball.sum(), 1e-9))
    whole: Floats = field / max(field.sum(), 1e-9)
    return whole


def _on_floors(orbits: Symmetry, field: Floats) -> Floats:
    """The field with the rule's symmetry on every floor."""
    if orbits.orbit is None:
        return field
    return np.stack([orbits.mean(floor) for floor in field])


def _filtered(density: Floats, slope: Floats, joined: bool) -> Floats:
    """As on plates: means of ρ ∂Π/∂ρ over the neighbours, divided by ρ."""
    reach = math.ceil(_SMOOTH) - 1
    weights = _SMOOTH - np.abs(np.arange(-reach, reach + 1))
    wide = density * slope
    for axis in range(3):
        mode = "wrap" if joined and axis else "nearest"
        wide = ndimage.correlate1d(wide, weights / weights.sum(), axis=axis, mode=mode)
    result: Floats = wide / density
    return result


def _moved(density: Floats, slope: Floats, mass: float, limit: float, orbits: Symmetry) -> Floats:
    """The next design."""
    found = oc_step(
        density.ravel(), slope.ravel(), 1.0, mass * density.size, THINNEST, 1.0, OCOptions(move=limit)
    )
    return _on_floors(orbits, found.reshape(density.shape))


def _doubled(field: Floats) -> Floats:
    """On cubes of half the side, linearly interpolated."""
    for axis in range(3):
        before = np.take(field, np.maximum(np.arange(field.shape[axis]) - 1, 0), axis)
        after = np.take(field, np.minimum(np.arange(field.shape[axis]) + 1, field.shape[axis] - 1), axis)
        pair = np.stack([0.75 * field + 0.25 * before, 0.75 * field + 0.25 * after], axis + 1)
        shape = list(field.shape)
        shape[axis] *= 2
        field = pair.reshape(shape)
    return field
