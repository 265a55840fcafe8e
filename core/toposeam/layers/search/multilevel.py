"""Seams of many layers from coarse to fine.

The costs of large canvases are halved (:mod:`toposeam.layers.search.cost_coarsening`) until few pixels have
several layers to choose from. There the cheapest label map is searched
(:mod:`toposeam.layers.search.local_search`), and at every finer size it is refined beside its seams. Small
problems are also asked at half the size where each layer would show if the seams cost some per cent more:
such near ties are decided at full size, by true costs.

Reduced costs are a guess at what a seam will cost, off by some per cent, and which of several ways it takes
hangs by less. So "best" (:mod:`toposeam.layers.search.options`) reduces them in two ways, each of which leads
to other mistakes, and takes the cheaper one wherever the two ends differ; what lies beside these seams is
divided once more, and round the places where three layers meet expansions follow at full size.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np

from toposeam.arrays import Labels
from toposeam.layers.canvas.tile_map import dense
from toposeam.layers.search.cost_coarsening import Tables, enlarged, halved, opened
from toposeam.layers.search.expansion_moves import Choices
from toposeam.layers.search.local_search import (
    beside_seams,
    find_potentials,
    refine,
    search,
    settle,
)
from toposeam.layers.search.problem import Problem, Report, State
from toposeam.layers.search.two_label_band import write_pixels


def minimise(problem: Problem, order: Sequence[int], most: int, potentials: bool) -> tuple[Labels, Report]:
    """Search the cheapest label map, (H, W) int16.

    Parameters
    ----------
    problem : Problem
    order : sequence of int
        The order in which the layers are joined if no rounds are wanted.
    most : int
        Rounds at most; with 0 the layers are only joined one after another.
    potentials : bool
        Whether the label potentials beside the seams are wanted.
    """
    started = time.perf_counter()
    labelling, options = problem.labelling, problem.search
    thorough = bool(most) and math.prod(labelling.canvas.shape) <= options.large_canvas
    weights = options.wandering if thorough else options.wandering[:1]
    label_map, rounds = _from_coarse(problem, order, most, weights[0])
    for weight in weights[1:]:
        other, number = _from_coarse(problem, order, most, weight)
        rounds = max(rounds, number)
        _fuse(problem, label_map, other)
    if len(weights) > 1:
        refine(problem, State(label_map, beside_seams(label_map, options.band)), most)
    if options.windows and thorough:
        settle(problem, label_map)
    gathered = find_potentials(problem, State(label_map)) if potentials else {}
    return label_map, Report(problem, rounds, time.perf_counter() - started, gathered)


def _from_coarse(problem: Problem, order: Sequence[int], most: int, wandering: float) -> tuple[Labels, int]:
    """The label map that costs reduced in one way lead to, and the number of rounds of expansions."""
    levels = _levels(problem, wandering)
    few = problem.search.near_ties
    # At half the size of small problems near ties are looked for among all pixels; smaller sizes need none.
    small = len(levels) > 1 and most > 0 and levels[1].labelling.contested(few + 1) <= few

    def tied() -> bool:
        return len(levels) == 1 or (len(levels) > 1 and not small)

    level = levels.pop()
    state, number = search(level, order, most, ties=tied())
    label_map, ties = state.label_map, state.ties
    while levels:
        level = levels.pop()
        near, finer = beside_seams(label_map), level.labelling
        for rows, columns in ties.values():
            write_pixels(near, rows, columns, np.ones(len(rows), bool))
        label_map = enlarged(label_map, finer)
        state = State(label_map, opened(near, finer), ties)
        ties = refine(level, state, most, ties=tied(), everywhere=small and len(levels) == 1)
    return label_map, number


def _levels(problem: Problem, wandering: float) -> list[Problem]:
    """The problem at all its sizes, the full one first."""
    labelling, options = problem.labelling, problem.search
    small = labelling.contested(options.small + 1) <= options.small
    whole = options.coarsest if small else max(options.coarsest, options.coarsest_large)
    most = max(0, (min(labelling.canvas.shape) - 1) // (2 * options.shortest)).bit_length()
    if not most or labelling.contested(whole + 1) <= whole:
        return [problem]
    tables = Tables(labelling.costs, most, problem.executor, wandering)
    levels = [labelling]
    while levels[-1].contested(whole + 1) > whole and min(levels[-1].canvas.shape) > 2 * options.shortest:
        levels.append(halved(levels[-1], wandering))
        problem.steps.one()
    return [problem, *(problem.reduced(level) for level in tables.kept(levels[1:]))]


def _fuse(problem: Problem, label_map: Labels, other: Labels) -> None:
    """Take another label map, in place, wherever it is cheaper in a whole patch of pixels in which the two
    differ.

    No interface touches two patches, or they would be one. So the cost of each does not depend on the choice
    for the others, and the cheaper one of each is the best of all mixtures of whole patches.
    """
    labelling = problem.labelling
    one, two = dense(label_map), dense(other)
    count, apart = len(labelling.places), one != two
    may = [((one == k) | (two == k)) & apart for k in range(count)]
    choices = Choices(labelling, labelling.canvas, one, may, range(count))
    choices.fuse(np.where(two < 0, np.int16(count), two).ravel())
    label_map[:, :] = choices.label_map()
