"""Search a label map again: a window of it, some pixels, or all of it, from what shows on.

While somebody paints, the window round a stroke is searched: the layers expand at full size, from the labels
that show, and exactly. A window may not be enough for a long stroke, as the seam cannot leave it. So when the
stroke has ended, all is searched from coarse to fine, and the result is taken over in each connected patch of
pixels in which it is cheaper.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable

import numpy as np

from toposeam.arrays import Labels, Mask
from toposeam.checks import check_choice, check_function, check_kind
from toposeam.images import as_mask, box_of
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import TileMap, blocks, dense, doubled, new_map, uniform
from toposeam.layers.execution.tasks import Progressed
from toposeam.layers.labelling.label_map import LabelMap, as_labels
from toposeam.layers.labelling.problem import Labelling
from toposeam.layers.labelling.seam_lines import square_dilation
from toposeam.layers.labelling.subproblem import window_of_labelling
from toposeam.layers.search.cost_coarsening import opened as opened_at
from toposeam.layers.search.local_search import beside_seams, expand_from, refine
from toposeam.layers.search.multilevel import fuse, levels_of, with_figures
from toposeam.layers.search.options import FAST, SearchOptions
from toposeam.layers.search.problem import Problem
from toposeam.seam.cut_solver import CutSolver

#: Largest number of open pixels that are searched again at full size; more are searched from coarse to fine.
_EXPANDED_PIXELS = 1 << 13
#: Largest network, in nodes, that is cut by maximum flow: in the narrow bands and small windows here it is
#: faster than heat.
_FLOW_NODES = 200_000
#: Largest number of rounds of expansions in a search from coarse to fine.
_ROUNDS = 10
#: Pixels are searched again at the next finer size up to this distance, px, from where labels have changed.
_MOVED_REACH = 8
#: The window round pixels that must change reaches beyond them by half their own size, and at least by this
#: many px.
_LEAST_MARGIN = 160
#: Width of the rim of the window, px, that keeps its labels, so that seams join those outside.
_FIXED_RIM = 2


def recut(
    labelling: Labelling,
    label_map: LabelMap,
    opened: Mask | None = None,
    fixed: Labels | None = None,
    *,
    whole: bool = False,
    solver: CutSolver | None = None,
    search: SearchOptions = FAST,
    progress: Callable[[float], None] | None = None,
) -> LabelMap:
    """Search a part of a label map again, with everything else fixed; or all of it, from what shows.

    A small part is expanded at full size, from the labels that it has. A large part is searched from coarse
    to fine in a window round it, and the result is taken over if it costs less.

    Parameters
    ----------
    labelling : Labelling
        The problem of the whole canvas, as :attr:`toposeam.layers.Composition.labelling`, or with strokes, as
        :func:`toposeam.layers.apply_strokes` returns it. :func:`toposeam.layers.keep_costs` makes repeated
        searches fast.
    label_map : LabelMap
        Its solution so far; it is not changed.
    opened : (H, W) bool array, optional
        The pixels that may change. By default a window round the pixels that do not show the `fixed` layer,
        or, without `fixed`, that show one which is not allowed there.
    fixed : (H, W) int16 array, optional
        The number of the layer that must show, -1 where any may; ignored at pixels that are not open. A layer
        must have pixels where it is fixed.
    whole : bool
        Search everything from coarse to fine, from what shows on; `opened` is left out.
    solver : CutSolver, optional
        The engine that decides moves; by default minimum cuts by the fastest algorithm for their size.
    search : SearchOptions, optional
        The effort of the search.
    progress : callable, optional
        Called between cuts with the share of the work done, in [0, 1]. What it raises ends the search.

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
    >>> again = ts.layers.recut(joined.labelling, joined.solution, fixed=fixed)
    >>> bool((again.labels[8:12, 38:42] == fixed[8:12, 38:42]).all())
    True
    """
    check_kind("labelling", labelling, Labelling, "a Labelling, such as Composition.labelling")
    check_kind("label_map", label_map, LabelMap, "a LabelMap, such as Composition.solution")
    check_kind("solver", solver, (CutSolver, type(None)), "a CutSolver or None")
    check_kind("search", search, SearchOptions, "SearchOptions")
    check_choice("whole", whole, (True, False))
    check_function("progress", progress)
    shape = labelling.canvas.shape
    if fixed is not None:
        fixed = as_labels(fixed, shape, "fixed")
    if solver is None:
        solver = CutSolver("auto", None, labelling.forbidden, flow_nodes=_FLOW_NODES)
    started = time.perf_counter()
    if whole:
        opened = np.ones(shape, bool)
    elif opened is None:
        opened = _window_round(_wrong(labelling, label_map.labels, fixed))
    elif not isinstance(opened, TileMap):
        opened = as_mask(opened, shape, "opened")
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
    if whole and fixed is None:
        part = labelling
    else:
        part = window_of_labelling(labelling, box, _choices_in(labelling, box, start, inside))
    problem = Problem(part, solver, search, None, Progressed(progress))
    part.make_allowed(start)
    if not whole and (np.count_nonzero(inside) <= _EXPANDED_PIXELS or min(box.shape) < 4 * search.shortest):
        found = expand_from(problem, start)
    else:
        found = _from_coarse(problem, start)
    labels = label_map.labels.copy()
    labels[box.slices] = found
    found_map = with_figures(problem, labels, label_map.rounds, started - label_map.seconds)
    return dataclasses.replace(found_map, lost_strokes=label_map.lost_strokes)


def _from_coarse(problem: Problem, start: Labels) -> Labels:
    """(H, W) int16: the label map after a search from coarse to fine, from what shows on.

    At the coarsest size all layers expand. At finer sizes only pixels beside seams that have moved are open;
    elsewhere the labels are those of the start.
    """
    levels = levels_of(problem, problem.search.wandering[0])
    starts = [start]
    for level in levels[1:]:
        starts.append(np.ascontiguousarray(starts[-1][::2, ::2]))
        level.labelling.make_allowed(starts[-1])
    labels = expand_from(levels.pop(), starts[-1])
    while levels:
        level, moved = levels.pop(), square_dilation(labels != starts.pop(), _MOVED_REACH)
        shape = starts[-1].shape
        near = dense(opened_at(dense(beside_seams(labels)) & moved, level.labelling))
        labels = np.where(dense(doubled(moved, shape)), dense(doubled(labels, shape)), starts[-1])
        level.labelling.make_allowed(labels)
        refine(level, labels, near, _ROUNDS)
    fuse(problem, labels, start)
    return labels


def _wrong(labelling: Labelling, labels: Labels, fixed: Labels | None) -> Mask:
    """(H, W) bool: pixels that do not show the fixed layer, or, without it, show one that is not allowed."""
    wrong: Mask
    if fixed is not None:
        wrong = (fixed >= 0) & (labels[:, :] != fixed)
        return wrong
    wrong = new_map(labels.shape, False, bool)
    for index, place in enumerate(labelling.places):
        for box in blocks(place.shared(labelling.canvas)):
            if uniform(labelling.allowed[index], box.moved(-place.top, -place.left)):
                continue
            here = (labels[box.slices] == index) & ~labelling.allowed_in(index, box)
            if here.any():
                wrong[box.slices] = wrong[box.slices] | here
    return wrong


def _window_round(wrong: Mask) -> Mask:
    """(H, W) bool: a window round pixels that must change, without its rim, and these pixels."""
    tight = _box_round(wrong)
    if tight is None:
        return wrong
    canvas = Box(0, 0, *wrong.shape)
    box = tight.grown(max(_LEAST_MARGIN, max(tight.shape) // 2)).shared(canvas)
    steps = zip(box, canvas, (_FIXED_RIM, _FIXED_RIM, -_FIXED_RIM, -_FIXED_RIM), strict=True)
    inner = Box(*(edge if edge == end else edge + step for edge, end, step in steps))
    opened: Mask = wrong.copy()
    opened[inner.slices] = True
    return opened


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


def _box_round(opened: Mask) -> Box | None:
    """Return the smallest box with all True pixels of a mask, grown by a pixel on the canvas; None if there
    are none.
    """
    canvas, found = Box(0, 0, *opened.shape), None
    for block in blocks(canvas):
        inside = opened[block.slices] if uniform(opened, block) is not np.False_ else None
        if inside is not None and inside.any():
            own = Box.of(*box_of(inside)).moved(*block[:2])
            found = own if found is None else found.around(own)
    return None if found is None else found.grown(1).shared(canvas)
