"""Optimisation of one layer: minimal compliance under a mass bound (thesis 4.3, 4.4), by optimality criteria.

*Coarse to fine.* A plate of half the size has the same conductances where its strokes are the same, so most
iterations run on plates of a quarter and half the size, and the densities are interpolated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats
from toposeam.motif.optimise.conduction import MIN_DENSITY, LayerProblem, filter_radius
from toposeam.motif.optimise.hexagonal_lattice import HexagonalProblem
from toposeam.motif.recipe.recipe import LayerRecipe, Recipe
from toposeam.motif.symmetry.mirrors import mirrors
from toposeam.motif.symmetry.rules import HEXAGONAL, Symmetry, joint
from toposeam.optimize.oc import OCOptions, oc_step

#: The solver (see `heat.conjugate`) stops at a residual of `TOLERANCE` times the load or, usually earlier,
#: once a step gains less than `ENERGY` times the compliance. Designs are as good as those of exact
#: temperatures, to three digits.
TOLERANCE, ENERGY = 1e-3, 1e-4
#: Least side of a coarser plate, in elements.
MIN_COARSE_SIDE = 48
#: Least radius of the filter at full size, in elements, for which coarser plates are used: they cannot hold
#: finer strokes.
_MIN_COARSE_RADIUS = 2.5
#: Largest radius of the filter, in hundredths of the cell, at which mirrors are balanced: the factors of rows
#: would cut wider strokes along straight lines, and these cross mirrors by themselves.
_MAX_BALANCED_RADIUS = 1.0
#: Iterations at full size, and on each plate between that and the coarsest.
_FINEST_ITERATIONS, _MIDDLE_ITERATIONS = 5, 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One iteration of one layer.

    Examples
    --------
    >>> import toposeam as ts
    >>> motif = ts.motif(16, layers=1, seed=1, iterations=3, coarse=False)
    >>> [step.rows for step in motif.history[0]]
    [16, 16, 16]
    """

    #: Rows of elements of the plate.
    rows: int
    #: Compliance, for unit heat, of the design before the step.
    compliance: float
    #: Mean density of that design.
    mass: float
    #: Iterations of the solver.
    solver: int


def plan(recipe: Recipe) -> list[tuple[tuple[int, int], int]]:
    """Return the shapes of plates from coarse to fine, with the number of iterations on each."""
    shapes = [recipe.size]
    grain = 4 if recipe.repeat not in ("none", "reflect") else 2
    coarse = recipe.coarse and filter_radius(recipe, recipe.size) >= _MIN_COARSE_RADIUS
    while (
        coarse
        and len(shapes) < 4
        and all(side % grain == 0 and side // 2 >= MIN_COARSE_SIDE for side in shapes[0])
        and joint(recipe.repeat).fits((shapes[0][0] // 2, shapes[0][1] // 2))
    ):
        shapes.insert(0, (shapes[0][0] // 2, shapes[0][1] // 2))
    counts = [0] * len(shapes)
    left = recipe.iterations
    for index in range(len(shapes) - 1, 0, -1):
        counts[index] = min(left, _FINEST_ITERATIONS if index == len(shapes) - 1 else _MIDDLE_ITERATIONS)
        left -= counts[index]
    counts[0] = left
    return [(shape, count) for shape, count in zip(shapes, counts, strict=True) if count]


def problem_at(
    layer: LayerRecipe, recipe: Recipe, shape: tuple[int, int], taken: Floats | None = None
) -> LayerProblem:
    """Pose a layer of a recipe on a plate of the given shape; `taken` is the ink before it, at full size."""
    kind = HexagonalProblem if recipe.repeat in HEXAGONAL else LayerProblem
    return kind.at(layer, recipe, shape, taken)


def is_balanced(layer: LayerRecipe, recipe: Recipe) -> bool:
    """Test whether a layer's mass is balanced at mirrors."""
    return layer.style != "thesis" and recipe.filter_radius <= _MAX_BALANCED_RADIUS


def optimise_layer(
    recipe: Recipe,
    taken: Floats | None = None,
    progress: Callable[[int, Floats], None] | None = None,
) -> tuple[npt.NDArray[np.float32], tuple[Step, ...]]:
    """Optimise the one layer of a recipe.

    Parameters
    ----------
    recipe : Recipe
        Of one layer, see :meth:`Recipe.of_layer`.
    taken : (h, w) float array, optional
        Ink of the layers before it, which it may avoid.
    progress : callable, optional
        Called with the number of iterations done, and the density after them on its plate.

    Returns
    -------
    density : (h, w) float32 array in [0, 1]
    history : tuple of Step
    """
    layer = recipe.layers[0]
    steps: list[Step] = []
    density: Floats | None = None
    temperature: Floats | None = None
    for shape, count in plan(recipe):
        problem = problem_at(layer, recipe, shape, taken)
        density = (
            np.full(shape, layer.mass) if density is None else refine_density(density, problem, layer.mass)
        )
        if temperature is not None:
            temperature = refine_temperature(temperature, shape)
        for _ in range(count):
            density, temperature, step = advance(problem, recipe, density, temperature)
            steps.append(step)
            if progress is not None:
                progress(len(steps), density)
    assert density is not None  # noqa: S101
    return density.astype(np.float32), tuple(steps)


def advance(
    problem: LayerProblem, recipe: Recipe, density: Floats, temperature: Floats | None
) -> tuple[Floats, Floats, Step]:
    """Take one iteration of the one layer of a recipe.

    Parameters
    ----------
    problem : LayerProblem
        The layer on its plate.
    recipe : Recipe
    density : (h, w) float array
    temperature : (h + 1, w + 1) float array or None
        A guess: that of the iteration before.

    Returns
    -------
    density, temperature : float arrays
        The next density, and the temperatures of the one given.
    step : Step
    """
    layer = recipe.layers[0]
    state = problem.plate.solve(
        problem.conductivity(density, layer.penalty), temperature, tolerance=TOLERANCE, energy=ENERGY
    )
    step = Step(
        rows=len(density),
        compliance=state.compliance,
        mass=float(density.mean()),
        solver=state.iterations,
    )
    slope = problem.filter_sensitivity(density, problem.sensitivity(density, layer.penalty, state.energy))
    options = OCOptions(move=recipe.move)
    proposed = update(density, slope, problem.symmetry, layer.mass, options, upper=problem.upper)
    if is_balanced(layer, recipe):
        lowest, highest = (
            np.maximum(density - recipe.move, MIN_DENSITY),
            np.minimum(density + recipe.move, problem.upper),
        )
        proposed = mirrors(recipe.repeat, problem.symmetry.shape).balance(
            proposed, layer.mass, lowest, highest, wash=layer.edge != "crisp"
        )
    return proposed, state.nodes, step


def update(
    density: Floats,
    slope: Floats,
    orbits: Symmetry,
    mass: float,
    options: OCOptions,
    lower: Floats | float = MIN_DENSITY,
    upper: Floats | float = 1.0,
) -> Floats:
    """Compute the next design, with one variable per orbit.

    Bounds given as fields must be constant along the orbits.
    """
    count = orbits.count
    x = orbits.total(density) / count
    low, high = (
        bound if isinstance(bound, float) else orbits.total(bound) / count for bound in (lower, upper)
    )
    weights = count if orbits.orbit is not None else 1.0
    return orbits.spread(oc_step(x, orbits.total(slope), weights, mass * density.size, low, high, options))


def refine_temperature(nodes: Floats, shape: tuple[int, int]) -> Floats:
    """Interpolate the temperatures of a plate of half the shape."""
    fine = np.empty((shape[0] + 1, shape[1] + 1))
    fine[::2, ::2] = nodes
    fine[1::2, ::2] = (nodes[:-1] + nodes[1:]) / 2
    fine[:, 1::2] = (fine[:, :-2:2] + fine[:, 2::2]) / 2
    return fine


def refine_density(density: Floats, problem: LayerProblem, mass: float) -> Floats:
    """Interpolate a coarser plate's densities on a finer one, with the given mass."""
    fine = problem.symmetry.mean(problem.refine(density, problem.plate.shape))
    fine = np.clip(fine, MIN_DENSITY, 1.0)
    scaled: Floats = np.clip(fine * (mass / fine.mean()), MIN_DENSITY, 1.0)
    return scaled
