"""A motif that grows while one looks: all layers at once, step by step, from coarse to fine.

:func:`~toposeam.motif.generate.motif` optimises one layer after another and repairs the result. Here
every step moves all layers by one iteration, so that there is something to see after the first; most
iterations run on small plates, whatever the filter, and what is shown already is a start. The result is like
that of the recipe, not equal to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates

from toposeam.arrays import Floats
from toposeam.checks import check_items, check_kind, check_numbers, check_range, check_whole
from toposeam.errors import OptionError, Term
from toposeam.heat.threads import one_thread
from toposeam.motif.ink.sampling import resample
from toposeam.motif.optimise.conduction import MIN_DENSITY, LayerProblem
from toposeam.motif.optimise.layer import (
    MIN_COARSE_SIDE,
    advance,
    first_density,
    on_outline,
    problem_at,
    refine_density,
    refine_temperature,
)
from toposeam.motif.recipe.recipe import Recipe
from toposeam.motif.symmetry.rules import HEXAGONAL, joint

#: Most iterations on three plates from coarse to fine: from nothing, and from densities that are shown.
_COUNTS, _WARM_COUNTS = (14, 12, 4), (0, 8, 5)
#: Mean change of the density in one iteration below which a layer has settled: fifteen of what iterate forty
#: times are as good as all, by less than a hundredth of the inked elements.
_SETTLED = 1e-4
_DENSITIES = "a sequence of (h, w) arrays in [0, 1]"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Growth:
    """All layers after a step.

    Examples
    --------
    >>> import toposeam as ts
    >>> first = next(ts.motif.grow(ts.motif.random_recipe(96, layers=2, seed=7)))
    >>> first.densities[0].shape, 0 < first.share < 1
    ((48, 48), True)
    """

    #: (h, w) float64 of each layer, on one plate; for hexagonal groups, on the lattice.
    densities: tuple[Floats, ...]
    #: Share of all steps done, in (0, 1].
    share: float


@dataclass(slots=True, eq=False)
class _Layer:
    """A layer while it grows on a plate."""

    recipe: Recipe
    problem: LayerProblem
    density: Floats
    temperature: Floats | None
    #: Iterations that are left to it on this plate.
    left: int


def grow(
    recipe: Recipe, *, start: Sequence[Floats] | None = None, kept: float = 0.5, most: int = 256
) -> Iterator[Growth]:
    """Grow a motif step by step.

    Parameters
    ----------
    recipe : Recipe
    start : sequence of (h, w) float array in [0, 1], optional
        Densities of the layers from which it goes on, of any size and of any recipe; for hexagonal groups,
        on the lattice. Layers of few iterations, and those without coarser plates, begin anew.
    kept : float
        How much of `start` is kept, 0 to 1; the rest is spread evenly, so that strokes can move.
    most : int
        Longest side of the finest plate, in elements, if the recipe's size can be halved so often.

    Yields
    ------
    Growth
        After every iteration of all layers.

    Raises
    ------
    OptionError

    Examples
    --------
    >>> import toposeam as ts
    >>> steps = list(ts.motif.grow(ts.motif.random_recipe(16, layers=2, seed=7)))
    >>> len(steps), steps[-1].share, steps[-1].densities[1].shape
    (30, 1.0, (16, 16))
    """
    check_kind("recipe", recipe, Recipe, "a Recipe")
    check_range(0, 1, kept=kept)
    check_whole("most", most, 1)
    given = (
        [] if start is None else [_checked(one) for one in check_items("start", start, object, _DENSITIES)]
    )
    return _grown(recipe, _plates(recipe, most), given, kept)


def _checked(density: Any) -> Floats:
    """Return a density of a start as an array."""
    values = check_numbers("start", density)
    if values.ndim != 2 or not values.size or not ((values >= 0) & (values <= 1)).all():
        raise OptionError(
            "{parameter} holds an array of shape {shape}; pass {allowed}",
            kind="shape",
            parameter=Term("start"),
            shape=values.shape,
            allowed=_DENSITIES,
        )
    return values


def _grown(
    recipe: Recipe, shapes: list[tuple[int, int]], start: list[Floats], kept: float
) -> Iterator[Growth]:
    alone = [on_outline(recipe.of_layer(index)) for index in range(len(recipe.layers))]
    warm = [index < len(start) and own.iterations >= sum(_COUNTS) for index, own in enumerate(alone)]
    plans = [_plan(own, len(shapes), begun) for own, begun in zip(alone, warm, strict=True)]
    longest = [max(counts) for counts in zip(*plans, strict=True)]
    total, done = sum(longest), 0
    layers: list[_Layer] = []
    for number, (shape, most) in enumerate(zip(shapes, longest, strict=True)):
        if not most:
            continue
        before, layers = layers, []
        for index, own in enumerate(alone):
            given = start[index] if warm[index] and not before else None
            coarser = before[index] if before else None
            layers.append(_on_plate(own, shape, coarser, given, kept, plans[index][number]))
        for left in range(most, 0, -1):
            with one_thread():
                moved = _step(layers, left)
            settled = number == len(shapes) - 1 and moved < _SETTLED
            done = total if settled else done + 1
            yield Growth(densities=tuple(each.density for each in layers), share=done / total)
            if settled:
                return


def _step(layers: list[_Layer], left: int) -> float:
    """Take one iteration of every layer that has as many left; each avoids those before it as they are.

    Returns the largest mean change of a layer's density.
    """
    taken: Floats | None = None
    moved = 0.0
    for each in layers:
        before = each.density
        own = each.recipe.layers[0]
        if taken is not None and own.avoid:
            free = each.problem.left_free(own, each.recipe, each.recipe.size, taken, each.problem.domain)
            each.problem = replace(each.problem, upper=free)
            each.density = np.minimum(each.density, free)
        if each.left >= left:
            each.density, each.temperature, _ = advance(
                each.problem, each.recipe, each.density, each.temperature
            )
            each.left -= 1
        moved = max(moved, float(np.abs(each.density - before).mean()))
        taken = each.density if taken is None else taken + each.density
    return moved


def _on_plate(
    own: Recipe,
    shape: tuple[int, int],
    coarser: _Layer | None,
    start: Floats | None,
    kept: float,
    count: int,
) -> _Layer:
    """Return a layer on a plate: refined, begun from a given density, or even."""
    own = replace(own, size=shape)  # so that its filter is at least as wide as at full size
    layer = own.layers[0]
    problem = problem_at(layer, own, shape)
    temperature: Floats | None = None
    if coarser is not None:
        density = refine_density(coarser.density, problem, layer.mass)
        if coarser.temperature is not None:
            temperature = refine_temperature(coarser.temperature, shape)
    elif start is not None:
        density = _begun(start, problem, layer.mass, kept)
    else:
        density = first_density(problem, layer.mass)
    return _Layer(own, problem, density, temperature, count)


def _begun(start: Floats, problem: LayerProblem, mass: float, kept: float) -> Floats:
    """Return a first design that keeps a share of a given density."""
    shape, rule = problem.symmetry.shape, problem.repeat
    if rule in HEXAGONAL:
        v, u = (np.arange(side) * (many / side) for side, many in zip(shape, start.shape, strict=True))
        nodes = np.meshgrid(v, u, indexing="ij")
        there = np.asarray(map_coordinates(start, nodes, np.float64, order=1, mode="grid-wrap"))
    else:
        there = resample(start, rule, shape).astype(np.float64)
    mixed = kept * problem.symmetry.mean(there) + (1 - kept) * mass
    scaled: Floats = np.clip(mixed * (mass / mixed.mean()), MIN_DENSITY, 1.0)
    return scaled


def _plan(own: Recipe, plates: int, warm: bool) -> list[int]:
    """Return a layer's iterations on each plate, the last ones on the finest.

    What few iterations make, or no coarser plates, would not look like itself after other ones.
    """
    if not own.coarse:
        return [0] * (plates - 1) + [own.iterations]
    counts, left = list(_WARM_COUNTS if warm else _COUNTS), own.iterations
    counts = [sum(counts[: len(counts) - plates + 1]), *counts[len(counts) - plates + 1 :]]
    for place in range(len(counts) - 1, -1, -1):
        counts[place] = min(left, counts[place])
        left -= counts[place]
    return counts


def _plates(recipe: Recipe, most: int) -> list[tuple[int, int]]:
    """Return the shapes of up to three plates from coarse to fine: the recipe's size, halved and halved."""
    grain = 4 if recipe.repeat not in ("none", "reflect") else 2
    shapes = [recipe.size]
    while all(side % grain == 0 and side // 2 >= MIN_COARSE_SIDE for side in shapes[0]):
        half = shapes[0][0] // 2, shapes[0][1] // 2
        if not joint(recipe.repeat).fits(half):
            break
        shapes.insert(0, half)
    return ([shape for shape in shapes if max(shape) <= most] or shapes[:1])[-len(_COUNTS) :]
