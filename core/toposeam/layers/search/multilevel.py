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

from toposeam.arrays import Labels, Mask
from toposeam.images import box_of
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import blocks, dense, uniform
from toposeam.layers.execution.progress import Progressed
from toposeam.layers.labelling.label_map import LabelMap
from toposeam.layers.labelling.problem import Labelling
from toposeam.layers.labelling.subproblem import window_of_labelling
from toposeam.layers.search.cost_coarsening import Tables, enlarged, halved, opened
from toposeam.layers.search.expansion_moves import Choices
from toposeam.layers.search.local_search import beside_seams, expand_from, refine, search, settle
from toposeam.layers.search.options import FAST, SearchOptions
from toposeam.layers.search.problem import Problem
from toposeam.layers.search.two_label_band import write_pixels
from toposeam.seam.cut_solver import CutSolver

#: Up to this many open pixels of a label map are searched again at full size.
_EXPANDED_PIXELS = 1 << 17
#: Rounds of expansions at most where a large part is searched again.
_ROUNDS = 10


def minimise(problem: Problem, order: Sequence[int], most: int) -> LabelMap:
    """Search the cheapest label map.

    Parameters
    ----------
    problem : Problem
    order : sequence of int
        The order in which the layers are joined if no rounds are wanted.
    most : int
        Rounds at most; with 0 the layers are only joined one after another.
    """
    started = time.perf_counter()
    labelling, options = problem.labelling, problem.search
    thorough = bool(most) and math.prod(labelling.canvas.shape) <= options.large_canvas
    weights = options.wandering if thorough else options.wandering[:1]
    labels, rounds = _from_coarse(problem, order, most, weights[0])
    for weight in weights[1:]:
        other, number = _from_coarse(problem, order, most, weight)
        rounds = max(rounds, number)
        _fuse(problem, labels, other)
    if len(weights) > 1:
        refine(problem, labels, beside_seams(labels, options.band), most)
    if options.windows and thorough:
        settle(problem, labels)
    return _found(problem, labels, rounds, started)


def recut(
    labelling: Labelling,
    label_map: LabelMap,
    opened: Mask,
    fixed: Labels | None = None,
    *,
    solver: CutSolver | None = None,
    search: SearchOptions = FAST,
) -> LabelMap:
    """Search a part of a label map again, everything else staying as it is.

    Small parts are expanded at full size from what shows. Large ones are searched from coarse to fine in a
    window round them, and taken over where that is cheaper.

    Parameters
    ----------
    labelling : Labelling
        Of the whole canvas.
    label_map : LabelMap
    opened : (H, W) bool array
        The pixels that may change.
    fixed : (H, W) int16 array, optional
        The layer that must show, -1 where any may; counts among the open pixels only. A layer must have
        pixels where it is to show.
    solver : CutSolver, optional
        Decides moves; minimum cuts by the engine that is fastest for their size by default.
    search : SearchOptions, optional

    Returns
    -------
    LabelMap
        The given one, where nothing is open.

    Examples
    --------
    >>> import toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 20, 60))
    >>> joined = ts.stitch(ts.layers.overlapping(a, b, overlap=40))
    >>> fixed = np.full(joined.shape, -1, np.int16)
    >>> fixed[8:12, 38:42] = 0 if joined.label_map[10, 40] else 1  # the other one
    >>> again = ts.layers.recut(joined.labelling, joined.solution, np.ones(joined.shape, bool), fixed)
    >>> bool((again.labels[8:12, 38:42] == fixed[8:12, 38:42]).all())
    True
    """
    started = time.perf_counter()
    box = _box_round(opened)
    if box is None:
        return label_map
    inside = np.asarray(opened[box.slices])
    start = np.array(label_map.labels[box.slices])
    if fixed is not None:
        wanted = np.asarray(fixed[box.slices])
        must = inside & (wanted >= 0)
        start[must] = wanted[must]
        inside = inside & ~must
    part = window_of_labelling(labelling, box, _choices_in(labelling, box, start, inside))
    part.make_allowed(start)
    solver = CutSolver.of("auto", {}, labelling.forbidden) if solver is None else solver
    problem = Problem(part, solver, search, None, Progressed(None))
    if np.count_nonzero(inside) <= _EXPANDED_PIXELS or min(box.shape) < 4 * search.shortest:
        found = expand_from(problem, start)
    else:
        found = dense(_from_coarse(problem, problem.order, _ROUNDS, search.wandering[0])[0])
        if part.total(found, part.canvas) > part.total(start, part.canvas):
            found = start
    labels = label_map.labels.copy()
    labels[box.slices] = found
    return _found(problem, labels, label_map.rounds, started - label_map.seconds)


def _choices_in(labelling: Labelling, box: Box, shows: Labels, free: Mask) -> list[Mask]:
    """Per layer, (h, w) bool in a box: where it may be chosen among free pixels, or shows at others; an empty
    one for a layer that lies elsewhere. A free pixel at which no layer is allowed keeps what it shows.
    """
    near = [k for k, place in enumerate(labelling.places) if all(place.shared(box).shape)]
    allowed = {k: labelling.allowed_in(k, box) & free for k in near}
    stays = ~np.any(list(allowed.values()), axis=0) if near else ~free
    return [
        allowed[k] | (stays & (shows == k)) if k in allowed else np.zeros((0, 0), bool)
        for k in range(len(labelling.places))
    ]


def _found(problem: Problem, labels: Labels, rounds: int, started: float) -> LabelMap:
    """Return the labels with how they were found since a time."""
    method, settings = problem.engine
    seconds = time.perf_counter() - started
    return LabelMap(labels=labels, method=method, settings=settings, rounds=rounds, seconds=seconds)


def _box_round(opened: Mask) -> Box | None:
    """The smallest box with all True pixels of a mask, and a pixel more on each side on the canvas."""
    canvas, found = Box(0, 0, *opened.shape), None
    for block in blocks(canvas):
        inside = opened[block.slices] if uniform(opened, block) is not np.False_ else None
        if inside is not None and inside.any():
            rows, columns = box_of(inside)
            own = Box(rows.start, columns.start, rows.stop, columns.stop).moved(*block[:2])
            found = own if found is None else found.around(own)
    return None if found is None else found.grown(1).shared(canvas)


def _from_coarse(problem: Problem, order: Sequence[int], most: int, wandering: float) -> tuple[Labels, int]:
    """The label map that costs reduced in one way lead to, and the number of rounds of expansions."""
    levels = _levels(problem, wandering)
    few = problem.search.near_ties
    # At half the size of small problems near ties are looked for among all pixels; smaller sizes need none.
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
