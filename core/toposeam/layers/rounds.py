"""Rounds of moves that lower the total cost of a labelling until none does any more.

One layer after another, as the thesis joins patches, an early seam cannot know what comes later. Two moves (Boykov, Veksler and Zabih 2001,
doi:10.1109/34.969114) undo that, each one seam problem solved by heat:

- *Expansion*: one layer may show more of itself, wherever it has pixels.
- *Swap*: what two layers hold between them is divided anew.

What a region costs beside the other layers enters as heat to the two terminals. A round expands until that gains nothing more, which is the
stronger move, then swaps. A move that does not lower the total is not made, so the rounds end.

They end in an optimum that depends on where they started: hardly where layers show the same things, by up to a fifth of the cost where they
have little in common. So small canvases, where it costs little time, have two starts: the layers joined one after another, and the layers
simply on top of each other. The cheaper end is taken.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Collection, Mapping
from typing import Any

import numpy as np

from toposeam.layers.labelling import Labelling, Pair
from toposeam.layers.layer import Box, cut
from toposeam.layers.painting import Owner
from toposeam.optimize.history import Termination
from toposeam.seam.find import Method, method_options, solve
from toposeam.seam.heat import HeatOptions
from toposeam.seam.overlap import FREE
from toposeam.seam.seam import Seam
from toposeam.seam.solution import Solution
from toposeam.seam.thesis import ThesisOptions

#: A move counts when it lowers the cost of its region by this share.
_LEAST_GAIN = 1e-7

#: Canvases with up to so many pixels have a second start.
SECOND_START_PIXELS = 100_000

#: Methods that solve a region with ties to further layers; the others leave it to heat.
_ANY_NETWORK: tuple[Method, ...] = ("heat", "shortest-path", "graph-cut")


def best_labelling(
    labelling: Labelling, joined: Owner, method: Method, options: dict[str, Any], most: int,
    progress: Callable[[float], None] | None = None,
) -> tuple[Rounds, int]:  # fmt: skip
    """The rounds from either start that ended at less cost, and how many they were; `joined` is changed."""
    if not most:
        return Rounds(labelling, joined, method, options), 0
    starts = [joined, labelling.on_top()] if joined.size <= SECOND_START_PIXELS else [joined]
    ends = []
    for share, start in enumerate(starts):
        moves = Rounds(labelling, start, method, options)
        number = moves.run(most, None if progress is None else _part(progress, share, len(starts)))
        ends.append((labelling.total(start, labelling.canvas.box), share, moves, number))
    _, _, moves, number = min(ends, key=lambda end: end[:2])
    return moves, number


def _part(progress: Callable[[float], None], index: int, count: int) -> Callable[[float], None]:
    return lambda part: progress((index + part) / count)


class Rounds:
    """Improves a labelling in place, and knows the last solution of each pair.

    Parameters
    ----------
    labelling : Labelling
    owner : (H, W) int16 array
        Changed in place.
    method, options
        How regions are solved, as for :func:`toposeam.find_seam`.
    """

    def __init__(self, labelling: Labelling, owner: Owner, method: Method, options: dict[str, Any]) -> None:
        self._labelling, self.owner = labelling, owner
        self.method: Method = method if method in _ANY_NETWORK else "heat"
        self._options: HeatOptions | ThesisOptions | None = method_options(self.method, options if self.method == method else {})
        self.settings = {} if self._options is None else dataclasses.asdict(self._options)
        self.solutions: dict[Pair, Solution] = {}
        self.seconds: dict[Pair, float] = {}

    def run(self, most: int, progress: Callable[[float], None] | None = None) -> int:
        """Make rounds until nothing is gained, at most so many; returns how many, the last of them without gain."""
        places = self._labelling.places
        pairs = [(i, j) for i in range(len(places)) for j in range(i + 1, len(places)) if self._labelling.cost((i, j)) is not None]
        growing, waiting = set(range(len(places))), set(pairs)
        for number in range(most):
            while growing:
                for index in range(len(places)):
                    changed = self._expand(index) if index in growing else None
                    growing.discard(index)
                    if changed is not None:
                        waiting |= {pair for pair in pairs if self._touches(pair, changed)}
                        growing |= {k for k, place in enumerate(places) if k != index and all(place.shared(changed).shape)}
            if progress is not None:
                progress((number + 0.5) / most)
            for pair in pairs:
                changed = self._swap(pair) if pair in waiting else None
                waiting.discard(pair)
                if changed is not None:
                    waiting |= {other for other in pairs if other != pair and self._touches(other, changed)}
                    growing |= {k for k, place in enumerate(places) if all(place.shared(changed).shape)}
            if progress is not None:
                progress((number + 1) / most)
            if not growing:
                return number + 1
        return most

    def _touches(self, pair: Pair, changed: Box) -> bool:
        cost = self._labelling.cost(pair)
        return cost is not None and all(cost.box.shared(changed).shape)

    def _expand(self, index: int) -> Box | None:
        """Let a layer show more of itself; the box in which something changed, None where nothing was gained."""
        problem, box = self._labelling.expansion(self.owner, index)
        if not (problem.overlap.side == FREE).any():
            return None
        labels = problem.complete(solve(problem, self.method, self._options).labels).astype(bool)
        shows = cut(self.owner, self._labelling.canvas.box, box, fill=-1)
        new = np.where(labels & (shows >= 0), np.int16(index), shows)
        if self._labelling.total(new, box) >= self._labelling.total(shows, box) * (1 - _LEAST_GAIN):
            return None
        return self._change(shows, new, box)

    def _swap(self, pair: Pair) -> Box | None:
        """Divide the region of two layers anew; the box in which something changed, None where nothing was gained."""
        problem = self._labelling.problem(self.owner, pair, settle=True)
        if problem is None or not (problem.overlap.side == FREE).any():
            return None
        started = time.perf_counter()
        self.solutions[pair] = solution = solve(problem, self.method, self._options)
        self.seconds[pair] = self.seconds.get(pair, 0.0) + time.perf_counter() - started
        box = self._labelling.box(pair)
        shows = cut(self.owner, self._labelling.canvas.box, box, fill=-1)
        old = problem.complete(shows == pair[1]).astype(bool)  # what was settled costs nothing there, and no more than before
        labels = problem.complete(solution.labels).astype(bool)
        if problem.total(labels) >= problem.total(old) * (1 - _LEAST_GAIN):
            labels = old
        new = np.where((shows == pair[0]) | (shows == pair[1]), np.where(labels, np.int16(pair[1]), np.int16(pair[0])), shows)
        return self._change(shows, new, box)

    def _change(self, shows: Owner, new: Owner, box: Box) -> Box | None:
        """Write a box of the labelling; the smaller box in which it changed, and a pixel around."""
        changed = new != shows
        if not changed.any():
            return None
        inside = box.shared(self._labelling.canvas.box)
        self.owner[inside.slices] = new[inside.within(box)]
        rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
        top, left = box.top, box.left
        return Box(top + int(rows[0]), left + int(columns[0]), top + int(rows[-1]) + 1, left + int(columns[-1]) + 1).grown(1)

    def seams(self, given: Collection[Pair], settings: Mapping[str, Any], potentials: bool = False) -> dict[Pair, Seam]:
        """The seams between layers as they show now, by pair; there is none where two adjoin without sharing a pixel.

        Parameters
        ----------
        given : collection of (int, int)
            Pairs whose seam was not searched.
        settings : mapping
            Recorded with each seam.
        potentials : bool
            Solve pairs that no round has solved, for their label potential.
        """
        found = {}
        for pair in self._labelling.adjoining(self.owner):
            problem = self._labelling.problem(self.owner, pair)
            if problem is None:
                continue
            shown = cut(self.owner, self._labelling.canvas.box, self._labelling.box(pair), fill=-1) == pair[1]
            problem.check(shown)
            if potentials and pair not in self.solutions and (problem.overlap.side == FREE).any():
                self.solutions[pair] = solve(problem, self.method, self._options)
            solution = self.solutions.get(pair, Solution(labels=shown, soft=shown.astype(np.float32)))
            potential = np.where(problem.overlap.side == FREE, solution.soft, shown.astype(np.float32))
            found[pair] = Seam(
                shown=shown, potential=potential, only_b=self.owner == pair[1], cost=problem.cost(shown), history=solution.history,
                method="path" if pair in given else self.method, termination=Termination.GIVEN if pair in given else solution.termination,
                seconds=self.seconds.get(pair, 0.0), settings={**settings, **self.settings}, problem=problem,
            )  # fmt: skip
        return found
