"""Rounds of moves that lower the total cost of a label map until none does any more.

Expansions (:mod:`toposeam.layers.choices`), which are the stronger move, are made until they gain nothing
more, then swaps, then expansions again. Each is one seam problem. A move that does not lower the total is not
made, so the rounds end. Where only two layers meet one swap finds the best seam; rounds are for the places
where three or more do. Seams of two layers are gathered by heat, whose potential also tells where it has not
decided; expansions, of which nothing but the labels is wanted, end sooner as maximum flows on small networks.

They end in an optimum that depends on where they started: hardly where layers show the same things, by up to
a fifth of the cost where they have little in common. So there are several starts
(:mod:`toposeam.layers.starts`).

:mod:`toposeam.layers.levels` does this on a reduced canvas first. At every finer size only pixels beside the
seams, and beside flow that the heat had not yet decided, are opened again: on small canvases all of them
together, on large ones pair by pair, with windows round the places where three layers meet.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from toposeam.heat.threads import one_thread
from toposeam.images import Mask
from toposeam.layers.band import write_pixels
from toposeam.layers.choices import Choices
from toposeam.layers.deciding import Deciding
from toposeam.layers.dividing import LEAST_GAIN, Divided, Division, Pixels, Potential, divided, undescribed
from toposeam.layers.junctions import beside_steps, doubled_around, reached, square_dilation
from toposeam.layers.labelling import Labelling, Move, Pair
from toposeam.layers.layer import Box
from toposeam.layers.maps import DENSE_PIXELS, dense, new_map, part_of, several
from toposeam.layers.meeting import meet_all
from toposeam.layers.painting import LabelMap
from toposeam.layers.parts import part_of_labelling
from toposeam.layers.progressed import Progressed
from toposeam.layers.receding import nearly, settle
from toposeam.layers.starts import best_of_starts, joined
from toposeam.layers.swapping import swap_all
from toposeam.layers.tasks import Executor, on_boxes
from toposeam.seam.find import Method, method_for, method_options, solve
from toposeam.seam.heat import HeatOptions
from toposeam.seam.overlap import FREE
from toposeam.seam.solution import Solution
from toposeam.seam.thesis_options import ThesisOptions

#: On reduced canvases the heat stops when no seam can be cheaper by more than this share.
ROUGH, _ROUGH_SMALL = 1e-2, 3e-2
#: Where the label potential of two neighbours differs by more than this, heat has not decided yet; the pixels
#: themselves decide details only, and on canvases above so many pixels less is looked at again.
_UNDECIDED = 0.005, 0.05
_UNDECIDED_LARGE, _LARGE = (0.03, 0.5), 1 << 20
#: Of problems of up to so many pixels more is looked at again: that finds nearly as much as reducing costs in
#: several ways does (:mod:`toposeam.layers.levels`), and takes less.
_UNDECIDED_SMALL, _SMALL = (0.002, 0.01), 1 << 19
#: Canvases of up to so many pixels are refined as a whole, all seams together, which is sooner done than
#: handed on; of large pictures those of half as many.
_TOGETHER = 1 << 19
#: How far from where a layer shows it may show at the next finer size, px; round tangles, all may change.
_REACH, _TANGLE = 4, 8
#: Where a layer would show if what does cost so much more it may at the next finer size: as far as others
#: recede together, and as far as it expands; how much more for a layer to be asked there whether it recedes.
_DEARER, _ASKED = (0.08, 0.15), 0.1
#: Cycles of expansions at most where three layers meet.
_CYCLES = 3

#: Methods that solve a region with unary costs; the others leave it to `auto`.
_ANY_NETWORK: tuple[Method, ...] = ("auto", "heat", "shortest-path", "graph-cut")

#: On canvases of up to so many pixels the label potentials of all seams are kept.
KEPT_CANVAS = 1 << 25


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
        steps: Progressed | None = None,
        finer: int = 0,
        keeps: bool = False,
    ) -> None:
        self.steps = Progressed(None) if steps is None else steps
        self.labelling, self.label_map, self.near = labelling, label_map, near
        self.method: Method = method if method in _ANY_NETWORK else "auto"
        # With `auto` divisions that show where seams are undecided, or whose potential is wanted, are heated.
        self._options: HeatOptions | ThesisOptions | None = method_options(
            "heat" if self.method == "auto" else self.method, options if self.method == method else {}
        )
        size = math.prod(labelling.canvas.shape)
        self._small = size * 4**finer <= _SMALL
        self._together = _TOGETHER if size * 4**finer <= DENSE_PIXELS else _TOGETHER // 2
        middle = _UNDECIDED_LARGE if 4 * size > _LARGE else _UNDECIDED  # by the finer one's size
        usual, last = _UNDECIDED_SMALL if self._small else middle
        self._undecided = None if not finer else last if finer == 1 else usual
        if finer and isinstance(self._options, HeatOptions):
            tolerance = max(_ROUGH_SMALL if self._small else ROUGH, self._options.tolerance)
            self._options = dataclasses.replace(self._options, tolerance=tolerance)
        given = None if self.method == "auto" else self._options
        self.settings = {} if given is None else dataclasses.asdict(given)
        #: Of each pair what was last solved; on large canvases without labels and potentials.
        self.solved: dict[Pair, tuple[Box, Solution]] = {}
        self._keeps, self._wants_potentials = keeps or size <= KEPT_CANVAS, keeps
        #: Pixels beside flow that the heat had not decided, and where single layers nearly show.
        self.undecided: dict[tuple[int, ...], Pixels] = {}
        #: Layers that may recede along several others.
        self.receding: Sequence[int] = ()
        self.decide = Deciding(self.method, self._options, labelling.forbidden)
        #: Where nobody asks for potentials, small canvases are not heated at full size.
        self._by_paths = self.decide.proves and not finer and not keeps
        #: Of pairs that were divided as bands, the label potential of the pixels that were open.
        self.potentials: dict[Pair, Potential] = {}
        self.seconds: dict[Pair, float] = {}

    def search(self, order: Sequence[int] | None, most: int, swaps: bool = True, afield: bool = False) -> int:
        """Expansions from several starts, and from the cheapest end swaps, unless they are left to finer
        sizes; with `most` 0 the layers are only joined in the given order; without an order all starts from
        what the label map shows; `afield` is as below. Returns how many rounds of expansions that took.
        """
        labelling, canvas = self.labelling, self.labelling.canvas
        boxes = labelling.places
        allowed = [labelling.allowed_in(k, canvas) for k in range(len(boxes))]
        choices = Choices(labelling, canvas, dense(self.label_map), allowed, range(len(boxes)))
        number, places = 0, sorted(range(len(boxes)), key=lambda k: boxes[k])
        with one_thread():
            if order is not None and not most:
                joined(choices, allowed, order, self.decide.exactly, self.steps)
            elif order is not None:
                given = None if self._small else order
                number, places = best_of_starts(
                    choices, allowed, boxes, given, self.decide.exactly, most, self.steps
                )
            for i, j in labelling.adjoining(choices.label_map()) if most and swaps else ():
                choices.swap(i, j, self.decide)
                if self._undecided is not None:
                    self._note(choices, (i, j))
            number += choices.run(self.decide.exactly, most - number, places)
            if self._small and most:
                dearer = 0.0 if self._undecided is None else _ASKED
                self.receding = settle(choices, self.decide.exactly, places, dearer)
            if afield and most:
                self.undecided |= nearly(choices, self.decide.exactly, places, self.receding, _DEARER)
        self.label_map[:, :] = choices.label_map()
        if self._undecided is None and most:
            for pair in labelling.adjoining(self.label_map):
                self.swap(pair)
        return number

    def refine(
        self,
        most: int,
        hints: Mapping[tuple[int, ...], Pixels] | None = None,
        executor: Executor | None = None,
        asked: Sequence[int] | None = None,
    ) -> None:
        """The best seams among the pixels that are open: one division of all that two layers may show, and
        rounds where three layers meet.

        Parameters
        ----------
        most : int
            Rounds at most.
        hints : mapping of layers to rows and columns, optional
            Pixels of the canvas at half the size that those may show.
        executor : Executor, optional
            Where moves are made that do not touch (:mod:`toposeam.layers.tasks`).
        asked : sequence of int, optional
            `undecided` is to tell of all that nearly changes, these layers being asked whether they recede.
        """
        labelling, canvas = self.labelling, self.labelling.canvas
        if self.near is not None and math.prod(canvas.shape) <= self._together:
            with one_thread():
                self._refine_together(most, hints or {}, asked)
            return
        pairs = labelling.adjoining(self.label_map)
        options, forbidden = self._options, np.isfinite(labelling.forbidden)
        if self.near is not None and isinstance(options, HeatOptions) and not forbidden:
            self._divide([pair for pair in pairs if pair in labelling.costs], options, executor)
        else:
            swap_all(self, [pair for pair in pairs if pair in labelling.costs], executor)
        meet_all(self, min(most, _CYCLES), executor)

    def part(self, box: Box, pair: Pair | None = None) -> Rounds:
        """As far as a box of the canvas is concerned (or a pair in it), which nothing was found for yet."""
        part, box = copy(self), box.grown(1)
        part.steps = Progressed(None)
        part.labelling = part_of_labelling(self.labelling, box, pair)
        part.label_map = part_of(self.label_map, box)
        part.near = None if self.near is None else part_of(self.near, box)
        part.solved, part.undecided, part.potentials, part.seconds = {}, {}, {}, {}
        part.decide = Deciding(self.method, self._options, self.labelling.forbidden)
        return part

    def _refine_together(
        self, most: int, hints: Mapping[tuple[int, ...], Pixels], asked: Sequence[int] | None
    ) -> None:
        labelling, canvas = self.labelling, self.labelling.canvas
        near, labels, count = dense(self.near), dense(self.label_map), len(labelling.places)
        planes = reached(labels, count, _REACH)
        may = [labelling.allowed_in(k, canvas) for k in range(count)]
        wide = {layers: doubled_around(hinted, canvas.shape) for layers, hinted in hints.items()}
        for i, j in hints.keys() & labelling.costs.keys():
            planes[i] |= wide[i, j]
            planes[j] |= wide[i, j]
        for k, (plane, allowed) in enumerate(zip(planes, may, strict=True)):
            plane &= near
            plane &= allowed
            if asked is None:
                allowed &= plane | wide[k,] if (k,) in wide else plane
        choices = Choices(labelling, canvas, labels, may, range(count))
        started = time.perf_counter()
        choices.by_paths = self._by_paths
        free, one, other = choices.divide_all(self.decide, planes)
        took = time.perf_counter() - started
        at = np.flatnonzero(free)
        codes = one[at].astype(np.int64) * count + other[at]
        pairs = [divmod(int(code), count) for code in np.unique(codes)]
        for i, j in pairs:
            self._solved_together((i, j), choices, at[codes == i * count + j], took / len(pairs))
        if self._undecided is not None:
            steep = choices.steep(self._undecided)
            for i, j in pairs:
                own = np.intersect1d(steep, at[codes == i * count + j], assume_unique=True)
                self.undecided[i, j] = np.divmod(own, choices.box.shape[1])
        tangled = (choices.several & ~free).reshape(canvas.shape)
        if asked is not None:
            places = sorted(range(count), key=lambda k: labelling.places[k])
            self.undecided |= nearly(choices, self.decide.exactly, places, asked, _DEARER)
        elif any(len(layers) == 1 for layers in hints):
            choices.run(self.decide.exactly, min(most, 1))
        elif tangled.any():
            near = square_dilation(tangled, _TANGLE).ravel()
            choices.run(self.decide.exactly, min(most, _CYCLES), within=near)
        self.label_map[:, :] = choices.label_map()
        self.steps.one()

    def _solved_together(self, pair: Pair, choices: Choices, own: npt.NDArray[np.intp], took: float) -> None:
        by_paths = self._by_paths and self.decide.heat is None
        engine = "shortest-path" if by_paths else "" if self.decide.heat is None else "heat"
        self.solved[pair] = Box(0, 0, 0, 0), undescribed(self.decide.heat, engine)
        self.seconds[pair] = self.seconds.get(pair, 0.0) + took
        if self._undecided is None and self._keeps and not self._by_paths:
            rows, columns = np.divmod(own, choices.box.shape[1])
            self.potentials[pair] = rows, columns, choices.soft[own]

    def _note(self, choices: Choices, pair: Pair) -> None:
        """Keep the pixels beside flow that was not decided between two layers."""
        self.undecided[pair] = np.divmod(choices.steep(self._undecided or 0.0), choices.box.shape[1])
        choices.soft[:] = -1

    def beside_seams(self) -> Mask:
        """(H, W) bool: pixels beside a seam, or beside flow that the heat had not decided."""
        canvas = self.labelling.canvas
        chosen: Mask = new_map(canvas.shape, False, bool)
        for block in several(self.label_map, canvas):
            beside = beside_steps(self.label_map[block.slices], 0)
            chosen[block.slices] = chosen[block.slices] | beside
        for rows, columns in self.undecided.values():
            write_pixels(chosen, rows, columns, np.ones(len(rows), bool))
        return chosen

    def swap(self, pair: Pair) -> None:
        """Divide the region of two layers anew."""
        self.steps.one()
        move = self.labelling.swap(self.label_map, pair, opened=self.near)
        if move is None or not (move.problem.overlap.side == FREE).any():
            return
        problem = move.problem
        started = time.perf_counter()
        wanted = self._undecided is not None or self._wants_potentials
        method = method_for(self.method, heats=wanted)
        solution = solve(problem, method, None if method == "auto" else self._options)
        self._remember(pair, move.box, dataclasses.replace(solution, soft=problem.complete(solution.soft)))
        self.seconds[pair] = self.seconds.get(pair, 0.0) + time.perf_counter() - started
        # What is fixed for want of ties costs nothing there, and no more than before.
        old = problem.complete(move.labels == pair[1]).astype(bool)
        second = problem.complete(solution.labels).astype(bool)
        if problem.total(second) >= problem.total(old) * (1 - LEAST_GAIN):
            second = old
        either = (move.labels == pair[0]) | (move.labels == pair[1])
        self._change(
            move, np.where(either, np.where(second, np.int16(pair[1]), np.int16(pair[0])), move.labels)
        )

    def _divide(self, pairs: Sequence[Pair], options: HeatOptions, executor: Executor | None) -> None:
        """Divide anew what is open between two layers, those pairs at once that do not touch."""
        boxes = [self.labelling.costs[pair].box for pair in pairs]

        def item(k: int) -> Division:
            of = self if executor is None else self.part(boxes[k], pairs[k])
            near = cast(Mask, of.near)
            return Division(of.labelling, of.label_map, near, pairs[k], options, self._undecided, self._keeps)

        for k, found in on_boxes(executor, divided, item, boxes):
            self.steps.one()
            if found is not None:
                self._take(pairs[k], found)

    def _take(self, pair: Pair, found: Divided) -> None:
        self.seconds[pair] = self.seconds.get(pair, 0.0) + found.seconds
        self.solved[pair] = Box(0, 0, 0, 0), found.solution
        if found.flows is not None:
            self.undecided[pair] = found.flows
        if found.potential is not None:
            self.potentials[pair] = found.potential
        write_pixels(self.label_map, *found.pixels, found.values)

    def _remember(self, pair: Pair, box: Box, solution: Solution) -> None:
        self.potentials.pop(pair, None)
        if self._undecided is not None:
            undecided = beside_steps(np.asarray(solution.soft), self._undecided)
            inside = box.shared(self.labelling.canvas)
            rows, columns = np.nonzero(undecided[inside.within(box)])
            self.undecided[pair] = rows + inside.top, columns + inside.left
        if self._undecided is not None or not self._keeps:
            nothing = np.zeros((0, 0), bool)
            solution = dataclasses.replace(
                solution, labels=nothing, soft=nothing.astype(np.float32), contracted=True
            )
            box = Box(box.top, box.left, box.top, box.left)
        self.solved[pair] = box, solution

    def _change(self, move: Move, new: LabelMap) -> None:
        """Write a box of the label map."""
        inside = move.box.shared(self.labelling.canvas)
        self.label_map[inside.slices] = new[inside.within(move.box)]

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
                    self.swap(pair)
        return [pair for pair in found if pair in self.labelling.costs]
