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
from collections.abc import Sequence

import numpy as np

from toposeam.arrays import Labels, Mask
from toposeam.checks import check_kind
from toposeam.images import as_mask, box_of
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import TileMap, blocks, dense, uniform
from toposeam.layers.execution.tasks import Progressed
from toposeam.layers.labelling.label_map import LabelMap, as_labels
from toposeam.layers.labelling.problem import Labelling
from toposeam.layers.labelling.subproblem import window_of_labelling
from toposeam.layers.search.cost_coarsening import Tables, enlarged, halved, opened
from toposeam.layers.search.expansion_moves import Choices
from toposeam.layers.search.local_search import beside_seams, expand_from, refine, search, settle
from toposeam.layers.search.options import FAST, SearchOptions
from toposeam.layers.search.problem import Problem
from toposeam.layers.search.two_label_band import write_pixels
from toposeam.seam.cut_solver import CutSolver

#: Largest number of open pixels that are searched again at full size; more are searched from coarse to fine.
_EXPANDED_PIXELS = 1 << 17
#: Largest number of rounds of expansions in such a search from coarse to fine.
_PART_ROUNDS = 10


def minimise(problem: Problem, order: Sequence[int], most: int) -> LabelMap:
    """Search the cheapest label map.

    Parameters
    ----------
    problem : Problem
    order : sequence of int
        The order in which the layers are joined if `most` is 0.
    most : int
        Largest number of rounds; with 0 the layers are only joined one after another.
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
    return _with_figures(problem, labels, rounds, started)


def recut(
    labelling: Labelling,
    label_map: LabelMap,
    opened: Mask,
    fixed: Labels | None = None,
    *,
    solver: CutSolver | None = None,
    search: SearchOptions = FAST,
) -> LabelMap:
    """Search a part of a label map again, with everything else fixed.

    A small part is expanded at full size, from the labels that it has. A large part is searched from coarse
    to fine in a window round it, and the result is taken over if it costs less.

    Parameters
    ----------
    labelling : Labelling
        The problem of the whole canvas, as :attr:`toposeam.layers.Composition.labelling`.
    label_map : LabelMap
        Its solution so far; it is not changed.
    opened : (H, W) bool array
        The pixels that may change.
    fixed : (H, W) int16 array, optional
        The number of the layer that must show, -1 where any may; ignored at pixels that are not open. A layer
        must have pixels where it is fixed.
    solver : CutSolver, optional
        The engine that decides moves; by default minimum cuts by the fastest algorithm for their size.
    search : SearchOptions, optional
        The effort of the search.

    Returns
    -------
    LabelMap
        The new label map; the given one if no pixel is open.

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
    check_kind("labelling", labelling, Labelling, "a Labelling, such as Composition.labelling")
    check_kind("label_map", label_map, LabelMap, "a LabelMap, such as Composition.solution")
    check_kind("solver", solver, (CutSolver, type(None)), "a CutSolver or None")
    check_kind("search", search, SearchOptions, "SearchOptions")
    shape = labelling.canvas.shape
    if not isinstance(opened, TileMap):
        opened = as_mask(opened, shape, "opened")
    if fixed is not None:
        fixed = as_labels(fixed, shape, "fixed")
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
        found = dense(_from_coarse(problem, problem.order, _PART_ROUNDS, search.wandering[0])[0])
        if part.total(found, part.canvas) > part.total(start, part.canvas):
            found = start
    labels = label_map.labels.copy()
    labels[box.slices] = found
    return _with_figures(problem, labels, label_map.rounds, started - label_map.seconds)


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


def _with_figures(problem: Problem, labels: Labels, rounds: int, started: float) -> LabelMap:
    """Return a label map with the engine, rounds and seconds of its search, which began at `started`."""
    method, settings = problem.engine
    seconds = time.perf_counter() - started
    return LabelMap(labels=labels, method=method, settings=settings, rounds=rounds, seconds=seconds)


def _box_round(opened: Mask) -> Box | None:
    """Return the smallest box with all True pixels of a mask, grown by a pixel on the canvas; None if there
    are none.
    """
    canvas, found = Box(0, 0, *opened.shape), None
    for block in blocks(canvas):
        inside = opened[block.slices] if uniform(opened, block) is not np.False_ else None
        if inside is not None and inside.any():
            rows, columns = box_of(inside)
            own = Box(rows.start, columns.start, rows.stop, columns.stop).moved(*block[:2])
            found = own if found is None else found.around(own)
    return None if found is None else found.grown(1).shared(canvas)


def _from_coarse(problem: Problem, order: Sequence[int], most: int, wandering: float) -> tuple[Labels, int]:
    """Search with costs reduced in one way; return the label map and the number of rounds of expansions."""
    levels = _levels(problem, wandering)
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


def _levels(problem: Problem, wandering: float) -> list[Problem]:
    """Return the problem at all its sizes, the full size first."""
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
    """Take over another label map, in place, in each connected patch of differing pixels where it is cheaper.

    No interface touches two patches, or they would be one. So the cost of each is independent of the choice
    for the others, and the cheaper choice for each gives the best mixture of whole patches.
    """
    labelling = problem.labelling
    one, two = dense(label_map), dense(other)
    count, apart = len(labelling.places), one != two
    may = [((one == k) | (two == k)) & apart for k in range(count)]
    choices = Choices(labelling, labelling.canvas, one, may, range(count))
    choices.fuse(np.where(two < 0, np.int16(count), two).ravel())
    label_map[:, :] = choices.label_map()
