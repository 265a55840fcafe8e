"""One colour layer: minimal compliance under a mass bound (thesis 4.3, 4.4) by optimality criteria.

*Coarse to fine.* A plate of half the size has the same conductances where its strokes are the same, so most
iterations run on plates of a quarter and half the size, and the densities are interpolated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats
from toposeam.motif.optimise.conduction import LayerProblem, filter_radius
from toposeam.motif.optimise.hexagonal_lattice import HexagonalProblem
from toposeam.motif.recipe.recipe import LayerRecipe, Recipe
from toposeam.motif.symmetry.mirrors import mirrors
from toposeam.motif.symmetry.rules import HEXAGONAL, Symmetry, joint
from toposeam.optimize.oc import OCOptions, oc_step

#: Lowest density.
THINNEST = 1e-3
#: Where the solver stops (see `heat.conjugate`): a residual as a share of the load or, most often, what a
#: step gained as a share of the compliance. Designs are as good as with exact temperatures, to three digits.
TOLERANCE, ENERGY = 1e-3, 1e-4
#: Coarser plates have at least this many elements across.
_COARSEST = 48
#: Coarser plates serve where the filter's radius is at least this many elements at full size: finer strokes
#: they cannot hold.
_WIDE = 2.5
#: Iterations at full size and on the plates between, after those on the coarsest.
_LAST, _BETWEEN = 5, 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One iteration of one layer.

    Examples
    --------
    >>> import toposeam as ts
    >>> motif = ts.generate_motif(16, layers=1, seed=1, iterations=3, coarse=False)
    >>> [step.rows for step in motif.history[0]]
    [16, 16, 16]
    """

    #: Rows of elements of the plate it ran on.
    rows: int
    #: Compliance of the design it started from, for unit heat.
    compliance: float
    #: Mean density of that design.
    mass: float
    #: Iterations of the solver.
    solver: int


def plan(recipe: Recipe) -> list[tuple[tuple[int, int], int]]:
    """Return the plates' shapes from coarse to fine, and how many iterations run on each."""
    shapes = [recipe.size]
    grain = 4 if recipe.repeat not in ("none", "reflect") else 2
    coarse = recipe.coarse and filter_radius(recipe, recipe.size) >= _WIDE
    while (
        coarse
        and len(shapes) < 4
        and all(side % grain == 0 and side // 2 >= _COARSEST for side in shapes[0])
        and joint(recipe.repeat).fits((shapes[0][0] // 2, shapes[0][1] // 2))
    ):
        shapes.insert(0, (shapes[0][0] // 2, shapes[0][1] // 2))
    counts = [0] * len(shapes)
    left = recipe.iterations
    for index in range(len(shapes) - 1, 0, -1):
        counts[index] = min(left, _LAST if index == len(shapes) - 1 else _BETWEEN)
        left -= counts[index]
    counts[0] = left
    return [(shape, count) for shape, count in zip(shapes, counts, strict=True) if count]


def problem_at(layer: LayerRecipe, recipe: Recipe, shape: tuple[int, int]) -> LayerProblem:
    """Return the layer of a recipe on a plate of the given shape."""
    kind = HexagonalProblem if recipe.repeat in HEXAGONAL else LayerProblem
    return kind.at(layer, recipe, shape)


def optimise_layer(
    layer: LayerRecipe, recipe: Recipe, progress: Callable[[int], None] | None = None
) -> tuple[npt.NDArray[np.float32], tuple[Step, ...]]:
    """Run a layer's optimisation.

    Parameters
    ----------
    layer : LayerRecipe
    recipe : Recipe
    progress : callable, optional
        Called with the number of iterations done.

    Returns
    -------
    density : (h, w) float32 array in [0, 1]
    history : tuple of Step
    """
    steps: list[Step] = []
    density: Floats | None = None
    temperature: Floats | None = None
    for shape, count in plan(recipe):
        problem = problem_at(layer, recipe, shape)
        density = np.full(shape, layer.mass) if density is None else carry(density, problem, layer.mass)
        if temperature is not None:
            temperature = finer_temperature(temperature, shape)
        for _ in range(count):
            state = problem.plate.solve(
                problem.conductivity(density, layer.penalty),
                temperature,
                tolerance=TOLERANCE,
                energy=ENERGY,
            )
            temperature = state.nodes
            steps.append(
                Step(
                    rows=shape[0],
                    compliance=state.compliance,
                    mass=float(density.mean()),
                    solver=state.iterations,
                )
            )
            slope = problem.filtered(density, problem.sensitivity(density, layer.penalty, state.energy))
            proposed = update(density, slope, problem.symmetry, layer.mass, OCOptions(move=recipe.move))
            lowest, highest = (
                np.maximum(density - recipe.move, THINNEST),
                np.minimum(density + recipe.move, 1),
            )
            density = mirrors(recipe.repeat, shape).held(
                proposed, layer.mass, lowest, highest, wash=layer.edge != "crisp"
            )
            if progress is not None:
                progress(len(steps))
    assert density is not None  # noqa: S101
    return density.astype(np.float32), tuple(steps)


def update(
    density: Floats,
    slope: Floats,
    orbits: Symmetry,
    mass: float,
    options: OCOptions,
    lower: Floats | float = THINNEST,
    upper: Floats | float = 1.0,
) -> Floats:
    """Return the next design; one variable per orbit. Bounds given as fields must be equal along the
    orbits.
    """
    count = orbits.count
    x = orbits.total(density) / count
    low, high = (
        bound if isinstance(bound, float) else orbits.total(bound) / count for bound in (lower, upper)
    )
    weights = count if orbits.orbit is not None else 1.0
    return orbits.spread(oc_step(x, orbits.total(slope), weights, mass * density.size, low, high, options))


def finer_temperature(nodes: Floats, shape: tuple[int, int]) -> Floats:
    """Return the temperatures of a plate of half the shape, interpolated."""
    fine = np.empty((shape[0] + 1, shape[1] + 1))
    fine[::2, ::2] = nodes
    fine[1::2, ::2] = (nodes[:-1] + nodes[1:]) / 2
    fine[:, 1::2] = (fine[:, :-2:2] + fine[:, 2::2]) / 2
    return fine


def carry(density: Floats, problem: LayerProblem, mass: float) -> Floats:
    """Return a coarser plate's densities on a finer one, with the same mass."""
    fine = problem.symmetry.mean(problem.finer(density, problem.plate.shape))
    fine = np.clip(fine, THINNEST, 1.0)
    scaled: Floats = np.clip(fine * (mass / fine.mean()), THINNEST, 1.0)
    return scaled
