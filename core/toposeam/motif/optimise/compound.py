"""A row of motifs optimised together with their compounds (thesis 4.10, 4.11)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats
from toposeam.heat.plate import Plate, Temperature
from toposeam.heat.threads import one_thread
from toposeam.motif.ink.sampling import resample
from toposeam.motif.optimise.conduction import MIN_DENSITY, LayerProblem
from toposeam.motif.optimise.layer import (
    ENERGY,
    TOLERANCE,
    Step,
    is_balanced,
    plan,
    problem_at,
    refine_density,
    refine_temperature,
    update,
)
from toposeam.motif.recipe.recipe import Recipe
from toposeam.motif.symmetry.mirrors import Mirrors, mirrors
from toposeam.motif.symmetry.rules import Symmetry, joint, symmetry
from toposeam.optimize.oc import OCOptions

#: Rule by which a compound of two motifs repeats, so that they alternate in both directions.
_COMPOUND_RULE = "brick"


@dataclass(frozen=True)
class JoinOptions:
    """Options of all stages of a row: weight w of (4.10), width of the shared ring, progress callback."""

    weight: float
    shared: int
    report: Callable[[], None]


class Member:
    """A motif of a row; it is fixed once it has densities."""

    def __init__(self, recipe: Recipe, densities: list[npt.NDArray[np.float32]] | None, stage: int) -> None:
        self.recipe, self.densities, self.stage = recipe, densities, stage
        self.history: list[tuple[Step, ...]] = []


class _Plate:
    """A plate of the objective: its problem, its weight, and the members that lie on it side by side, the
    second one turned by 180° if it is `turned`.
    """

    def __init__(
        self, problem: LayerProblem, members: tuple[int, ...], weight: float, turned: bool = False
    ) -> None:
        self.problem, self.members, self.weight, self._turned = problem, members, weight, turned
        self.temperature: Floats | None = None

    def _penalty(self, penalties: list[float]) -> Floats | float:
        own = [penalties[member] for member in self.members]
        if len(set(own)) == 1:
            return own[0]
        h, w = self.problem.plate.shape
        return np.tile(np.repeat(own, w // len(own)), (h, 1))

    def _design(self, designs: list[Floats]) -> Floats:
        return np.concatenate(self._laid([designs[member] for member in self.members]), axis=1)

    def _laid(self, parts: list[Floats]) -> list[Floats]:
        """Turn the second part to how it lies on the plate, or back."""
        return [part[::-1, ::-1] if self._turned and place else part for place, part in enumerate(parts)]

    def solve(self, designs: list[Floats], penalties: list[float]) -> Temperature:
        """Solve for the steady state, starting from the previous temperature."""
        k = self.problem.conductivity(self._design(designs), self._penalty(penalties))
        state = self.problem.plate.solve(k, self.temperature, tolerance=TOLERANCE, energy=ENERGY)
        self.temperature = state.nodes
        return state

    def slopes(self, designs: list[Floats], penalties: list[float], state: Temperature) -> list[Floats]:
        """Compute the weighted filtered sensitivity of each member."""
        design = self._design(designs)
        slope = self.weight * self.problem.filter_sensitivity(
            design, self.problem.sensitivity(design, self._penalty(penalties), state.energy)
        )
        return self._laid(np.split(slope, len(self.members), axis=1))


def generate_row(row: list[Member], options: JoinOptions) -> None:
    """Optimise the members without densities, together with their fixed neighbours."""
    new = [index for index, member in enumerate(row) if member.densities is None]
    pairs = list(combinations(new, 2))
    if len(new) < len(row):
        pairs = [(a, a + 1) for a in range(len(row) - 1) if a in new or a + 1 in new]
    with one_thread():
        layers: list[tuple[list[Floats], list[list[Step]]]] = []
        for layer in range(len(row[0].recipe.layers)):
            taken = [np.sum([designs[index] for designs, _ in layers], axis=0) for index in range(len(row))]
            layers.append(_optimise(row, pairs, layer, options, taken if layers else [None] * len(row)))
    for index in new:
        row[index].densities = [designs[index].astype(np.float32) for designs, _ in layers]
        row[index].history = [tuple(steps[index]) for _, steps in layers]


def _optimise(
    row: list[Member],
    pairs: list[tuple[int, int]],
    layer: int,
    options: JoinOptions,
    taken: Sequence[Floats | None],
) -> tuple[list[Floats], list[list[Step]]]:
    """Optimise one layer of all members; fixed ones are returned unchanged, without steps.

    A worked example: of two new motifs A and B with w = 0.3 there are three plates, A and B of weight 0.7 and
    the compound AB of weight 0.3, twice as wide. An iteration

    1. solves all three for their temperatures. AB's plate lies over the designs of A and B side by side;
    2. takes ∂Π/∂ρ on each. AB's is cut in its two halves, and A's slope is 0.7 times its own plus 0.3
       times the left half, which is the derivative of (4.10);
    3. moves A, then B, by an OC step under a mass bound each (4.11). Rows near the border get as much mass as
       those beyond, as at mirrors;
    4. if a ring is shared, replaces the ring of both by the mean of their rings, and takes the step again
       with the ring fixed, so that the mass still meets its bound.

    In a later stage A and B are fixed and C lies between them: the plates are C, AC and CB, and only C moves.
    """
    recipes = [member.recipe.of_layer(layer) for member in row]
    layers = [recipe.layers[0] for recipe in recipes]
    new = [index for index, member in enumerate(row) if member.densities is None]
    penalties = [part.penalty for part in layers]
    steps: list[list[Step]] = [[] for _ in row]
    designs: list[Floats] = []
    temperatures: list[Floats | None] = []
    for shape, count in plan(recipes[0]):
        problems = [
            problem_at(part, recipe, shape, inked)
            for part, recipe, inked in zip(layers, recipes, taken, strict=True)
        ]
        plates = [_Plate(problems[index], (index,), 1.0 - options.weight) for index in new]
        turned = recipes[0].repeat == "rotate"
        plates += [
            _Plate(_compound(problems[a], problems[b], turned), (a, b), options.weight, turned)
            for a, b in pairs
        ]
        plates = [plate for plate in plates if plate.weight > 0]
        for plate, nodes in zip(plates, temperatures, strict=False):
            plate.temperature = (
                None if nodes is None else refine_temperature(nodes, plate.problem.plate.shape)
            )
        carried: list[Floats] | list[None] = designs or [None] * len(row)
        designs = [
            _first_design(member, layer, problem, coarse)
            for member, problem, coarse in zip(row, problems, carried, strict=True)
        ]
        if not temperatures and len(new) < len(row):
            _interpolate(designs, new, [part.mass for part in layers])
        shares = options.shared and any(
            part.edge != "soft" for part in layers
        )  # wash fades into the mean later
        width = max(1, round(options.shared * shape[0] / recipes[0].size[0])) if shares else 0
        ring = _Ring(symmetry(recipes[0].repeat, shape), width, designs, new)
        border = mirrors(recipes[0].repeat, shape, options.weight > 0)
        for _ in range(count):
            slopes, found = _slopes(plates, designs, penalties)
            for index in new:
                steps[index].append(replace(found[index], mass=float(designs[index].mean())))
            _update_designs(designs, slopes, new, border, recipes, ring, [one.upper for one in problems])
            options.report()
        temperatures = [plate.temperature for plate in plates]
    return designs, steps


def _slopes(
    plates: list[_Plate], designs: list[Floats], penalties: list[float]
) -> tuple[list[Floats], list[Step]]:
    """Compute the derivative of (4.10) by every member's design, and the record of the iteration for each."""
    slopes = [np.zeros(design.shape) for design in designs]
    steps = [Step(rows=len(design), compliance=0.0, mass=0.0, solver=0) for design in designs]
    for plate in plates:
        state = plate.solve(designs, penalties)
        for member, part in zip(plate.members, plate.slopes(designs, penalties, state), strict=True):
            slopes[member] += part
            before = steps[member]
            steps[member] = replace(
                before,
                compliance=before.compliance + float(plate.weight * state.compliance),
                solver=max(before.solver, state.iterations),
            )
    return slopes, steps


def _update_designs(
    designs: list[Floats],
    slopes: list[Floats],
    new: list[int],
    border: Mirrors,
    recipes: list[Recipe],
    ring: _Ring,
    free: list[Floats | float],
) -> None:
    """Compute the next design of every new member, in place."""
    limit, layers = recipes[0].move, [recipe.layers[0] for recipe in recipes]
    bounds = OCOptions(move=limit)
    wash = [layer.edge != "crisp" or not is_balanced(layer, recipes[0]) for layer in layers]

    def proposed(lower: Floats | float = MIN_DENSITY, upper: Floats | float = 1.0) -> dict[int, Floats]:
        found = {}
        for index in new:
            before, mass = designs[index], layers[index].mass
            most = np.minimum(upper, free[index])
            step = update(before, slopes[index], border.symmetry, mass, bounds, lower, most)
            lowest, highest = np.maximum(before - limit, lower), np.minimum(before + limit, most)
            found[index] = border.balance(step, mass, lowest, highest, wash=wash[index])
        return found

    found = proposed()
    if ring.width:
        ring.share(found)
        found = proposed(*ring.limits())
    for index in new:
        designs[index] = found[index]


def _interpolate(designs: list[Floats], new: list[int], masses: list[float]) -> None:
    """Start new members as blends of their fixed neighbours, so that strokes common to both stay."""
    fixed = [index for index in range(len(designs)) if index not in new]
    for index in new:
        left = max(i for i in fixed if i < index)
        right = min(i for i in fixed if i > index)
        share = (index - left) / (right - left)
        blend = (1 - share) * designs[left] + share * designs[right]
        designs[index] = np.clip(blend * (masses[index] / blend.mean()), MIN_DENSITY, 1.0)


class _Ring:
    """The outermost elements of a cell, and their images by the rule, whose densities are equal in all
    members.
    """

    def __init__(self, orbits: Symmetry, width: int, designs: list[Floats], new: list[int]) -> None:
        shape = orbits.shape
        self.width = min(width, min(shape) // 4)
        outer = np.ones(shape)
        outer[self.width : shape[0] - self.width, self.width : shape[1] - self.width] = 0
        self._inside = orbits.largest(outer) == 0
        fixed = [design for index, design in enumerate(designs) if index not in new]
        self._fixed = np.mean(fixed, axis=0) if fixed else None
        self._values = np.zeros(shape)
        if self.width:
            self.share({index: designs[index] for index in new})
            for index in new:
                designs[index] = np.where(self._inside, designs[index], self._values)

    def share(self, designs: dict[int, Floats]) -> None:
        """Set the ring to the mean of the fixed members' rings, or of the new designs' if none is fixed."""
        if self.width:
            self._values = np.mean(list(designs.values()), axis=0) if self._fixed is None else self._fixed

    def limits(self) -> tuple[Floats, Floats]:
        """Return bounds on the densities that fix the ring."""
        return np.where(self._inside, MIN_DENSITY, self._values), np.where(self._inside, 1.0, self._values)


def _first_design(member: Member, layer: int, problem: LayerProblem, coarse: Floats | None) -> Floats:
    """Return a member's first design on a plate: fixed, from the coarser plate, or even."""
    recipe, shape = member.recipe, problem.plate.shape
    if member.densities is not None:
        return np.clip(
            resample(member.densities[layer], recipe.repeat, shape).astype(np.float64), MIN_DENSITY, 1.0
        )
    if coarse is None:
        return np.full(shape, recipe.layers[layer].mass)
    return refine_density(coarse, problem, recipe.layers[layer].mass)


def _compound(a: LayerProblem, b: LayerProblem, turned: bool) -> LayerProblem:
    """Return two motifs side by side on one plate, alternating in both directions (Figure 4.5); the second
    one may be turned by 180°.
    """
    way = slice(None, None, -1 if turned else 1)

    def laid(first: Floats, second: Floats) -> Floats:
        return np.concatenate([first, second[way, way]], axis=1)

    plate = Plate(
        laid(a.plate.heat, b.plate.heat),
        laid(a.plate.convection, b.plate.convection),
        joint(_COMPOUND_RULE),
    )
    return LayerProblem(
        plate,
        laid(a.nominal, b.nominal),
        symmetry(_COMPOUND_RULE, plate.shape),
        _COMPOUND_RULE,
        a.radius,
        a.void,
        1.0,
    )
