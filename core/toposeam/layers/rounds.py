"""Rounds of moves that lower the total cost of a label map until none does any more.

Layers are joined one after another, as the thesis joins patches: each further one is expanded over what is
there. An early seam cannot know what comes later, so *rounds* of moves follow
(:mod:`toposeam.layers.labelling`): expansions until they gain nothing more, which are the stronger move, then
swaps. Each is one seam problem. A move that does not lower the total is not made, so the rounds end.

They end in an optimum that depends on where they started: hardly where layers show the same things, by up to
a fifth of the cost where they have little in common. So there are two starts: the layers joined one after
another, and the layers simply on top of each other. The cheaper end is taken.

Large canvases are looked at reduced first (:mod:`toposeam.layers.reduction`); there all of this happens.
Then, at every finer size, only pixels beside the seams, and beside flow that the heat had not yet decided,
are opened again. Where two layers meet one swap finds the best seam among these; where three or more meet,
windows round such places have rounds of their own.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Sequence
from copy import copy
from typing import Any, cast

import numpy as np

from toposeam.images import Mask
from toposeam.layers.band import write_pixels
from toposeam.layers.dividing import LEAST_GAIN, Divided, Division, Pixels, Potential, divided
from toposeam.layers.junctions import beside_steps, junctions
from toposeam.layers.labelling import Labelling, Move, Pair
from toposeam.layers.layer import Box
from toposeam.layers.maps import dense, new_map, part_of, several
from toposeam.layers.painting import LabelMap
from toposeam.layers.parts import part_of_labelling
from toposeam.layers.reduction import enlarged, opened, reduced
from toposeam.layers.tasks import Executor, groups, results
from toposeam.seam.find import Method, method_options, solve
from toposeam.seam.heat import HeatOptions
from toposeam.seam.overlap import FREE
from toposeam.seam.solution import Solution
from toposeam.seam.thesis_options import ThesisOptions

#: Problems in which so many pixels have several layers to choose from, or more, are reduced first.
WHOLE_PIXELS = 10_000
#: On reduced canvases the heat stops when no seam can be cheaper by more than this share.
ROUGH = 1e-2
#: Problems are not reduced below so many pixels a side.
_SHORTEST = 32
#: Where the label potential of two neighbours differs by more than this, heat has not decided yet; the pixels
#: themselves decide details only.
_UNDECIDED, _UNDECIDED_LAST = 0.03, 0.5
#: How far the windows reach round places where three layers meet, px.
_WINDOW = 24

#: Methods that solve a region with unary costs; the others leave it to heat.
_ANY_NETWORK: tuple[Method, ...] = ("heat", "shortest-path", "graph-cut")

#: Seams on canvases of so many pixels or less are sooner found than handed on.
_HANDED_ON = 1 << 19
#: On canvases of up to so many pixels the label potentials of all seams are kept.
KEPT_CANVAS = 1 << 25

Progress = Callable[[float], None]


def best_rounds(
    labelling: Labelling,
    order: Sequence[int],
    method: Method,
    options: dict[str, Any],
    most: int,
    progress: Progress | None = None,
    potentials: bool = False,
    executor: Executor | None = None,
) -> tuple[Rounds, int]:
    """The cheapest label map that is found, and how many rounds were made.

    Parameters
    ----------
    labelling : Labelling
    order : sequence of int
        In which the layers are joined.
    method, options
        How moves are solved, as for :func:`toposeam.find_seam`.
    most : int
        Rounds at most; with 0 the layers are only joined one after another.
    potentials : bool
        Whether the label potentials of all seams are wanted, however large the canvas is.
    executor : Executor, optional
        Where moves are made that do not touch (:mod:`toposeam.layers.tasks`).
    """
    steps = _Steps(progress)
    levels = [labelling]
    while (
        levels[-1].contested(WHOLE_PIXELS + 1) > WHOLE_PIXELS and min(levels[-1].canvas.shape) > 2 * _SHORTEST
    ):
        levels.append(reduced(levels[-1], executor))
        steps.one()
    coarsest = levels.pop()
    ends: list[tuple[float, int, Rounds, int]] = []
    for start in ("joined", "on top") if most else ("joined",):
        rounds = Rounds(
            coarsest, coarsest.on_top(), method, options, steps=steps, finer=len(levels), keeps=potentials
        )
        if start == "joined":
            rounds.join(order)
        number = rounds.run(most) if most else 0
        ends.append((coarsest.total(dense(rounds.label_map), coarsest.canvas), len(ends), rounds, number))
    _, _, rounds, number = min(ends, key=lambda end: end[:2])
    while levels:
        finer = levels.pop()
        near = opened(rounds.beside_seams(), finer)
        rounds = Rounds(
            finer, enlarged(rounds.label_map, finer), method, options, near, steps, len(levels), potentials
        )
        rounds.refine(most, executor if math.prod(finer.canvas.shape) > _HANDED_ON else None)
    return rounds, number


class _Steps:
    """Reports progress of which nobody knows the end: each step does a tenth of what is left."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress, self._left = progress, 1.0

    def one(self) -> None:
        self._left *= 0.9
        if self._progress is not None:
            self._progress(0.95 * (1 - self._left))


class Rounds:
    """Improves a label map in place, and knows the last solution of each pair.

    Parameters
    ----------
    labelling : Labelling
    label_map : (H, W) int16 array
        Changed in place.
    method, options
        How regions are solved, as for :func:`toposeam.find_seam`.
    near : (H, W) bool array, optional
        Only these pixels may change.
    finer : int
        How many finer solutions follow; where there are any, proofs within `ROUGH` do.
    keeps : bool
        Whether to keep label potentials however large the canvas is.
    """

    def __init__(
        self,
        labelling: Labelling,
        label_map: LabelMap,
        method: Method,
        options: dict[str, Any],
        near: Mask | None = None,
        steps: _Steps | None = None,
        finer: int = 0,
        keeps: bool = False,
    ) -> None:
        self._steps = _Steps(None) if steps is None else steps
        self.labelling, self.label_map, self._near = labelling, label_map, near
        self.method: Method = method if method in _ANY_NETWORK else "heat"
        self._options: HeatOptions | ThesisOptions | None = method_options(
            self.method, options if self.method == method else {}
        )
        self._undecided = None if not finer else _UNDECIDED_LAST if finer == 1 else _UNDECIDED
        if finer and isinstance(self._options, HeatOptions):
            tolerance = max(ROUGH, self._options.tolerance)
            self._options = dataclasses.replace(self._options, tolerance=tolerance)
        self.settings = {} if self._options is None else dataclasses.asdict(self._options)
        #: Of each pair what was last solved; on large canvases without labels and potentials.
        self.solved: dict[Pair, tuple[Box, Solution]] = {}
        self._keeps = keeps or math.prod(labelling.canvas.shape) <= KEPT_CANVAS
        #: Pixels beside flow that the heat had not decided.
        self._flows: dict[Pair, Pixels] = {}
        #: Of pairs that were divided as bands, the label potential of the pixels that were open.
        self.potentials: dict[Pair, Potential] = {}
        self.seconds: dict[Pair, float] = {}

    def join(self, order: Sequence[int]) -> None:
        """Lay the layers one after another, each joined to what is there along the best seam."""
        there = dense(self.label_map).copy()
        self.label_map[:, :] = -1
        for index in order:
            place, allowed = self.labelling.places[index], dense(self.labelling.allowed[index])
            part = self.label_map[place.slices]
            self.label_map[place.slices] = np.where(allowed & (part < 0), np.int16(index), part)
            self._expand(index)
        joined = dense(self.label_map)
        self.label_map[:, :] = np.where(joined < 0, there, joined)

    def run(self, most: int, within: Box | None = None) -> int:
        """Make rounds until nothing is gained, at most so many; returns how many, the last of them without
        gain.
        """
        places = self.labelling.places
        if within is None:
            growing, pairs = set(range(len(places))), sorted(self.labelling.costs)
        else:
            inside = within.shared(self.labelling.canvas)
            growing = {int(k) for k in np.unique(self.label_map[inside.slices]) if k >= 0}
            pairs = [pair for pair in sorted(self.labelling.costs) if growing >= set(pair)]
        waiting = set(pairs)
        layers = sorted(growing)
        for number in range(most):
            while growing:
                for index in layers:
                    changed = self._expand(index, within) if index in growing else None
                    growing.discard(index)
                    if changed is not None:
                        waiting |= {pair for pair in pairs if self._touches(pair, changed)}
                        growing |= {k for k in layers if k != index and all(places[k].shared(changed).shape)}
            for pair in pairs:
                changed = self._swap(pair, within) if pair in waiting else None
                waiting.discard(pair)
                if changed is not None:
                    waiting |= {other for other in pairs if other != pair and self._touches(other, changed)}
                    growing |= {k for k in layers if all(places[k].shared(changed).shape)}
            if not growing:
                return number + 1
        return most

    def refine(self, most: int, executor: Executor | None = None) -> None:
        """The best seams among the pixels that are open: one swap for each pair of layers that adjoin, and
        rounds where three layers meet.
        """
        pairs = self.labelling.adjoining(self.label_map)
        options, forbidden = self._options, np.isfinite(self.labelling.forbidden)
        if self._near is not None and isinstance(options, HeatOptions) and not forbidden:
            self._divide([pair for pair in pairs if pair in self.labelling.costs], options, executor)
        else:
            for pair in pairs:
                self._swap(pair)
        windows = junctions(self.label_map, _WINDOW)
        if executor is None:
            for window in windows:
                self.run(most, window)
            return
        items = ((self._part(window), most, window) for window in windows)
        for window, (labels, seconds) in zip(windows, results(executor, _run_on, items), strict=True):
            self._steps.one()
            self.label_map[window.shared(self.labelling.canvas).slices] = labels
            for pair, more in seconds.items():
                self.seconds[pair] = self.seconds.get(pair, 0.0) + more

    def _part(self, box: Box) -> Rounds:
        """The same as far as a box of the canvas is concerned, which nothing was found for yet."""
        part, box = copy(self), box.grown(1)
        part._steps = _Steps(None)
        part.labelling = part_of_labelling(self.labelling, box)
        part.label_map = part_of(self.label_map, box)
        part._near = None if self._near is None else part_of(self._near, box)
        part.solved, part._flows, part.potentials, part.seconds = {}, {}, {}, {}
        return part

    def beside_seams(self) -> Mask:
        """(H, W) bool: pixels beside a seam, or beside flow that the heat had not decided."""
        canvas = self.labelling.canvas
        chosen: Mask = new_map(canvas.shape, False, bool)
        for block in several(self.label_map, canvas):
            beside = beside_steps(self.label_map[block.slices], 0)
            chosen[block.slices] = chosen[block.slices] | beside
        for rows, columns in self._flows.values():
            write_pixels(chosen, rows, columns, np.ones(len(rows), bool))
        return chosen

    def _touches(self, pair: Pair, changed: Box) -> bool:
        return all(self.labelling.costs[pair].box.shared(changed).shape)

    def _expand(self, index: int, within: Box | None = None) -> Box | None:
        """Let a layer show more of itself; the box in which something changed, None where nothing was
        gained.
        """
        self._steps.one()
        move = self.labelling.expansion(self.label_map, index, within=within, opened=self._near)
        if move is None or not (move.problem.overlap.side == FREE).any():
            return None
        turned = move.problem.complete(solve(move.problem, self.method, self._options).labels).astype(bool)
        new = np.where(turned & (move.labels >= 0), np.int16(index), move.labels)
        before = self.labelling.total(move.labels, move.box)
        if self.labelling.total(new, move.box) >= before * (1 - LEAST_GAIN):
            return None
        return self._change(move, new)

    def _swap(self, pair: Pair, within: Box | None = None) -> Box | None:
        """Divide the region of two layers anew; the box in which something changed, None where nothing was
        gained.
        """
        self._steps.one()
        move = self.labelling.swap(self.label_map, pair, within=within, opened=self._near)
        if move is None or not (move.problem.overlap.side == FREE).any():
            return None
        problem = move.problem
        started = time.perf_counter()
        solution = solve(problem, self.method, self._options)
        if within is None:
            self._remember(
                pair, move.box, dataclasses.replace(solution, soft=problem.complete(solution.soft))
            )
        self.seconds[pair] = self.seconds.get(pair, 0.0) + time.perf_counter() - started
        # What is fixed for want of ties costs nothing there, and no more than before.
        old = problem.complete(move.labels == pair[1]).astype(bool)
        second = problem.complete(solution.labels).astype(bool)
        if problem.total(second) >= problem.total(old) * (1 - LEAST_GAIN):
            second = old
        either = (move.labels == pair[0]) | (move.labels == pair[1])
        return self._change(
            move, np.where(either, np.where(second, np.int16(pair[1]), np.int16(pair[0])), move.labels)
        )

    def _divide(self, pairs: Sequence[Pair], options: HeatOptions, executor: Executor | None) -> None:
        """Divide anew what is open between two layers, those pairs at once that do not touch."""
        boxes = [self.labelling.costs[pair].box for pair in pairs]
        for group in groups(boxes):
            parts = (self if executor is None else self._part(boxes[k]) for k in group)
            items = (part._division(pairs[k], options) for k, part in zip(group, parts, strict=True))
            for k, found in zip(group, results(executor, divided, items), strict=True):
                self._steps.one()
                if found is not None:
                    self._take(pairs[k], found)

    def _division(self, pair: Pair, options: HeatOptions) -> Division:
        near = cast(Mask, self._near)
        return Division(self.labelling, self.label_map, near, pair, options, self._undecided, self._keeps)

    def _take(self, pair: Pair, found: Divided) -> None:
        self.seconds[pair] = self.seconds.get(pair, 0.0) + found.seconds
        self.solved[pair] = Box(0, 0, 0, 0), found.solution
        if found.flows is not None:
            self._flows[pair] = found.flows
        if found.potential is not None:
            self.potentials[pair] = found.potential
        write_pixels(self.label_map, *found.pixels, found.values)

    def _remember(self, pair: Pair, box: Box, solution: Solution) -> None:
        self.potentials.pop(pair, None)
        if self._undecided is not None:
            undecided = beside_steps(np.asarray(solution.soft), self._undecided)
            inside = box.shared(self.labelling.canvas)
            rows, columns = np.nonzero(undecided[inside.within(box)])
            self._flows[pair] = rows + inside.top, columns + inside.left
        if self._undecided is not None or not self._keeps:
            nothing = np.zeros((0, 0), bool)
            solution = dataclasses.replace(
                solution, labels=nothing, soft=nothing.astype(np.float32), contracted=True
            )
            box = Box(box.top, box.left, box.top, box.left)
        self.solved[pair] = box, solution

    def _change(self, move: Move, new: LabelMap) -> Box | None:
        """Write a box of the label map; the smaller box in which it changed, and a pixel around."""
        changed = new != move.labels
        if not changed.any():
            return None
        box = move.box
        inside = box.shared(self.labelling.canvas)
        self.label_map[inside.slices] = new[inside.within(box)]
        rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
        top, left = box.top, box.left
        return Box(
            top + int(rows[0]), left + int(columns[0]), top + int(rows[-1]) + 1, left + int(columns[-1]) + 1
        ).grown(1)

    def known_potentials(self) -> dict[Pair, Potential]:
        """Of each pair that was solved, the label potential of the pixels that were open then."""
        found = dict(self.potentials)
        for pair in self.solved.keys() - found.keys():
            box, solution = self.solved[pair]
            inside = box.shared(self.labelling.canvas)
            soft = np.asarray(solution.soft, np.float32)[inside.within(box)]
            rows, columns = np.divmod(np.arange(soft.size), max(1, soft.shape[1]))
            found[pair] = rows + inside.top, columns + inside.left, soft.ravel()
        return found

    def pairs(self, potentials: bool = False) -> list[Pair]:
        """The pairs of layers that adjoin where both have pixels.

        Parameters
        ----------
        potentials : bool
            Whether to solve pairs that no round has solved, for their label potential.
        """
        found = self.labelling.adjoining(self.label_map)
        if potentials:
            for pair in found:
                if pair not in self.solved:
                    self._swap(pair)
        return [pair for pair in found if pair in self.labelling.costs]


def _run_on(item: tuple[Rounds, int, Box]) -> tuple[LabelMap, dict[Pair, float]]:
    """What rounds in a window end with, and how long the pairs took."""
    rounds, most, window = item
    rounds.run(most, window)
    return rounds.label_map[window.shared(rounds.labelling.canvas).slices], rounds.seconds
