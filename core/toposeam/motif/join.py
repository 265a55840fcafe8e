r"""Different motifs that join: optimised together with the compound motif (thesis 4.10, 4.11), and by stages (Figure 4.8).

Two motifs A and B, each periodic, minimise

.. math:: (1 - w)\,(f(\rho^A) + f(\rho^B)) + w\,f(\rho^{AB})

with a mass bound each, f being the thermal compliance. The compound motif AB has them side by side and alternating in both directions,
so that every border of one meets one of the other. Of more than two motifs, every pair is a compound.

*Stages.* The motifs of the stage before are fixed, and new ones are generated between each and the next: their sources and sinks are
those of both, in proportion, they start as a blend of both, and form compounds with both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
import numpy.typing as npt

from toposeam.errors import OptionError
from toposeam.heat.plate import Plate, Temperature
from toposeam.heat.plate_joints import Floats, Joint
from toposeam.heat.threads import one_thread
from toposeam.motif.conduction import LayerProblem
from toposeam.motif.generate import make_motif
from toposeam.motif.layer import THINNEST, TOLERANCE, Step, carry, finer_temperature, plan, problem_at, update
from toposeam.motif.mixing import mix
from toposeam.motif.motif import MAX_PATTERN, Motif
from toposeam.motif.recipe import LayerRecipe, Point, Recipe
from toposeam.motif.sampling import resample
from toposeam.motif.symmetry import symmetry
from toposeam.optimize.oc import OCOptions

#: Rules under which a motif joins itself on all four sides by translation.
_JOINABLE = ("translate", "p1")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JoinedMotifs:
    """What :func:`join_motifs` returns: a row of motifs from the first given one to the last."""

    #: In the order of the row. A motif's recipe holds its own conditions; all of them, joined again, make the same bytes.
    motifs: tuple[Motif, ...]
    #: The stage each was made in, from 1.
    stages: tuple[int, ...]
    #: Weight w of the compound motifs.
    weight: float

    def at_stage(self, stage: int) -> tuple[Motif, ...]:
        """The row as it was after a stage."""
        return tuple(motif for motif, made in zip(self.motifs, self.stages, strict=True) if made <= stage)

    def mismatch(self, stage: int | None = None) -> float:
        """Mean border mismatch of the motifs that are next to each other in the row after a stage (the last without one)."""
        row = self.at_stage(max(self.stages) if stage is None else stage)
        return float(np.mean([border_mismatch(a, b) for a, b in pairwise(row)]))


def border_mismatch(a: Motif, b: Motif) -> float:
    """How much more two motifs differ across their common border than neighbours within them.

    Parameters
    ----------
    a, b : Motif
        Of the same size and number of layers.

    Returns
    -------
    float
        Mean step of density across the borders a|b, b|a, a over b and b over a, divided by the mean step in the first and last two rows
        and columns of both. About 1 where the border cannot be seen.
    """
    across, within = [], []
    for first, second in ((a.densities, b.densities), (b.densities, a.densities)):
        for one, two in ((first, second), (first.swapaxes(1, 2), second.swapaxes(1, 2))):
            across.append(np.abs(one[..., -1] - two[..., 0]).mean())
            within.append(np.abs(one[..., -1] - one[..., -2]).mean())
            within.append(np.abs(two[..., 1] - two[..., 0]).mean())
    inner = float(np.mean(within))
    return float(np.mean(across)) / inner if inner > 0 else 0.0


def join_motifs(
    recipes: Sequence[Recipe], *, weight: float = 0.5, stages: int = 1, between: int = 1, shared: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> JoinedMotifs:  # fmt: skip
    """Generate motifs that join each other and themselves.

    Parameters
    ----------
    recipes : sequence of Recipe
        Two at least, which differ only in their layers' sources, sinks, ambient heat, mass and penalty, and in seed and base image.
    weight : float
        w in [0, 1]: 0 makes each on its own, 1 looks at the compound motifs only.
    stages : int
        1 for the motifs themselves; each further stage puts new ones between neighbours.
    between : int
        How many new motifs a stage puts between two.
    shared : int
        Elements along the border that are the same in all motifs, so that any may lie beside any. 0 is the thesis's way: the compound
        motifs alone make the borders alike.
    progress : callable, optional
        Called with the number of iterations done and the number of all.

    Returns
    -------
    JoinedMotifs

    Raises
    ------
    OptionError
        When the recipes do not fit each other, or an option is out of range.
    """
    _check(recipes, weight, stages, between, shared)
    first = recipes[0]
    per_stage = sum(count for _, count in plan(first)) * len(first.layers)
    done = 0

    def report() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, per_stage * stages)

    options = _Options(weight, shared, report)
    row = [_Member(recipe, None, 1) for recipe in recipes]
    _generate(row, options)
    for stage in range(2, stages + 1):
        longer = row[:1]
        for left, right in pairwise(row):
            for index in range(between):
                recipe = _blend(left.recipe, right.recipe, (index + 1) / (between + 1))
                longer.append(_Member(recipe, None, stage))
            longer.append(right)
        row = longer
        _generate(row, options)
    motifs = []
    for member in row:
        assert member.densities is not None  # noqa: S101
        motifs.append(make_motif(member.recipe, member.densities, member.history))
    return JoinedMotifs(motifs=tuple(motifs), stages=tuple(member.stage for member in row), weight=weight)


@dataclass(frozen=True)
class _Options:
    weight: float
    shared: int
    report: Callable[[], None]


class _Member:
    """One motif of a row: fixed once it has densities."""

    def __init__(self, recipe: Recipe, densities: list[npt.NDArray[np.float32]] | None, stage: int) -> None:
        self.recipe, self.densities, self.stage = recipe, densities, stage
        self.history: list[tuple[Step, ...]] = []


class _Plate:
    """A plate in the objective, the members whose designs lie on it side by side, and its weight."""

    def __init__(self, problem: LayerProblem, members: tuple[int, ...], weight: float) -> None:
        self.problem, self.members, self.weight = problem, members, weight
        self.temperature: Floats | None = None

    def _penalty(self, penalties: list[float]) -> Floats | float:
        own = [penalties[member] for member in self.members]
        if len(set(own)) == 1:
            return own[0]
        h, w = self.problem.plate.shape
        return np.tile(np.repeat(own, w // len(own)), (h, 1))

    def _design(self, designs: list[Floats]) -> Floats:
        return np.concatenate([designs[member] for member in self.members], axis=1)

    def solve(self, designs: list[Floats], penalties: list[float]) -> Temperature:
        """The steady state, started from the one before."""
        k = self.problem.conductivity(self._design(designs), self._penalty(penalties))
        state = self.problem.plate.solve(k, self.temperature, tolerance=TOLERANCE)
        self.temperature = state.nodes
        return state

    def slopes(self, designs: list[Floats], penalties: list[float], state: Temperature) -> list[Floats]:
        """The weighted filtered sensitivity of each member."""
        design = self._design(designs)
        slope = self.weight * self.problem.filtered(design, self.problem.sensitivity(design, self._penalty(penalties), state.energy))
        return np.split(slope, len(self.members), axis=1)


def _generate(row: list[_Member], options: _Options) -> None:
    """Fill in the members without densities, next to those that have some."""
    new = [index for index, member in enumerate(row) if member.densities is None]
    pairs = list(combinations(new, 2))
    if len(new) < len(row):
        pairs = [(a, a + 1) for a in range(len(row) - 1) if a in new or a + 1 in new]
    with one_thread():
        layers = [_optimise(row, pairs, layer, options) for layer in range(len(row[0].recipe.layers))]
    for index in new:
        row[index].densities = [designs[index].astype(np.float32) for designs, _ in layers]
        row[index].history = [tuple(steps[index]) for _, steps in layers]


def _optimise(row: list[_Member], pairs: list[tuple[int, int]], layer: int, options: _Options) -> tuple[list[Floats], list[list[Step]]]:
    """One layer of all members; fixed ones come back as they are, with no steps."""
    recipes = [member.recipe for member in row]
    layers = [recipe.layers[layer] for recipe in recipes]
    new = [index for index, member in enumerate(row) if member.densities is None]
    penalties = [part.penalty for part in layers]
    steps: list[list[Step]] = [[] for _ in row]
    designs: list[Floats] = []
    temperatures: list[Floats | None] = []
    for shape, count in plan(recipes[0]):
        problems = [problem_at(part, recipe, shape) for part, recipe in zip(layers, recipes, strict=True)]
        plates = [_Plate(problems[index], (index,), 1.0 - options.weight) for index in new]
        plates += [_Plate(_compound(problems[a], problems[b]), (a, b), options.weight) for a, b in pairs]
        plates = [plate for plate in plates if plate.weight > 0]
        for plate, nodes in zip(plates, temperatures, strict=False):
            plate.temperature = None if nodes is None else finer_temperature(nodes, plate.problem.plate.shape)
        carried: list[Floats] | list[None] = designs or [None] * len(row)
        designs = [_start(member, layer, problem, coarse) for member, problem, coarse in zip(row, problems, carried, strict=True)]
        if not temperatures and len(new) < len(row):
            _interpolate(designs, new, [part.mass for part in layers])
        ring = _Ring(shape, options.shared, designs, new)
        for _ in range(count):
            slopes = [np.zeros(shape) for _ in row]
            compliance, solver = np.zeros(len(row)), np.zeros(len(row), int)
            for plate in plates:
                state = plate.solve(designs, penalties)
                for member, part in zip(plate.members, plate.slopes(designs, penalties, state), strict=True):
                    slopes[member] += part
                    compliance[member] += plate.weight * state.compliance
                    solver[member] = max(solver[member], state.iterations)
            for index in new:
                mass = float(designs[index].mean())
                steps[index].append(Step(rows=shape[0], compliance=float(compliance[index]), mass=mass, solver=int(solver[index])))
            bounds = OCOptions(move=recipes[0].move)
            orbits, masses = problems[new[0]].symmetry, [part.mass for part in layers]
            proposed = {index: update(designs[index], slopes[index], orbits, masses[index], bounds) for index in new}
            if ring.width:
                ring.share(proposed)
                proposed = {index: update(designs[index], slopes[index], orbits, masses[index], bounds, *ring.limits()) for index in new}
            for index in new:
                designs[index] = proposed[index]
            options.report()
        temperatures = [plate.temperature for plate in plates]
    return designs, steps


def _interpolate(designs: list[Floats], new: list[int], masses: list[float]) -> None:
    """Start new members as blends of their fixed neighbours, so that strokes which both have on the border stay."""
    fixed = [index for index in range(len(designs)) if index not in new]
    for index in new:
        left = max(i for i in fixed if i < index)
        right = min(i for i in fixed if i > index)
        share = (index - left) / (right - left)
        blend = (1 - share) * designs[left] + share * designs[right]
        designs[index] = np.clip(blend * (masses[index] / blend.mean()), THINNEST, 1.0)


class _Ring:
    """The outermost elements of a cell, which all members share: where one has ink there, all have."""

    def __init__(self, shape: tuple[int, int], width: int, designs: list[Floats], new: list[int]) -> None:
        self.width = min(width, min(shape) // 4)
        self._inside = np.zeros(shape, bool)
        self._inside[self.width : shape[0] - self.width, self.width : shape[1] - self.width] = True
        fixed = [design for index, design in enumerate(designs) if index not in new]
        self._fixed = np.mean(fixed, axis=0) if fixed else None
        self._values = np.zeros(shape)
        if self.width:
            self.share({index: designs[index] for index in new})
            for index in new:
                designs[index] = np.where(self._inside, designs[index], self._values)

    def share(self, designs: dict[int, Floats]) -> None:
        """Take what the fixed members have there, or the mean of what new ones would have."""
        if self.width:
            self._values = np.mean(list(designs.values()), axis=0) if self._fixed is None else self._fixed

    def limits(self) -> tuple[Floats, Floats]:
        """Bounds on the densities that hold the ring where it is."""
        return np.where(self._inside, THINNEST, self._values), np.where(self._inside, 1.0, self._values)


def _start(member: _Member, layer: int, problem: LayerProblem, coarse: Floats | None) -> Floats:
    """A member's design on a plate: the fixed one, that of the coarser plate, or an even one."""
    recipe, shape = member.recipe, problem.plate.shape
    if member.densities is not None:
        return np.clip(resample(member.densities[layer], recipe.repeat, shape).astype(np.float64), THINNEST, 1.0)
    if coarse is None:
        return np.full(shape, recipe.layers[layer].mass)
    return carry(coarse, problem, recipe.layers[layer].mass)


def _compound(a: LayerProblem, b: LayerProblem) -> LayerProblem:
    """Two motifs side by side on one plate, alternating in both directions (Figure 4.5)."""
    plate = Plate(
        np.concatenate([a.plate.heat, b.plate.heat], axis=1),
        np.concatenate([a.plate.convection, b.plate.convection], axis=1),
        Joint.EXCHANGE,
    )
    return LayerProblem(plate, np.concatenate([a.nominal, b.nominal], axis=1), symmetry("exchange", plate.shape), "exchange", a.radius)


def _blend(a: Recipe, b: Recipe, share: float) -> Recipe:
    """The conditions between two recipes: the sources and sinks of both, in proportion."""
    layers = []
    for one, two in zip(a.layers, b.layers, strict=True):
        layers.append(
            LayerRecipe(
                ink=one.ink,
                sources=_weighted(one.sources, 1 - share) + _weighted(two.sources, share),
                sinks=_weighted(one.sinks, 1 - share) + _weighted(two.sinks, share),
                ambient=(1 - share) * one.ambient + share * two.ambient,
                mass=(1 - share) * one.mass + share * two.mass,
                penalty=(1 - share) * one.penalty + share * two.penalty,
            )
        )
    return replace(a, layers=tuple(layers))


def _weighted(points: tuple[Point, ...], share: float) -> tuple[Point, ...]:
    total = sum(strength for *_, strength in points)
    return tuple((x, y, share * strength / total) for x, y, strength in points if total > 0)


def _check(recipes: Sequence[Recipe], weight: float, stages: int, between: int, shared: int) -> None:
    if len(recipes) < 2:
        raise OptionError(f"{len(recipes)} recipes were given; join at least two motifs")
    if not 0 <= weight <= 1:
        raise OptionError(f"weight is {weight}; it must lie between 0 (each on its own) and 1 (compound motifs only)")
    if stages < 1 or between < 1:
        raise OptionError(f"stages is {stages} and between {between}; both must be at least 1")
    if shared < 0:
        raise OptionError(f"shared is {shared}; it must be 0 or more elements")
    first = recipes[0]
    if first.repeat not in _JOINABLE:
        raise OptionError(f"repeat is {first.repeat}; motifs that join each other must repeat by {' or '.join(_JOINABLE)}")
    if first.size[1] % 2:
        raise OptionError(f"motifs that join need an even width, theirs is {first.size[1]}; use {first.size[1] + 1}")
    for other in recipes[1:]:
        for name in ("size", "repeat", "paper", "iterations", "move", "filter_radius", "coarse"):
            if getattr(other, name) != getattr(first, name):
                raise OptionError(f"the recipes differ in {name} ({getattr(first, name)} and {getattr(other, name)}); give all the same")
        if [part.ink for part in other.layers] != [part.ink for part in first.layers]:
            raise OptionError("the recipes differ in their inks; give all the same palette and number of layers")


def arrange(
    motifs: Sequence[Motif], arrangement: tuple[int, int] | npt.ArrayLike, *, seed: int = 0, reach: int | None = None,
    size: tuple[int, int] | None = None,
) -> npt.NDArray[np.float32]:  # fmt: skip
    """A pattern of different motifs in free arrangement (Figure 4.9).

    Parameters
    ----------
    motifs : sequence of Motif
        Of the same size and inks, such as the motifs of `JoinedMotifs`.
    arrangement : (rows, columns) or (R, C) int array_like
        How many, chosen at random; or which motif goes where, by its index.
    seed : int
        Of the random choice.
    reach : int, optional
        Random neighbours are at most this far apart in the sequence; any without it.
    size : (rows, columns), optional
        Size of one motif.

    Returns
    -------
    (H, W, 3) float32 array in [0, 1]

    Raises
    ------
    OptionError
    """
    if not motifs:
        raise OptionError("there are no motifs to arrange; give at least one")
    first = motifs[0]
    for other in motifs:
        if other.densities.shape != first.densities.shape or not np.array_equal(other.inks, first.inks):
            raise OptionError("the motifs differ in size or inks; give motifs that were joined")
    grid = np.asarray(arrangement)
    if grid.ndim == 1 and grid.shape == (2,):
        if float(grid[0]) * float(grid[1]) > MAX_PATTERN:
            raise OptionError(f"the arrangement would have {grid[0]} × {grid[1]} places; ask for fewer motifs")
        grid = random_arrangement((int(grid[0]), int(grid[1])), len(motifs), seed, reach)
    if grid.ndim != 2 or grid.size == 0 or not np.issubdtype(grid.dtype, np.integer):
        raise OptionError("the arrangement must be (rows, columns) or a grid of whole numbers, one for each place")
    if grid.min() < 0 or grid.max() >= len(motifs):
        raise OptionError(f"the arrangement has numbers from {grid.min()} to {grid.max()}; there are motifs 0 to {len(motifs) - 1}")
    h, w = first.densities.shape[1:]
    rows, columns = size if size is not None else (h, w)
    if min(rows, columns) < 1 or grid.size * max(rows * columns, h * w) > MAX_PATTERN:
        raise OptionError(f"the pattern would have {grid.size * rows * columns:,} pixels; ask for fewer or smaller motifs")
    layers = np.concatenate([np.concatenate([motifs[index].densities for index in row], axis=2) for row in grid], axis=1)
    whole = grid.shape[0] * rows, grid.shape[1] * columns
    return mix(np.stack([resample(layer, "translate", whole) for layer in layers]), first.inks, first.paper)


def random_arrangement(counts: tuple[int, int], motifs: int, seed: int = 0, reach: int | None = None) -> npt.NDArray[np.intp]:
    """Indices of motifs at random, (rows, columns), neighbours at most `reach` apart."""
    rows, columns = counts
    if rows < 1 or columns < 1:
        raise OptionError(f"{rows} × {columns} motifs were asked for; ask for at least 1 × 1")
    if reach is not None and reach < 1:
        raise OptionError(f"reach is {reach}; it must be at least 1")
    rng = np.random.default_rng(seed)
    grid = np.zeros(counts, np.intp)
    far = motifs if reach is None else reach
    for y in range(rows):
        for x in range(columns):
            # Left and upper neighbours both lie within reach of the one between them, so there is always a choice.
            beside = [int(grid[y, x - 1])] if x else []
            beside += [int(grid[y - 1, x])] if y else []
            grid[y, x] = rng.choice([i for i in range(motifs) if all(abs(i - other) <= far for other in beside)])
    return grid
