"""The seams of a label map, computed on demand."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from toposeam.arrays import Labels
from toposeam.images import box_of
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import BLOCK, dense, part_of, several
from toposeam.layers.composite.seams import SeamFigures
from toposeam.layers.execution.tasks import Executor, results
from toposeam.layers.labelling.label_map import LabelMap, Pair
from toposeam.layers.labelling.problem import Labelling, PairCost
from toposeam.layers.search.two_label_band import costs_at
from toposeam.optimize.history import Termination
from toposeam.seam.problem.seam_problem import blocked
from toposeam.seam.result.seam import Seam
from toposeam.seam.result.verdict import Verdict, verdict_of

#: In an overlap of more pixels than _LARGE_OVERLAP, the problem of a seam is posed only on the box of the
#: seam, grown by _SEAM_MARGIN px: the whole one would take too much memory.
_LARGE_OVERLAP, _SEAM_MARGIN = 1 << 20, 8
#: The interfaces to the right and below that begin in a block, which is read with one more row and column:
#: their axis, and the slices of their two pixels.
_INTERFACES: Any = (1, np.s_[:BLOCK, :-1], np.s_[:BLOCK, 1:]), (0, np.s_[:-1, :BLOCK], np.s_[1:, :BLOCK])


#: Two layers, their match cost, the canvas, and the labels on their overlap.
_SeamOnOverlap = tuple[Pair, PairCost, Box, Labels]


def _measured(on_overlap: _SeamOnOverlap) -> tuple[int, float, Verdict]:
    """Count the interfaces of a seam that cost something; return that length, their total cost, and the
    verdict.
    """
    found = [(np.zeros(0, np.intp), np.zeros(0, np.intp))]
    pair, cost, canvas, label_map = on_overlap
    for block in several(label_map, cost.box.shared(canvas), side=BLOCK):
        labels = label_map[block.slices]
        first, second = (labels == k for k in pair)
        for axis, s, t in _INTERFACES:
            border = (first[s] & second[t]) | (second[s] & first[t])
            rows, columns = np.divmod(np.flatnonzero(border), max(1, border.shape[1]))
            at = (rows + block.top) * canvas.shape[1] + columns + block.left
            found.append((at, np.full(len(at), axis)))
    first_pixel, along = (np.concatenate(part) for part in zip(*found, strict=True))
    costs = costs_at(cost, canvas, first_pixel, along)
    dear = costs > 0
    y, x = np.divmod(first_pixel[dear], canvas.shape[1])
    return len(x), float(costs.sum()), verdict_of(costs[dear], x, y)


@dataclass(frozen=True, eq=False)
class SeamsOfMap:
    """The seams of a label map, each computed on demand."""

    labelling: Labelling
    label_map: LabelMap
    #: Pairs whose seam was given, not searched.
    given: Collection[Pair] = ()
    #: Settings that are recorded with every seam.
    common: Mapping[str, Any] = field(default_factory=dict)
    _figures: dict[Pair, SeamFigures] = field(default_factory=dict)

    @cached_property
    def pairs(self) -> Sequence[Pair]:
        """The pairs of layers that adjoin where both have pixels."""
        adjoining = self.labelling.adjoining(self.label_map.labels)
        return tuple(pair for pair in adjoining if pair in self.labelling.costs)

    def seam(self, pair: Pair, beside: bool = False) -> Seam:
        """Compute the seam between two layers of :attr:`pairs`.

        Parameters
        ----------
        pair : (int, int)
        beside : bool
            Whether costs are needed only beside the seam.
        """
        label_map = self.label_map
        labels = label_map.labels
        problem = self.labelling.seam(labels, pair, within=self._seam_box(pair), beside=beside)
        if problem is None:
            raise ValueError(f"layers {pair[0]} and {pair[1]} have nothing in common")
        (top, left), (height, width) = problem.overlap.start, problem.overlap.side.shape
        box = Box(top, left, top + height, left + width)
        shown = self.labelling.labels_in(labels, box) == pair[1]
        given = pair in self.given
        heats = label_map.method in ("graph-cut", "heat")
        return Seam(
            _shown=shown,
            _potential=None if heats else shown.astype(np.float32),
            _only_b=lambda: dense(labels) == pair[1],
            cost=problem.cost(shown),
            method="path" if given else label_map.method,
            termination=Termination.GIVEN if given else Termination.DIRECT,
            seconds=label_map.seconds / len(self.pairs),
            settings={**self.common, **label_map.settings},
            problem=problem,
        )

    def check(self, executor: Executor | None = None) -> None:
        """Refuse seams that cut a forbidden interface.

        Raises
        ------
        OverlapError
        """
        forbidden = self.labelling.forbidden
        if np.isfinite(forbidden) and any(one.cost >= forbidden for one in self.figures(executor).values()):
            raise blocked()

    def figures(self, executor: Executor | None = None) -> Mapping[Pair, SeamFigures]:
        """Compute length, cost and verdict of all seams, without making the seams."""
        if not self._figures:
            items = (self._on_overlap(pair, executor is not None) for pair in self.pairs)
            judged = self.common.get("law") == "natural"
            for pair, (length, cost, verdict) in zip(
                self.pairs, results(executor, _measured, items), strict=True
            ):
                self._figures[pair] = SeamFigures(
                    length=length, cost=cost, verdict=verdict if judged else None
                )
        return self._figures

    def _on_overlap(self, pair: Pair, apart: bool) -> _SeamOnOverlap:
        """Collect what :func:`_measured` needs of a pair; with `apart`, cut out for another process."""
        cost, labels = self.labelling.costs[pair], self.label_map.labels
        if apart:
            cost, labels = cost.part(cost.box, {}), part_of(labels, cost.box)
        return pair, cost, self.labelling.canvas, labels

    def _seam_box(self, pair: Pair) -> Box | None:
        """Return the box of a seam and a margin on a large overlap; None if the whole overlap is used."""
        cost = self.labelling.costs.get(pair)
        if cost is None or cost.box.shape[0] * cost.box.shape[1] <= _LARGE_OVERLAP:
            return None
        inside = cost.box.shared(self.labelling.canvas)
        labels = self.label_map.labels[inside.slices]
        first, second = labels == pair[0], labels == pair[1]
        beside = np.zeros(labels.shape, bool)
        beside[:, 1:] |= (first[:, 1:] & second[:, :-1]) | (second[:, 1:] & first[:, :-1])
        beside[1:] |= (first[1:] & second[:-1]) | (second[1:] & first[:-1])
        if not beside.any():
            return None
        return Box.of(*box_of(beside)).moved(*inside[:2]).grown(_SEAM_MARGIN)
