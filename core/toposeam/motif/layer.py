r"""One colour layer: minimal compliance under a mass bound (thesis 4.3, 4.4) by optimality criteria.

The conductivity of an element is k_e (ε + (1 - ε) ρ_e^p), with ε = 10⁻³ so that heat leaves every element by some way, and

.. math:: \partial\Pi / \partial\rho_e = -p\,\rho_e^{p-1} (1-ε) k_e\,\theta_e^T \mathbf K^0 \theta_e.

A filter against checkerboards replaces the sensitivities by a weighted mean of ρ ∂Π/∂ρ over the neighbourhood, divided by ρ (Sigmund
2001, doi:10.1007/s001580050176); its weights fall from the element outwards like two box means in a row. Neighbours beyond the border
are those of the pattern.

*Coarse to fine.* A plate of half the size has the same conductances where its strokes are the same, so most iterations run on plates of
a quarter and half the size, and the densities are interpolated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d

from toposeam.heat.plate import Plate
from toposeam.heat.plate_joints import Floats
from toposeam.motif.arrange import extend
from toposeam.motif.recipe import LayerRecipe, Point, Recipe, unpack_base
from toposeam.motif.sampling import resample
from toposeam.motif.symmetry import Symmetry, joint, symmetry
from toposeam.optimize.oc import OCOptions, oc_step

#: Conductivity of an empty element as a share of a full one's.
VOID = 1e-3
#: Lowest density.
THINNEST = 1e-3
#: Lowest nominal conductivity where a base image blocks the way.
_BLOCKED = 0.02
#: Radius of a source or a sink as a share of the cell's shorter side.
_SPOT = 0.018
#: Convection of all sinks together, relative to the conductivity.
_CONVECTION = 20.0
#: Coarser plates have at least this many elements across.
_COARSEST = 48
#: Iterations at full size and on the plates between, after those on the coarsest.
_LAST, _BETWEEN = 6, 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One iteration of one layer."""

    #: Rows of elements of the plate it ran on.
    rows: int
    #: Compliance of the design it started from, for unit heat.
    compliance: float
    #: Mean density of that design.
    mass: float
    #: Iterations of the solver.
    solver: int


@dataclass(frozen=True, eq=False)
class LayerProblem:
    """A layer's plate at one size."""

    plate: Plate
    #: Nominal conductivity k_e, (h, w).
    nominal: Floats
    symmetry: Symmetry
    repeat: str
    #: Width of the filter's box, in elements (odd).
    box: int

    @classmethod
    def at(cls, layer: LayerRecipe, recipe: Recipe, shape: tuple[int, int]) -> LayerProblem:
        """The layer of a recipe on a plate of the given shape."""
        orbits = symmetry(recipe.repeat, shape)
        heat = (1.0 - layer.ambient) * _spots(layer.sources, shape, recipe.repeat) + layer.ambient / (shape[0] * shape[1])
        sinks = _CONVECTION * _spots(layer.sinks, shape, recipe.repeat)
        nominal = np.ones(shape)
        if recipe.base and recipe.base_strength:
            brightness = resample(unpack_base(recipe.base), "none", shape).astype(np.float64)
            shown = brightness if recipe.base_strength > 0 else 1.0 - brightness
            nominal = np.maximum(1.0 - abs(recipe.base_strength) * (1.0 - shown), _BLOCKED)
        plate = Plate(orbits.mean(heat), orbits.mean(sinks), joint(recipe.repeat))
        radius = recipe.filter_radius * min(shape) / 100
        return cls(plate, orbits.mean(nominal), orbits, recipe.repeat, 2 * round(radius / 2) + 1)

    def conductivity(self, density: Floats, penalty: float) -> Floats:
        """k_e (ε + (1 - ε) ρ^p)."""
        k: Floats = _power(density, penalty)
        k *= 1.0 - VOID
        k += VOID
        k *= self.nominal
        return k

    def sensitivity(self, density: Floats, penalty: float, energy: Floats) -> Floats:
        """∂Π/∂ρ, not filtered."""
        slope: Floats = _power(density, penalty - 1.0)
        slope *= -(1.0 - VOID) * penalty
        slope *= self.nominal
        slope *= energy
        return slope

    def filtered(self, density: Floats, sensitivity: Floats) -> Floats:
        """The filtered sensitivities."""
        if self.box == 1:
            return sensitivity
        margin = self.box - 1
        wide = extend(density * sensitivity, self.repeat, margin)
        for axis in (0, 1):
            for _ in range(2):
                wide = uniform_filter1d(wide, self.box, axis=axis, mode="nearest")
        result: Floats = wide[margin:-margin, margin:-margin] / density
        return result


def _power(density: Floats, exponent: float) -> Floats:
    if exponent == 0.0:
        return np.ones_like(density)
    if exponent == 1.0:
        return density.copy()
    if exponent == 2.0:
        return np.square(density)
    if exponent == 3.0:
        return np.square(density) * density
    result: Floats = density**exponent
    return result


def _spots(points: tuple[Point, ...], shape: tuple[int, int], repeat: str) -> Floats:
    """Discs around points with the given relative strengths, one in all."""
    h, w = shape
    radius = max(_SPOT * min(h, w), 0.75)
    field = np.zeros(shape)
    wraps = repeat not in ("none", "reflect", "rotate")
    y, x = np.arange(h) + 0.5, np.arange(w) + 0.5
    for px, py, strength in points:
        down, across = np.abs(y - py * h), np.abs(x - px * w)
        if wraps:
            down, across = np.minimum(down, h - down), np.minimum(across, w - across)
        spot = np.clip(radius + 0.5 - np.hypot(down[:, None], across[None, :]), 0.0, 1.0)
        field += spot * (strength / spot.sum())
    total = field.sum()
    return field / total if total > 0 else field


def plan(recipe: Recipe) -> list[tuple[tuple[int, int], int]]:
    """The plates' shapes from coarse to fine, and how many iterations run on each."""
    shapes = [recipe.size]
    grain = 4 if recipe.repeat not in ("none", "reflect") else 2
    while recipe.coarse and len(shapes) < 4 and all(side % grain == 0 and side // 2 >= _COARSEST for side in shapes[0]):
        shapes.insert(0, (shapes[0][0] // 2, shapes[0][1] // 2))
    counts = [0] * len(shapes)
    left = recipe.iterations
    for index in range(len(shapes) - 1, 0, -1):
        counts[index] = min(left, _LAST if index == len(shapes) - 1 else _BETWEEN)
        left -= counts[index]
    counts[0] = left
    return [(shape, count) for shape, count in zip(shapes, counts, strict=True) if count]


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
    for shape, count in plan(recipe):
        problem = LayerProblem.at(layer, recipe, shape)
        density = np.full(shape, layer.mass) if density is None else _carry(density, problem, layer.mass)
        temperature: Floats | None = None
        for _ in range(count):
            state = problem.plate.solve(problem.conductivity(density, layer.penalty), temperature, tolerance=1e-4)
            temperature = state.nodes
            steps.append(
                Step(rows=shape[0], compliance=state.compliance, mass=float(density.mean()), solver=state.iterations)
            )  # fmt: skip
            slope = problem.filtered(density, problem.sensitivity(density, layer.penalty, state.energy))
            density = _update(problem.symmetry, density, slope, layer.mass, OCOptions(move=recipe.move))
            if progress is not None:
                progress(len(steps))
    assert density is not None  # noqa: S101
    return density.astype(np.float32), tuple(steps)


def _update(orbits: Symmetry, density: Floats, slope: Floats, mass: float, options: OCOptions) -> Floats:
    """The next design; one variable per orbit."""
    count = orbits.count
    x = orbits.total(density) / count
    return orbits.spread(
        oc_step(x, orbits.total(slope), count if orbits.orbit is not None else 1.0, mass * density.size, THINNEST, 1.0, options)
    )


def _carry(density: Floats, problem: LayerProblem, mass: float) -> Floats:
    """A coarser plate's densities on a finer one, with the same mass."""
    fine = problem.symmetry.mean(resample(density, problem.repeat, problem.plate.shape).astype(np.float64))
    fine = np.clip(fine, THINNEST, 1.0)
    scaled: Floats = np.clip(fine * (mass / fine.mean()), THINNEST, 1.0)
    return scaled
