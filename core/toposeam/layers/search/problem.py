"""The search for a label map: its problem at one size, its state, and what is reported of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from toposeam.arrays import Labels, Mask
from toposeam.layers.execution.progress import Progressed
from toposeam.layers.execution.tasks import Executor
from toposeam.layers.labelling.problem import Labelling, Pair
from toposeam.layers.search.options import SearchOptions
from toposeam.layers.search.two_label_band import Pixels, SeamHeat
from toposeam.seam.cut_solver import CutSolver
from toposeam.seam.find import Method

#: Of each layer rows and columns of the pixels, at half the size, where it nearly shows.
Ties = dict[int, Pixels]


@dataclass(frozen=True, slots=True)
class Problem:
    """A labelling problem at one size, and how it is solved."""

    labelling: Labelling
    #: Decides moves.
    solver: CutSolver
    search: SearchOptions
    executor: Executor | None
    steps: Progressed

    @classmethod
    def of(
        cls,
        labelling: Labelling,
        method: Method,
        options: Mapping[str, Any],
        search: SearchOptions,
        executor: Executor | None = None,
        steps: Progressed | None = None,
    ) -> Problem:
        """The problem at full size, by a method and its options as for :func:`toposeam.find_seam`."""
        solver = CutSolver.of(method, options, labelling.forbidden)
        return cls(labelling, solver, search, executor, steps or Progressed(None))

    def reduced(self, labelling: Labelling) -> Problem:
        """The same problem at a smaller size, where rough solutions will do."""
        return dataclasses.replace(self, labelling=labelling, solver=self.solver.rougher(self.search.rough))

    @property
    def order(self) -> list[int]:
        """The layers in the order of their places, in which they expand."""
        places = self.labelling.places
        return sorted(range(len(places)), key=lambda k: places[k])


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A label map that is improved in place."""

    #: (H, W) int16.
    label_map: Labels
    #: (H, W) bool: the pixels that may change; None for all.
    near: Mask | None = None
    #: Where each layer nearly shows.
    ties: Ties = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """How the seams of a label map were found."""

    problem: Problem
    #: Rounds of expansions, and seconds of the whole search.
    rounds: int
    seconds: float
    #: Of pairs whose label potential is known.
    gathered: Mapping[Pair, SeamHeat] = field(default_factory=dict)

    @property
    def settings(self) -> dict[str, Any]:
        """The options of the method; `auto` has none."""
        solver = self.problem.solver
        return {} if solver.method == "auto" or solver.options is None else dataclasses.asdict(solver.options)
