"""Seams of many layers from coarse to fine.

The costs of large canvases are halved (:mod:`toposeam.layers.reduction`) until few pixels have several layers
to choose from. There the cheapest label map is searched (:mod:`toposeam.layers.rounds`), and at every finer
size it is refined beside its seams. Small problems are also asked at half the size where each layer would
show if the seams cost some per cent more: such near ties are decided at full size, by true costs.

Reduced costs are a guess at what a seam will cost, off by some per cent, and which of several ways it takes
hangs by less. So "best" (:mod:`toposeam.layers.search_options`) reduces them in two ways, each of which leads
to other mistakes, and takes the cheaper one wherever the two ends differ; what lies beside these seams is
divided once more, and round the places where three layers meet expansions follow at full size.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np

from toposeam.layers.band import write_pixels
from toposeam.layers.choices import Choices
from toposeam.layers.maps import dense
from toposeam.layers.reduction import Tables, enlarged, halved, opened
from toposeam.layers.rounds import (
    Problem,
    Report,
    State,
    beside_seams,
    find_potentials,
    refine,
    search,
    settle,
)


def minimise(problem: Problem, order: Sequence[int], most: int, potentials: bool) -> tuple[State, Report]:
    """Search the cheapest label map.

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
    labelling, options, report = problem.labelling, problem.search, Report.of(problem)
    thorough = bool(most) and math.prod(labelling.canvas.shape) <= options.large_canvas
    weights = options.wandering if thorough else options.wandering[:1]
    state, report.rounds = _from_coarse(problem, order, most, weights[0])
    for weight in weights[1:]:
        other, rounds = _from_coarse(problem, order, most, weight)
        report.rounds = max(report.rounds, rounds)
        _fuse(problem, state, other)
    if len(weights) > 1:
        refine(problem, state, most)
    if options.windows and thorough:
        settle(problem, state)
    if potentials:
        state.near = None
        find_potentials(problem, state, report)
    report.seconds = time.perf_counter() - started
    return state, report


def _from_coarse(problem: Problem, order: Sequence[int], most: int, wandering: float) -> tuple[State, int]:
    """The label map that costs reduced in one way lead to, and the number of rounds of expansions."""
    levels = _levels(problem, wandering)
    few = problem.search.near_ties
    # At half the size of small problems near ties are looked for among all pixels; smaller sizes need none.
    small = len(levels) > 1 and most > 0 and levels[1].labelling.contested(few + 1) <= few

    def tied() -> bool:
        return len(levels) == 1 or (len(levels) > 1 and not small)

    level = levels.pop()
    state, number = search(level, order, most, ties=tied())
    while levels:
        level = levels.pop()
        near, finer = beside_seams(state.label_map), level.labelling
        for rows, columns in state.ties.values():
            write_pixels(near, rows, columns, np.ones(len(rows), bool))
        state = State(enlarged(state.label_map, finer), opened(near, finer), state.ties)
        refine(level, state, most, ties=tied(), everywhere=small and len(levels) == 1)
    return state, number


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


def _fuse(problem: Problem, state: State, other: State) -> None:
    """Take another label map wherever it is cheaper in a whole patch of pixels in which the two differ, and
    open the pixels beside the seams.

    No interface touches two patches, or they would be one. So the cost of each does not depend on the choice
    for the others, and the cheaper one of each is the best of all mixtures of whole patches.
    """
    labelling = problem.labelling
    one, two = dense(state.label_map), dense(other.label_map)
    count, apart = len(labelling.places), one != two
    may = [((one == k) | (two == k)) & apart for k in range(count)]
    choices = Choices(labelling, labelling.canvas, one, may, range(count))
    choices.fuse(np.where(two < 0, np.int16(count), two).ravel())
    state.label_map[:, :] = choices.label_map()
    state.near = beside_seams(state.label_map, problem.search.band)
