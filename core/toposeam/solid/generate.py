r"""A motif in three dimensions: material that conducts heat down a block.

Heat is generated at the recipe's sources, at random heights, and everywhere (`ambient`). It leaves through
the sinks on the floor. Material of a given mass is optimised as on a plate: conductivities
k (ε + (1 - ε) ρ^p), the filter, optimality criteria, from coarse to fine. The rule of repetition holds on
every horizontal slice: p4m makes a rosette, and a rule that joins a motif to itself joins the block.

*Projection.* A cube is solid where its density exceeds the level above which as many cubes lie as the mass
allows. Only pieces that stand on the floor are kept, so that the solid can be printed, and of these only
pieces with at least a tenth of the largest one's cubes. Marching cubes find the surface. It is closed: floor,
ceiling and sides are part of it.
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
from toposeam.motif.generate import MAX_MEGAPIXELS, check_work
from toposeam.motif.optimise.conduction import MIN_DENSITY, VOID, power
from toposeam.motif.optimise.layer import TOLERANCE
from toposeam.motif.recipe.recipe import LayerRecipe, Point, Recipe
from toposeam.motif.symmetry.rules import GENERATORS, Symmetry, symmetry
from toposeam.optimize.oc import OCOptions, oc_step
from toposeam.volume.mesh import Mesh, closed_mesh

#: Rules that a block can have: those whose neighbouring cells are neither turned nor shifted.
REPEATS = ("none", "reflect", "translate", *GENERATORS)
#: Largest number of cubes, for the memory, and the least side, in cubes.
_MAX_CUBES, _MIN_SIDE = 4_200_000, 8
#: Least side of a coarser block, in cubes.
_MIN_COARSE_SIDE = 12
#: Iterations at full size, and on each block between that and the coarsest.
_FINEST_ITERATIONS, _MIDDLE_ITERATIONS = 5, 8
#: Radius of the filter, in cubes.
_FILTER_RADIUS = 1.5
#: Radius of sources and sinks, as a share of the block's shortest side.
_SPOT_RADIUS = 0.03
#: Range of the heights of sources, as shares of the depth.
_SOURCE_HEIGHTS = (0.45, 1.0)
#: Convection of all sinks together, relative to the conductivity.
_CONVECTION = 4.0
#: Pieces with fewer cubes than this share of the largest piece are dropped.
_MIN_PIECE = 0.1


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Solid:
    """Result of :func:`generate_solid`.

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
    #: The recipe, which makes the solid again together with the depth.
    recipe: Recipe
    #: Thermal compliance of every iteration's design.
    history: tuple[float, ...]

    @property
    def filled(self) -> npt.NDArray[np.bool_]:
        """(d, h, w) bool: True in the solid, of which every piece stands on the floor."""
        return self._projected()[0] > 0

    @property
    def pieces(self) -> int:
        """Number of pieces that are connected by the floor only."""
        return int(ndimage.label(self.filled, np.ones((3, 3, 3)))[1])

    def mesh(self, element: float = 1.0) -> Mesh:
        """Return the closed surface of the solid, facing outwards; every edge lies between two triangles.

        Parameters
        ----------
        element : float
            Side of one cube, in mm.

        Raises
        ------
        OptionError
        OverlapError
            When no piece stands on the floor.
        """
        check_range(0, 1e6, above=True, element=element)
        return closed_mesh(self._projected()[0], element)

    def _projected(self) -> tuple[npt.NDArray[np.float32], float]:
        """Return the density minus the level of equal mass, and that level.

        The difference is positive on the pieces that are kept, and only there.
        """
        field = ndimage.gaussian_filter(self.density, 0.5, mode="nearest")
        level = float(np.quantile(field, 1.0 - float(self.density.mean())))
        above = field - np.float32(level)
        pieces, _ = ndimage.label(above > 0, np.ones((3, 3, 3)))
        standing = np.unique(pieces[0])
        cubes = np.bincount(pieces.ravel())[standing[standing > 0]]
        kept = standing[standing > 0][cubes >= _MIN_PIECE * cubes.max(initial=0)]
        above[(above > 0) & ~np.isin(pieces, kept)] = -1e-3
        return above, level

    def __repr__(self) -> str:
        depth, rows, columns = self.density.shape
        return (
            f"Solid({columns} × {rows} × {depth} cubes, repeat={self.recipe.repeat!r}, "
            f"seed={self.recipe.seed})"
        )


def generate_solid(
    recipe: Recipe,
    depth: int,
    *,
    max_megapixels: float = MAX_MEGAPIXELS,
    progress: Callable[[float], None] | None = None,
) -> Solid:
    """Generate a solid by heat conduction in a block.

    Parameters
    ----------
    recipe : Recipe
        Recipe of a motif with one layer. Its size is the block's plan; its sources, sinks, mass, penalty and
        rule are the block's. The filter's radius is not used, and a base image is refused.
    depth : int
        Height of the block, in cubes.
    max_megapixels : float
        As for :func:`toposeam.motif`, for cubes.
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
    check_whole("depth", depth, _MIN_SIDE)
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
    layer = recipe.layers[0]
    for name, unknown in (
        ("base", recipe.base),
        ("outline", recipe.outline),
        ("guide", recipe.guide),
        ("one_piece", recipe.one_piece),
        ("scale", layer.scale > 1),
    ):
        if unknown:
            raise OptionError(
                "a solid knows no {parameter}; leave it out", kind="conflict", parameter=Term(name)
            )
    shape = (depth, *recipe.size)
    if math.prod(shape) > _MAX_CUBES or min(shape) < _MIN_SIDE:
        raise OptionError(
            "the block has {width} × {height} × {depth} cubes; give sides from {least}, and {most:,} cubes "
            "at most",
            kind="shape",
            parameter=Term("depth"),
            value=depth,
            width=shape[2],
            height=shape[1],
            depth=depth,
            least=_MIN_SIDE,
            most=_MAX_CUBES,
        )
    check_work(recipe, max_megapixels, depth)
    with one_thread():
        return _optimise(recipe, shape, progress)


def _optimise(recipe: Recipe, shape: tuple[int, int, int], progress: Callable[[float], None] | None) -> Solid:
    layer = recipe.layers[0]
    plan = _coarse_to_fine(shape, recipe.iterations)
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
            density = _symmetric_slices(orbits, _refine(density))
            density = np.clip(density * (layer.mass / density.mean()), MIN_DENSITY, 1.0)
            warm = None if warm is None else _refine(warm)
        for _ in range(count):
            k = VOID + (1 - VOID) * power(density, layer.penalty)
            state = block.solve(k, warm, tolerance=TOLERANCE)
            warm = state.cubes
            slope = -(1 - VOID) * layer.penalty * power(density, layer.penalty - 1) * state.energy
            density = _update(
                density, _filter_sensitivities(density, slope, joined), layer.mass, recipe.move, orbits
            )
            history.append(state.compliance)
            if progress is not None:
                progress(_share_done(plan, len(history)))
    assert density is not None  # noqa: S101
    return Solid(density=density.astype(np.float32), recipe=recipe, history=tuple(history))


def _coarse_to_fine(shape: tuple[int, int, int], iterations: int) -> list[tuple[tuple[int, int, int], int]]:
    """Return the shapes of blocks from coarse to fine, with the number of iterations on each."""
    shapes = [shape]
    while len(shapes) < 4 and all(side % 4 == 0 and side // 2 >= _MIN_COARSE_SIDE for side in shapes[0]):
        d, h, w = shapes[0]
        shapes.insert(0, (d // 2, h // 2, w // 2))
    counts, left = [0] * len(shapes), iterations
    for index in range(len(shapes) - 1, 0, -1):
        counts[index] = min(left, _FINEST_ITERATIONS if index == len(shapes) - 1 else _MIDDLE_ITERATIONS)
        left -= counts[index]
    counts[0] = left
    return [(size, count) for size, count in zip(shapes, counts, strict=True) if count]


def _share_done(plan: list[tuple[tuple[int, int, int], int]], iterations: int) -> float:
    """Return the share of the work done after some iterations, by the number of cubes of each."""
    whole = sum(math.prod(size) * count for size, count in plan)
    so_far = 0.0
    for size, count in plan:
        so_far += math.prod(size) * min(count, iterations)
        iterations -= min(count, iterations)
    return so_far / whole


def _loads(
    layer: LayerRecipe, seed: int, shape: tuple[int, int, int], orbits: Symmetry
) -> tuple[Floats, Floats]:
    """Compute the heat load, of sum 1, and the convection of every cube."""
    rng = np.random.default_rng([seed, 3])
    heights = rng.uniform(*_SOURCE_HEIGHTS, len(layer.sources))
    sources = _spots(layer.sources, heights, shape)
    sinks = _spots(layer.sinks, np.zeros(len(layer.sinks)), shape)
    heat = (1 - layer.ambient) * sources + layer.ambient / math.prod(shape)
    return _symmetric_slices(orbits, heat), _symmetric_slices(orbits, _CONVECTION * sinks)


def _spots(points: tuple[Point, ...], heights: Floats, shape: tuple[int, int, int]) -> Floats:
    """Return balls round points, with the given relative strengths, as a field of sum 1."""
    radius = max(_SPOT_RADIUS * min(shape), 0.9)
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


def _symmetric_slices(orbits: Symmetry, field: Floats) -> Floats:
    """Average a field over the rule's orbits on every horizontal slice."""
    if orbits.orbit is None:
        return field
    return np.stack([orbits.mean(floor) for floor in field])


def _filter_sensitivities(density: Floats, slope: Floats, joined: bool) -> Floats:
    """Filter sensitivities as on plates: weighted means of ρ ∂Π/∂ρ over the neighbours, divided by ρ."""
    reach = math.ceil(_FILTER_RADIUS) - 1
    weights = _FILTER_RADIUS - np.abs(np.arange(-reach, reach + 1))
    wide = density * slope
    for axis in range(3):
        mode = "wrap" if joined and axis else "nearest"
        wide = ndimage.correlate1d(wide, weights / weights.sum(), axis=axis, mode=mode)
    result: Floats = wide / density
    return result


def _update(density: Floats, slope: Floats, mass: float, limit: float, orbits: Symmetry) -> Floats:
    """Compute the next design by a step of the optimality criteria."""
    found = oc_step(
        density.ravel(), slope.ravel(), 1.0, mass * density.size, MIN_DENSITY, 1.0, OCOptions(move=limit)
    )
    return _symmetric_slices(orbits, found.reshape(density.shape))


def _refine(field: Floats) -> Floats:
    """Interpolate a field linearly on cubes of half the side."""
    for axis in range(3):
        before = np.take(field, np.maximum(np.arange(field.shape[axis]) - 1, 0), axis)
        after = np.take(field, np.minimum(np.arange(field.shape[axis]) + 1, field.shape[axis] - 1), axis)
        pair = np.stack([0.75 * field + 0.25 * before, 0.75 * field + 0.25 * after], axis + 1)
        shape = list(field.shape)
        shape[axis] *= 2
        field = pair.reshape(shape)
    return field
