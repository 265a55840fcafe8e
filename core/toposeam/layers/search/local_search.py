"""Moves that lower the total cost of a label map at one size until none does any more.

On the coarsest canvas expansions (:mod:`toposeam.layers.search.expansion_moves`) are made from several starts
(:mod:`toposeam.layers.search.initial_labellings`), because they end in an optimum that depends on the start:
hardly where layers show the same things, by up to a fifth of the cost where they have little in common. A
move that does not lower the total is not made, so the rounds end.

At every finer size only pixels beside the seams may change: on small canvases all of them together, on large
ones pair by pair (:mod:`toposeam.layers.search.two_label_band`). :mod:`toposeam.layers.search.multilevel`
leads from size to size.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from toposeam.arrays import Labels, Mask
from toposeam.heat.threads import one_thread
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import blocks, dense, new_map, part_of, several
from toposeam.layers.execution.tasks import on_boxes
from toposeam.layers.labelling.problem import Labelling, Pair
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
from toposeam.layers.search.problem import Problem, State, Ties
from toposeam.layers.search.two_label_band import Divided, Division, SeamHeat, divided, write_pixels
from toposeam.seam.cut_solver import CutSolver

#: How far beside seams the label potential is computed, px.
_SOFT = 4
#: Rounds of expansions at most in a window.
_MOST = 100


def search(problem: Problem, order: Sequence[int], most: int, ties: bool) -> tuple[State, int]:
    """The cheapest label map that expansions from several starts end in, with its near ties if they are
    wanted, and the number of rounds; with `most` 0 the layers are only joined in the given order.
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
    return State(label_map, ties=found), number


def refine(
    problem: Problem, state: State, most: int, *, ties: bool = False, everywhere: bool = False
) -> Ties:
    """Improve a label map among the pixels that may change; its near ties, if they are wanted.

    Parameters
    ----------
    problem : Problem
    state : State
    most : int
        Rounds of expansions at most.
    ties : bool
        Whether to look for near ties, for the next size.
    everywhere : bool
        Whether to look for them among all pixels, not only those that may change.
    """
    if state.near is not None and math.prod(state.near.shape) <= problem.search.together:
        with one_thread():
            found = _refine_together(problem, state, most, ties, everywhere)
        problem.steps.one()
        return found
    for _ in _divided(problem, state, potential=False):
        pass
    return {}


def _refine_together(problem: Problem, state: State, most: int, ties: bool, everywhere: bool) -> Ties:
    """One cut of all pixels that two layers may show, and expansions where more may."""
    labelling, options, solver = problem.labelling, problem.search, problem.solver
    near, labels, count = dense(state.near), dense(state.label_map), len(labelling.places)
    planes = reached(labels, count, options.band)
    may = []
    for k, plane in enumerate(planes):
        allowed = labelling.allowed_in(k, labelling.canvas)
        plane &= near & allowed
        if not everywhere:
            tied = k in state.ties
            allowed = plane | (allowed & doubled_around(state.ties[k], near.shape)) if tied else plane
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
    state.label_map[:, :] = choices.label_map()
    return found


def _near_ties(problem: Problem, choices: Choices) -> Ties:
    """Where each layer would show if the present seams cost more by a share."""
    width, dearer = choices.box.shape[1], problem.search.dearer
    turned = (choices.would_expand(k, problem.solver, dearer) for k in choices.layers)
    return {k: np.divmod(pixels, width) for k, pixels in zip(choices.layers, turned, strict=True)}


def beside_seams(label_map: Labels, reach: int = 0) -> Mask:
    """(H, W) bool: the pixels beside a seam, and those at most `reach` px from them."""
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


def find_potentials(problem: Problem, state: State) -> dict[Pair, SeamHeat]:
    """Gather heat along the seams, for their label potential beside them; other methods have none."""
    if problem.solver.options is None:
        return {}
    near = beside_seams(state.label_map, _SOFT) if state.near is None else state.near
    divisions = _divided(problem, State(state.label_map, near), potential=True)
    return {pair: found.heat for pair, found in divisions if found.heat is not None}


def _divided(problem: Problem, state: State, *, potential: bool) -> Iterator[tuple[Pair, Divided]]:
    """Divide all pairs of layers that adjoin anew, those at once that do not touch."""
    labelling, executor = problem.labelling, problem.executor
    pairs = [pair for pair in labelling.adjoining(state.label_map) if pair in labelling.costs]
    boxes = [labelling.costs[pair].box for pair in pairs]

    def item(k: int) -> Division:
        parts = labelling, state.label_map, state.near
        if executor is not None:
            parts = _part(problem, state, boxes[k], pairs[k])
        return Division(*parts, pairs[k], problem.solver, potential)

    for k, found in on_boxes(executor, divided, item, boxes):
        problem.steps.one()
        if found is not None:
            write_pixels(state.label_map, *found.pixels, found.values)
            yield pairs[k], found


def _part(
    problem: Problem, state: State, box: Box, pair: Pair | None = None
) -> tuple[Labelling, Labels, Mask | None]:
    """A box of the problem, its label map and the pixels that may change, for another process."""
    box = box.grown(1)
    near = None if state.near is None else part_of(state.near, box)
    return part_of_labelling(problem.labelling, box, pair), part_of(state.label_map, box), near


def settle(problem: Problem, label_map: Labels) -> None:
    """Expand in windows round all places where three layers meet, in which every pixel may change."""
    labelling = problem.labelling
    windows = list(_windows(label_map, problem.search.window))

    def item(k: int) -> _Window:
        parts = labelling, label_map
        if problem.executor is not None:
            parts = _part(problem, State(label_map), windows[k])[:2]
        return _Window(*parts, windows[k], problem.solver)

    for k, labels in on_boxes(problem.executor, _settled, item, windows):
        problem.steps.one()
        label_map[windows[k].slices] = labels


@dataclass(frozen=True, slots=True, eq=False)
class _Window:
    """A window of a canvas, and how it is solved."""

    labelling: Labelling
    label_map: Labels
    box: Box
    solver: CutSolver


def _windows(label_map: Labels, reach: int) -> Iterable[Box]:
    """Windows round the places where three layers meet; those that run into each other are one."""
    canvas = Box(0, 0, *label_map.shape)
    return (window.shared(canvas) for window in junctions(label_map, reach))


def _settled(window: _Window) -> Labels:
    """The labels of a window after expansions, with its rim as it is."""
    labelling, box = window.labelling, window.box
    layers = [k for k, place in enumerate(labelling.places) if all(place.shared(box).shape)]
    layers.sort(key=lambda k: labelling.places[k])
    open_ = np.zeros(box.shape, bool)
    open_[1:-1, 1:-1] = True
    allowed = [labelling.allowed_in(k, box) & open_ for k in layers]
    choices = Choices(labelling, box, window.label_map[box.slices], allowed, layers)
    with one_thread():
        choices.run(window.solver, _MOST)
    return choices.label_map()
