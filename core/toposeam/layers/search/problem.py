"""A labelling problem at one size, with the means of its solution."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from toposeam.layers.execution.progress import Progressed
from toposeam.layers.execution.tasks import Executor
from toposeam.layers.labelling.problem import Labelling
from toposeam.layers.search.options import SearchOptions
from toposeam.layers.search.two_label_band import Pixels
from toposeam.seam.cut_solver import CutSolver
from toposeam.seam.find import Method

#: Per layer, the rows and columns of pixels, at half the size, where it nearly shows.
Ties = dict[int, Pixels]


@dataclass(frozen=True, slots=True)
class Problem:
    """A labelling problem at one size, with the solver and options of its search."""

    labelling: Labelling
    #: The engine that decides moves.
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
        """Return the problem at full size; method and options are those of :func:`toposeam.find_seam`."""
        solver = CutSolver.of(method, options, labelling.forbidden)
        return cls(labelling, solver, search, executor, steps or Progressed(None))

    def reduced(self, labelling: Labelling) -> Problem:
        """Return the same problem at a smaller size, where rough solutions are good enough."""
        return dataclasses.replace(self, labelling=labelling, solver=self.solver.rougher(self.search.rough))

    @property
    def engine(self) -> tuple[str, dict[str, Any]]:
        """The name of the engine that decides moves, and its options; "graph-cut" if no method is named."""
        solver = self.solver
        if solver.method == "auto":
            return "graph-cut", {}
        return solver.method, {} if solver.options is None else dataclasses.asdict(solver.options)

    @property
    def order(self) -> list[int]:
        """The layers in the order of their places, in which they expand."""
        places = self.labelling.places
        return sorted(range(len(places)), key=lambda k: places[k])
