"""Seams of many layers from coarse to fine.

Large canvases are looked at reduced first (:mod:`toposeam.layers.reduction`): there rounds of moves are
made (:mod:`toposeam.layers.rounds`). Then every finer size is refined where the coarser
one says that it matters. As long as canvases are small, a round of expansions over all pixels follows at
half the size, and at full size each layer may also show where it would there if what does cost a few per cent
more: near ties are decided by true costs.

Reduced costs are a guess at what a seam will cost, off by some per cent, and which of several ways it takes
hangs by less. So problems of up to some megapixels are reduced in several ways, each of which leads to other
mistakes; :mod:`toposeam.layers.fusion` takes the best of each, and what lies beside these seams is divided
once more. That ends within 0.5 % of what solving everything at full size does, instead of 2 %. Where three
layers meet, what is left of them is settled in windows in which everything may change
(:mod:`toposeam.layers.meeting`).

Large problems are searched anew each time, for they have many optima. Smaller ones, of which each search is
most of the time, are searched once; the other ways start where that ended, and are followed to full size only
where they lead elsewhere. On the smallest one way is as good, if more pixels are opened again for it
(:mod:`toposeam.layers.rounds`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from toposeam.images import Mask
from toposeam.layers.fusion import fused
from toposeam.layers.junctions import beside_steps, square_dilation
from toposeam.layers.labelling import Labelling
from toposeam.layers.maps import dense, new_map
from toposeam.layers.meeting import settle_all
from toposeam.layers.painting import LabelMap
from toposeam.layers.progressed import Progress, Progressed
from toposeam.layers.reduction import OTHERS, WANDERING, Tables, enlarged, halved, opened
from toposeam.layers.rounds import Rounds
from toposeam.layers.tasks import Executor
from toposeam.seam.find import Method

#: Where more pixels than this have several layers to choose from, costs are reduced in more than one way.
_ONCE = 1 << 16
#: Where more might change is looked for on all pixels where no more have: at half the size of all that are
#: reduced once.
_AFIELD = 1 << 14
#: Problems are reduced until no more than so many have: the first number where such expansions follow at the
#: next size, the second one in larger problems.
WHOLE_PIXELS, _WHOLE_LARGE = 3_500, 10_000
#: Problems are not reduced below so many pixels a side.
_SHORTEST = 32
#: Where more pixels than this have several layers to choose from, on canvases of up to so many pixels, costs
#: are reduced in several ways; how far beside the best seams pixels are opened again, px.
_TRIED, _TRIED_CANVAS, _BESIDE = 100_000, 1 << 22, 4


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
        In which the layers are joined if no rounds are wanted.
    method, options
        How moves are solved, as for :func:`toposeam.find_seam`.
    most : int
        Rounds at most; with 0 the layers are only joined one after another, in the order.
    potentials : bool
        Whether the label potentials of all seams are wanted, however large the canvas is.
    executor : Executor, optional
        Where moves are made that do not touch (:mod:`toposeam.layers.tasks`).
    """
    steps = Progressed(progress)
    search = _Search(order, method, options, most, steps, potentials, executor)
    height, width = labelling.canvas.shape
    looked = most and height * width <= _TRIED_CANVAS
    contested = labelling.contested(_TRIED + 1) if looked else 0
    if contested <= _TRIED:
        if contested > _ONCE:
            return search.twice(labelling)
        return search.from_coarse(labelling, WANDERING)
    found = [search.from_coarse(labelling, wandering) for wandering in (WANDERING, *OTHERS)]
    shows = dense(found[0][0].label_map)
    for other, _ in found[1:]:
        shows = fused(labelling, shows, dense(other.label_map))
    near = square_dilation(beside_steps(shows, 0), _BESIDE)
    rounds = Rounds(labelling, shows, method, options, near, steps, keeps=potentials)
    rounds.refine(most, executor=executor)
    before = dense(rounds.label_map).copy()
    settle_all(rounds, executor)
    _forget(rounds, dense(rounds.label_map) != before)
    return rounds, max(number for _, number in found)


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """How seams are looked for."""

    order: Sequence[int]
    method: Method
    options: dict[str, Any]
    most: int
    steps: Progressed
    potentials: bool
    executor: Executor | None

    def from_coarse(
        self, labelling: Labelling, wandering: float, trail: list[LabelMap] | None = None
    ) -> tuple[Rounds, int]:
        """What costs that were reduced in one way lead to, and how many rounds were made; `trail` takes the
        label maps of all sizes, the smallest first.
        """
        levels = self._levels(labelling, wandering)
        coarsest = levels.pop()
        rounds = self._rounds(coarsest, coarsest.on_top(), None, len(levels))
        afield = len(levels) == 1 and _few(coarsest)
        number = rounds.search(self.order, self.most, not (levels and _few(levels[-1])), afield)
        while levels:
            if trail is not None:
                trail.append(dense(rounds.label_map))
            finer = levels.pop()
            near = opened(rounds.beside_seams(), finer)
            hints = rounds.undecided
            asked = rounds.receding if len(levels) == 1 and _few(finer) else None
            rounds = self._rounds(finer, enlarged(rounds.label_map, finer), near, len(levels))
            rounds.refine(self.most, hints, self.executor, asked)
        if trail is not None:
            trail.append(dense(rounds.label_map))
        return rounds, number

    def twice(self, labelling: Labelling) -> tuple[Rounds, int]:
        """What costs that were reduced in one way lead to, and wherever another way leads to something
        cheaper, that.
        """
        trail: list[LabelMap] = []
        rounds, number = self.from_coarse(labelling, WANDERING, trail)
        shows = trail[-1]
        for wandering in OTHERS:
            other = self._otherwise(labelling, wandering, trail)
            shows = shows if other is None else fused(labelling, shows, other)
        changed = square_dilation(shows != trail[-1], 2 * _BESIDE)
        if not changed.any():
            return rounds, number
        near = square_dilation(beside_steps(shows, 0), _BESIDE) & changed
        label_map: LabelMap = new_map(shows.shape, -1, np.int16)
        label_map[:, :] = shows
        last = Rounds(
            labelling, label_map, self.method, self.options, near, self.steps, keeps=self.potentials
        )
        last.refine(self.most, executor=self.executor)
        _take_over(last, rounds, changed)
        return last, number

    def _otherwise(
        self, labelling: Labelling, wandering: float, trail: Sequence[LabelMap]
    ) -> LabelMap | None:
        """What costs that were reduced in another way lead to from where a search ended that left a trail,
        looked at where they lead elsewhere; None if they do nowhere.
        """
        levels = self._levels(labelling, wandering)
        coarsest = levels.pop()
        rounds = self._rounds(coarsest, trail[0].copy(), None, len(levels))
        rounds.search(None, self.most, not (levels and _few(levels[-1])))
        for known, fine in pairwise(trail):
            apart = dense(rounds.label_map) != known
            if not apart.any():
                return None
            finer = levels.pop()
            where = dense(opened(square_dilation(apart, 1), finer))
            near = dense(opened(rounds.beside_seams(), finer)) & where
            start: LabelMap = np.where(where, dense(enlarged(rounds.label_map, finer)), fine)
            rounds = self._rounds(finer, start, near, len(levels))
            rounds.refine(self.most, executor=self.executor)
        return dense(rounds.label_map)

    def _levels(self, labelling: Labelling, wandering: float) -> list[Labelling]:
        """The problem, and halved until few pixels have several layers to choose from."""
        small = labelling.contested(4 * _AFIELD + 1) <= 4 * _AFIELD
        whole = WHOLE_PIXELS if small else max(WHOLE_PIXELS, _WHOLE_LARGE)
        most = max(0, (min(labelling.canvas.shape) - 1) // (2 * _SHORTEST)).bit_length()
        if not most or labelling.contested(whole + 1) <= whole:
            return [labelling]
        tables = Tables(labelling.costs, most, self.executor, wandering)
        levels = [labelling]
        while levels[-1].contested(whole + 1) > whole and min(levels[-1].canvas.shape) > 2 * _SHORTEST:
            levels.append(halved(levels[-1], wandering))
            self.steps.one()
        return [labelling, *tables.kept(levels[1:])]

    def _rounds(self, labelling: Labelling, label_map: LabelMap, near: Mask | None, finer: int) -> Rounds:
        keeps = self.potentials
        return Rounds(labelling, label_map, self.method, self.options, near, self.steps, finer, keeps)


def _few(labelling: Labelling) -> bool:
    """Whether so few pixels have several layers to choose from that all of them are looked at."""
    return labelling.contested(_AFIELD + 1) <= _AFIELD


def _take_over(last: Rounds, rounds: Rounds, changed: Mask) -> None:
    """Let rounds that looked at a part of the canvas also know what others found for the rest of it."""
    for pair, solved in rounds.solved.items():
        last.solved.setdefault(pair, solved)
    for pair, seconds in rounds.seconds.items():
        last.seconds[pair] = last.seconds.get(pair, 0.0) + seconds
    _forget(rounds, changed)
    for pair, (rows, columns, soft) in rounds.potentials.items():
        if pair in last.potentials:
            own = last.potentials[pair]
            rows, columns = np.append(rows, own[0]), np.append(columns, own[1])
            soft = np.append(soft, own[2])
        last.potentials[pair] = rows, columns, soft


def _forget(rounds: Rounds, changed: Mask) -> None:
    """Drop what rounds know of the label potential of some pixels, as others decided these since."""
    for pair, (rows, columns, soft) in rounds.potentials.items():
        kept = np.flatnonzero(~changed[rows, columns])
        rounds.potentials[pair] = rows[kept], columns[kept], soft[kept]
