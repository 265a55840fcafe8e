"""The search for a label map: its problem at one size, its state, and what is reported of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from toposeam.images import Mask
from toposeam.layers.canvas.painting import LabelMap
from toposeam.layers.execution.progress import Progressed
from toposeam.layers.execution.tasks import Executor
from toposeam.layers.labelling.problem import Labelling, Pair
from toposeam.layers.search.cut_solver import CutSolver
from toposeam.layers.search.options import SearchOptions
from toposeam.layers.search.two_label_band import Pixels, SeamHeat
from toposeam.seam.find import Method, method_options
from toposeam.seam.heat.method import HeatOptions
from toposeam.seam.thesis.options import ThesisOptions

#: Methods that cut networks; the others leave it to `auto`.
_ANY_NETWORK: tuple[Method, ...] = ("auto", "heat", "shortest-path", "graph-cut")

#: Of each layer rows and columns of the pixels, at half the size, where it nearly shows.
Ties = dict[int, Pixels]


@dataclass(frozen=True, slots=True)
class Problem:
    """A labelling problem at one size, and how it is solved."""

    labelling: Labelling
    method: Method
    options: HeatOptions | ThesisOptions | None
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
        own: Method = method if method in _ANY_NETWORK else "auto"
        # With `auto` heat cuts large networks and finds the label potentials, by these options.
        chosen = method_options("heat" if own == "auto" else own, options if own == method else {})
        return cls(labelling, own, chosen, search, executor, steps or Progressed(None))

    def reduced(self, labelling: Labelling) -> Problem:
        """The same problem at a smaller size, where rough solutions will do."""
        options = self.options
        if isinstance(options, HeatOptions):
            options = dataclasses.replace(options, tolerance=max(self.search.rough, options.tolerance))
        return dataclasses.replace(self, labelling=labelling, options=options)

    @property
    def solver(self) -> CutSolver:
        """Decides moves."""
        return CutSolver(self.method, self.options, self.labelling.forbidden)

    @property
    def order(self) -> list[int]:
        """The layers in the order of their places, in which they expand."""
        places = self.labelling.places
        return sorted(range(len(places)), key=lambda k: places[k])


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A label map that is improved in place."""

    #: (H, W) int16.
    label_map: LabelMap
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
        options = None if self.problem.method == "auto" else self.problem.options
        return {} if options is None else dataclasses.asdict(options)
