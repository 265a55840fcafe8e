"""Moves that lower the cost of a label map at one size, until none gains.

On the coarsest canvas, expansions (:mod:`toposeam.layers.search.expansion_moves`) run from several starts
(:mod:`toposeam.layers.search.initial_labellings`), because they end in a local optimum. Its cost depends
little on the start if the layers show the same things, and by up to a fifth if they have little in common. A
move that does not lower the total is not made, so the rounds end.

At every finer size only pixels beside the seams may change: on small canvases all of them together, on large
ones pair by pair (:mod:`toposeam.layers.search.two_label_band`). :mod:`toposeam.layers.search.multilevel`
leads from size to size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from toposeam.arrays import Labels, Mask
from toposeam.heat.threads import one_thread
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import blocks, dense, new_map, part_of, several
from toposeam.layers.execution.tasks import on_boxes
from toposeam.layers.labelling.problem import Labelling
from toposeam.layers.labelling.seam_lines import (
    beside_steps,
    doubled_around,
    junctions,
    reached,
    square_dilation,
)
from toposeam.layers.labelling.subproblem import part_of_labelling
from toposeam.layers.search.expansion_moves import Choices
from toposeam.layers.search.initial_labellings import best_of_starts, join
from toposeam.layers.search.problem import Problem, Ties
from toposeam.layers.search.two_label_band import Division, divided, write_pixels
from toposeam.seam.cut_solver import CutSolver

#: Largest number of rounds of expansions in a window: a safeguard, as a few rounds reach the end.
_MOST_ROUNDS = 100


def search(problem: Problem, order: Sequence[int], most: int, ties: bool) -> tuple[Labels, Ties, int]:
    """Search the cheapest label map by expansions from several starts.

    Returns (H, W) int16 labels, their near ties if `ties`, and the number of rounds. With `most` 0 the layers
    are only joined in the given order.
    """
    labelling, canvas = problem.labelling, problem.labelling.canvas
    label_map, solver = labelling.on_top(), problem.solver
    allowed = [labelling.allowed_in(k, canvas) for k in range(len(labelling.places))]
    choices = Choices(labelling, canvas, dense(label_map), allowed, range(len(allowed)))
    number = 0
    with one_thread():
        if most:
            places = labelling.places
            number = best_of_starts(choices, allowed, places, solver, most, problem.search, problem.steps)
        else:
            join(choices, allowed, order, solver)
        found = _near_ties(problem, choices) if ties and most else {}
    label_map[:, :] = choices.label_map()
    problem.steps.one()
    return label_map, found, number


def refine(
    problem: Problem,
    labels: Labels,
    near: Mask,
    most: int,
    *,
    tied: Ties | None = None,
    ties: bool = False,
    everywhere: bool = False,
) -> Ties:
    """Improve a label map, in place, at the pixels that may change; return its near ties if `ties`.

    Parameters
    ----------
    problem : Problem
    labels : (H, W) int16 array
    near : (H, W) bool array
        The pixels that may change.
    most : int
        Largest number of rounds of expansions.
    tied : mapping, optional
        Pixels at the next smaller size where each layer nearly showed; it may show there, too.
    ties : bool
        Whether to find near ties, for the next size.
    everywhere : bool
        Whether to find them at all pixels, not only those that may change.
    """
    if math.prod(near.shape) <= problem.search.together:
        with one_thread():
            found = _refine_together(problem, labels, near, most, tied or {}, ties, everywhere)
        problem.steps.one()
        return found
    _divide_pairs(problem, labels, near)
    return {}


def _refine_together(
    problem: Problem,
    label_map: Labels,
    opened: Mask,
    most: int,
    tied: Ties,
    ties: bool,
    everywhere: bool,
) -> Ties:
    """Divide all pixels with two candidates in one cut; expand where there are more."""
    labelling, options, solver = problem.labelling, problem.search, problem.solver
    near, labels, count = dense(opened), dense(label_map), len(labelling.places)
    planes = reached(labels, count, options.band)
    may = []
    for k, plane in enumerate(planes):
        allowed = labelling.allowed_in(k, labelling.canvas)
        plane &= near & allowed
        if not everywhere:
            allowed = plane | (allowed & doubled_around(tied[k], near.shape)) if k in tied else plane
        may.append(allowed)
    choices = Choices(labelling, labelling.canvas, labels, may, range(count))
    free = choices.divide_all(solver, planes)
    tangled = (choices.several & ~free).reshape(near.shape)
    if everywhere:
        choices.run(solver, min(most, 1), problem.order[::-1])
    elif tangled.any():
        around = square_dilation(tangled, options.tangle).ravel()
        choices.run(solver, min(most, options.cycles), problem.order, within=around)
    found = _near_ties(problem, choices) if ties else {}
    label_map[:, :] = choices.label_map()
    return found


def _near_ties(problem: Problem, choices: Choices) -> Ties:
    """Find the pixels where each layer would show if the present seams cost more by a fraction."""
    width, dearer = choices.box.shape[1], problem.search.dearer
    turned = (choices.would_expand(k, problem.solver, dearer) for k in choices.layers)
    return {k: np.divmod(pixels, width) for k, pixels in zip(choices.layers, turned, strict=True)}


def beside_seams(label_map: Labels, reach: int = 0) -> Mask:
    """(H, W) bool mask of the pixels beside a seam, and of those at most `reach` px from them."""
    canvas = Box(0, 0, *label_map.shape)
    chosen: Mask = new_map(canvas.shape, False, bool)
    for block in several(label_map, canvas):
        chosen[block.slices] = chosen[block.slices] | beside_steps(label_map[block.slices])
    if not reach:
        return chosen
    wide: Mask = new_map(canvas.shape, False, bool)
    for block in blocks(canvas):
        around = block.grown(reach).shared(canvas)
        if chosen[around.slices].any():
            wide[block.slices] = square_dilation(chosen[around.slices], reach)[block.within(around)]
    return wide


def _divide_pairs(problem: Problem, labels: Labels, near: Mask) -> None:
    """Divide every pair of layers that adjoins anew, in place; pairs that do not touch at the same time."""
    labelling, executor = problem.labelling, problem.executor
    pairs = [pair for pair in labelling.adjoining(labels) if pair in labelling.costs]
    boxes = [labelling.costs[pair].box for pair in pairs]

    def item(k: int) -> Division:
        box, parts = boxes[k].grown(1), (labelling, labels, near)
        if executor is not None:
            parts = part_of_labelling(labelling, box, pairs[k]), part_of(labels, box), part_of(near, box)
        return *parts, pairs[k], problem.solver

    for _, found in on_boxes(executor, divided, item, boxes):
        problem.steps.one()
        if found is not None:
            (rows, columns), values = found
            write_pixels(labels, rows, columns, values)


def settle(problem: Problem, labels: Labels) -> None:
    """Expand in a window round each place where three layers meet; every pixel of it may change."""
    canvas = Box(0, 0, *labels.shape)
    windows = [window.shared(canvas) for window in junctions(labels, problem.search.window)]

    def item(k: int) -> Window:
        box, parts = windows[k], (problem.labelling, labels)
        if problem.executor is not None:
            parts = part_of_labelling(problem.labelling, box.grown(1)), part_of(labels, box.grown(1))
        return *parts, box, problem.solver

    for k, found in on_boxes(problem.executor, settled, item, windows):
        problem.steps.one()
        labels[windows[k].slices] = found


#: A labelling, its (H, W) int16 label map, a window of it, and how that is solved.
Window = tuple[Labelling, Labels, Box, CutSolver]


def settled(window: Window) -> Labels:
    """(h, w) int16: the labels of a window after expansions, from what shows on; its rim stays."""
    labelling, labels, box, solver = window
    inner = np.zeros(box.shape, bool)
    inner[1:-1, 1:-1] = True
    layers = layers_on(labelling, box)
    may = [labelling.allowed_in(k, box) & inner for k in layers]
    choices = Choices(labelling, box, labels[box.slices], may, layers)
    with one_thread():
        choices.run(solver, _MOST_ROUNDS)
    return choices.label_map()


def expand_from(problem: Problem, labels: Labels) -> Labels:
    """(H, W) int16: a label map after moves of all its pixels at full size, from what shows on.

    Pixels that two layers may show are divided anew by one cut, then all expand.
    """
    labelling, canvas = problem.labelling, problem.labelling.canvas
    layers = layers_on(labelling, canvas)
    may = [labelling.allowed_in(k, canvas) for k in layers]
    choices = Choices(labelling, canvas, labels, may, layers)
    with one_thread():
        choices.divide_all(problem.solver, may)
        choices.run(problem.solver, _MOST_ROUNDS)
    return choices.label_map()


def layers_on(labelling: Labelling, box: Box) -> list[int]:
    """The layers that lie on a box, in the order in which they expand."""
    near = [k for k, place in enumerate(labelling.places) if all(place.shared(box).shape)]
    return sorted(near, key=lambda k: labelling.places[k])
