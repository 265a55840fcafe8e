"""The seams of a label map, each made when it is asked for, and what they all come to."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from toposeam.arrays import Labels
from toposeam.images import box_of
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import BLOCK, dense, part_of, several
from toposeam.layers.composite.composition import Totals
from toposeam.layers.execution.tasks import Executor, results
from toposeam.layers.labelling.problem import Labelling, Pair, PairCost
from toposeam.layers.search.problem import Report
from toposeam.layers.search.two_label_band import costs_at
from toposeam.optimize.history import Termination
from toposeam.seam.problem.overlap import FREE
from toposeam.seam.problem.seam_problem import blocked
from toposeam.seam.result.seam import Seam
from toposeam.seam.result.verdict import Verdict, verdict_of

#: Beyond its box the problem of a seam keeps so many px, where boxes are large.
_MARGIN, _LARGE_BOX = 8, 1 << 20
#: The interfaces that begin in a block which goes on by a pixel: their direction and their two pixels.
_INTERFACES: Any = (1, np.s_[:BLOCK, :-1], np.s_[:BLOCK, 1:]), (0, np.s_[:-1, :BLOCK], np.s_[1:, :BLOCK])


@dataclass(frozen=True, slots=True, eq=False)
class _Between:
    """Two layers, their cost, and what shows where both have pixels."""

    pair: Pair
    cost: PairCost
    canvas: Box
    label_map: Labels


def _measured(between: _Between) -> tuple[int, float, Verdict]:
    """How many interfaces of a seam cost something, what all do, and what that says to eyes."""
    found = [(np.zeros(0, np.intp), np.zeros(0, np.intp))]
    label_map, canvas = between.label_map, between.canvas
    for block in several(label_map, between.cost.box.shared(canvas), side=BLOCK):
        labels = label_map[block.slices]
        first, second = (labels == k for k in between.pair)
        for axis, s, t in _INTERFACES:
            border = (first[s] & second[t]) | (second[s] & first[t])
            rows, columns = np.divmod(np.flatnonzero(border), max(1, border.shape[1]))
            at = (rows + block.top) * canvas.shape[1] + columns + block.left
            found.append((at, np.full(len(at), axis)))
    first_pixel, along = (np.concatenate(part) for part in zip(*found, strict=True))
    costs = costs_at(between.cost, canvas, first_pixel, along)
    dear = costs > 0
    y, x = np.divmod(first_pixel[dear], canvas.shape[1])
    return len(x), float(costs.sum()), verdict_of(costs[dear], x, y)


@dataclass(frozen=True, eq=False)
class Made:
    """The seams of a label map."""

    labelling: Labelling
    label_map: Labels
    report: Report
    #: Pairs whose seam was not searched.
    given: Collection[Pair]
    #: Recorded with every seam.
    common: Mapping[str, Any]
    _found: dict[Pair, tuple[int, float, Verdict]] = field(default_factory=dict)

    def __call__(self, pair: Pair, beside: bool) -> Seam:
        """The seam between two layers of :attr:`pairs`.

        Parameters
        ----------
        pair : (int, int)
        beside : bool
            Whether costs are wanted beside the seam only.
        """
        seam = self.labelling.seam(self.label_map, pair, within=self._seam_box(pair), beside=beside)
        if seam is None:
            raise ValueError(f"layers {pair[0]} and {pair[1]} have nothing in common")
        problem, box, shown = seam.problem, seam.box, seam.labels == pair[1]
        heat = self.report.gathered.get(pair)
        potential, kept = shown.astype(np.float32), None if heat is None else heat.potential
        if kept is not None:
            rows, columns, values = kept
            inside = (rows >= box.top) & (rows < box.bottom) & (columns >= box.left) & (columns < box.right)
            at = rows[inside] - box.top, columns[inside] - box.left
            free = problem.overlap.side[at] == FREE
            potential[at] = np.where(free, values[inside], potential[at])
        history, termination = ((), Termination.DIRECT) if heat is None else (heat.history, heat.termination)
        label_map, method = self.label_map, self.report.problem.solver.method
        return Seam(
            _shown=shown,
            _potential=None if kept is None and method in ("auto", "heat") else potential,
            _only_b=lambda: dense(label_map) == pair[1],
            cost=problem.cost(shown),
            history=history,
            method=self._engine(pair),
            termination=Termination.GIVEN if pair in self.given else termination,
            seconds=self.report.seconds / len(self.pairs),
            settings={**self.common, **self.report.settings},
            problem=problem,
        )

    def _engine(self, pair: Pair) -> str:
        """The engine that divided two layers: expansions are maximum flows where no method is named."""
        if pair in self.given:
            return "path"
        method = self.report.problem.solver.method
        return method if method != "auto" else "heat" if pair in self.report.gathered else "graph-cut"

    @cached_property
    def pairs(self) -> list[Pair]:
        """The pairs of layers that adjoin where both have pixels."""
        return [pair for pair in self.labelling.adjoining(self.label_map) if pair in self.labelling.costs]

    def check(self, executor: Executor | None = None) -> None:
        """Refuse seams that cut a forbidden interface.

        Raises
        ------
        OverlapError
        """
        forbidden = self.labelling.forbidden
        if np.isfinite(forbidden) and any(
            cost >= forbidden for _, cost, _ in self.measured(executor).values()
        ):
            raise blocked()

    def totals(self, executor: Executor | None = None) -> Totals:
        """Of all seams, their pairs looked at where an executor does so."""
        found = self.measured(executor)
        return Totals(
            length=float(sum(length for length, _, _ in found.values())),
            cost=sum(cost for _, cost, _ in found.values()),
            seconds=self.report.seconds,
            method=" and ".join(sorted({self._engine(pair) for pair in found})),
            verdicts=tuple(verdict for _, _, verdict in found.values())
            if self.common.get("law") == "natural"
            else (),
        )

    def measured(self, executor: Executor | None = None) -> dict[Pair, tuple[int, float, Verdict]]:
        """How long each seam is, px, what it costs, and its verdict, without making it."""
        if self._found:
            return self._found
        items = (self._between(pair, executor is not None) for pair in self.pairs)
        self._found.update(zip(self.pairs, results(executor, _measured, items), strict=True))
        return self._found

    def _between(self, pair: Pair, apart: bool) -> _Between:
        """What is measured of a seam, here or `apart` from what it is part of."""
        cost, label_map = self.labelling.costs[pair], self.label_map
        if apart:
            cost, label_map = cost.part(cost.box, {}), part_of(label_map, cost.box)
        return _Between(pair, cost, self.labelling.canvas, label_map)

    def _seam_box(self, pair: Pair) -> Box | None:
        """On large overlaps, the box of the seam and some pixels around it."""
        cost = self.labelling.costs.get(pair)
        if cost is None or cost.box.shape[0] * cost.box.shape[1] <= _LARGE_BOX:
            return None
        inside = cost.box.shared(self.labelling.canvas)
        labels = self.label_map[inside.slices]
        first, second = labels == pair[0], labels == pair[1]
        beside = np.zeros(labels.shape, bool)
        beside[:, 1:] |= (first[:, 1:] & second[:, :-1]) | (second[:, 1:] & first[:, :-1])
        beside[1:] |= (first[1:] & second[:-1]) | (second[1:] & first[:-1])
        if not beside.any():
            return None
        rows, columns = box_of(beside)
        return Box(rows.start, columns.start, rows.stop, columns.stop).moved(*inside[:2]).grown(_MARGIN)
