"""Search the seams of many layers from coarse to fine.

The costs of large canvases are halved (:mod:`toposeam.layers.search.cost_coarsening`) until few pixels have
several allowed layers. There the cheapest label map is searched (:mod:`toposeam.layers.search.local_search`),
and at every finer size it is refined beside its seams. For small problems, near ties are found at half the
size: pixels where a layer would show if the seams cost some per cent more. They are decided at full size, by
the true costs.

Reduced costs estimate the cost of a seam to some per cent, and alternative seams often differ by less. So
"best" (:mod:`toposeam.layers.search.options`) reduces costs in two ways, which make different mistakes, and
takes the cheaper result wherever the two differ. Pixels beside these seams are then divided once more, and
expansions follow at full size round the places where three layers meet.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np

from toposeam.arrays import Labels
from toposeam.images import box_of
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import dense, doubled, new_map
from toposeam.layers.labelling.label_map import LabelMap
from toposeam.layers.labelling.problem import Labelling
from toposeam.layers.search.cost_coarsening import Tables, enlarged, halved, opened
from toposeam.layers.search.expansion_moves import Choices
from toposeam.layers.search.kept_costs import KeptCost
from toposeam.layers.search.local_search import beside_seams, refine, search, settle
from toposeam.layers.search.problem import Problem
from toposeam.layers.search.two_label_band import write_pixels


def minimise(
    problem: Problem,
    order: Sequence[int],
    most: int,
    start: LabelMap | None = None,
    period: int | None = None,
) -> LabelMap:
    """Search the cheapest label map.

    Parameters
    ----------
    problem : Problem
    order : sequence of int
        The order in which the layers are joined if `most` is 0.
    most : int
        Largest number of rounds; with 0 the layers are only joined one after another.
    start : LabelMap, optional
        A label map of a smaller size, with its place on the canvas of the problem. The search begins at its
        size, and stays in a band round its seams.
    period : int, optional
        The width, px, of a round canvas that was cut open, to which `start` belongs.
    """
    started = time.perf_counter()
    labelling, options = problem.labelling, problem.search
    if start is not None:
        labels = _from_start(problem, most, start, period)
        return with_figures(problem, labels, 1, started)
    thorough = bool(most) and math.prod(labelling.canvas.shape) <= options.large_canvas
    weights = options.wandering if thorough else options.wandering[:1]
    labels, rounds = _from_coarse(problem, order, most, weights[0])
    for weight in weights[1:]:
        other, number = _from_coarse(problem, order, most, weight)
        rounds = max(rounds, number)
        fuse(problem, labels, other)
    if len(weights) > 1:
        refine(problem, labels, beside_seams(labels, options.band), most)
    if options.windows and thorough:
        settle(problem, labels)
    return with_figures(problem, labels, rounds, started)


def _from_start(problem: Problem, most: int, start: LabelMap, period: int | None) -> Labels:
    """Refine a label map of a smaller size beside its seams, at that size and all finer ones."""
    labelling, wandering = problem.labelling, problem.search.wandering[0]
    most_halvings = max(0, min(labelling.canvas.shape).bit_length() - 2)
    halvings = min(most_halvings, max(0, int(math.log2(start.scale))))
    levels = _halved(problem, wandering, halvings, lambda size: True)
    level = levels.pop()
    label_map: Labels = new_map(level.labelling.canvas.shape, -1, np.int16)
    label_map[:, :] = start.sampled(label_map.shape, 1 << halvings, period)
    level.labelling.make_allowed(label_map)
    refine(level, label_map, beside_seams(label_map), most)
    while levels:
        # Narrower than `opened`, so that all moves together stay within about 3 px of the start.
        level, near = levels.pop(), beside_seams(label_map)
        label_map = enlarged(label_map, level.labelling)
        refine(level, label_map, doubled(near, label_map.shape), most)
    return label_map


def with_figures(problem: Problem, labels: Labels, rounds: int, started: float) -> LabelMap:
    """Return a label map with the engine, rounds and seconds of its search, which began at `started`."""
    method, settings = problem.engine
    seconds = time.perf_counter() - started
    return LabelMap(labels=labels, method=method, settings=settings, rounds=rounds, seconds=seconds)


def _from_coarse(problem: Problem, order: Sequence[int], most: int, wandering: float) -> tuple[Labels, int]:
    """Search with costs reduced in one way; return the label map and the number of rounds of expansions."""
    levels = levels_of(problem, wandering)
    few = problem.search.near_ties
    # Small problems need near ties only at half the size, and look for them at all pixels.
    small = len(levels) > 1 and most > 0 and levels[1].labelling.contested(few + 1) <= few

    def tied() -> bool:
        return len(levels) == 1 or (len(levels) > 1 and not small)

    level = levels.pop()
    label_map, ties, number = search(level, order, most, ties=tied())
    while levels:
        level = levels.pop()
        near, finer = beside_seams(label_map), level.labelling
        for rows, columns in ties.values():
            write_pixels(near, rows, columns, np.ones(len(rows), bool))
        label_map = enlarged(label_map, finer)
        every = small and len(levels) == 1
        ties = refine(level, label_map, opened(near, finer), most, tied=ties, ties=tied(), everywhere=every)
    return label_map, number


def levels_of(problem: Problem, wandering: float) -> list[Problem]:
    """Return the problem at all its sizes, the full size first."""
    labelling, options = problem.labelling, problem.search
    small = labelling.contested(options.small + 1) <= options.small
    whole = options.coarsest if small else max(options.coarsest, options.coarsest_large)
    most = max(0, (min(labelling.canvas.shape) - 1) // (2 * options.shortest)).bit_length()
    if not most or labelling.contested(whole + 1) <= whole:
        return [problem]

    def is_large(size: Labelling) -> bool:
        return size.contested(whole + 1) > whole and min(size.canvas.shape) > 2 * options.shortest

    return _halved(problem, wandering, most, is_large)


def _halved(
    problem: Problem, wandering: float, most: int, goes_on: Callable[[Labelling], bool]
) -> list[Problem]:
    """Return the problem at full size and halved again and again, at most `most` times, while the smallest
    size says that it goes on.
    """
    labelling, tables = problem.labelling, None
    if most and not all(isinstance(cost, KeptCost) for cost in labelling.costs.values()):
        tables = Tables(labelling.costs, most, problem.executor, wandering)
    sizes = [labelling]
    while len(sizes) <= most and goes_on(sizes[-1]):
        sizes.append(halved(sizes[-1], wandering))
        problem.steps.one()
    smaller = sizes[1:] if tables is None else tables.kept(sizes[1:])
    return [problem, *map(problem.reduced, smaller)]


def fuse(problem: Problem, label_map: Labels, other: Labels) -> None:
    """Take over another label map, in place, in each connected patch of differing pixels where it is cheaper.

    No interface touches two patches, or they would be one. So the cost of each is independent of the choice
    for the others, and the cheaper choice for each gives the best mixture of whole patches.
    """
    one, two, labelling = dense(label_map), dense(other), problem.labelling
    apart = one != two
    if not apart.any():
        return
    box = Box.of(*box_of(apart)).grown(1).shared(labelling.canvas)
    one, two, apart = one[box.slices], two[box.slices], apart[box.slices]
    layers = [int(k) for k in np.union1d(one, two) if k >= 0]
    choices = Choices(labelling, box, one, [((one == k) | (two == k)) & apart for k in layers], layers)
    choices.fuse(np.where(two < 0, len(layers), np.searchsorted(layers, two)).astype(np.int16).ravel())
    label_map[box.slices] = choices.label_map()
