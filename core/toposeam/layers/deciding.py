"""How moves are decided: by the method asked for or, where only labels are wanted, by maximum flows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toposeam.heat.network import Floats, Network
from toposeam.images import Mask
from toposeam.seam.exact import minimum_cut
from toposeam.seam.find import Method
from toposeam.seam.gathering import Heat, gather_heat
from toposeam.seam.graph_cut import least_cut
from toposeam.seam.heat import HeatOptions
from toposeam.seam.thesis_options import ThesisOptions

#: Networks of up to so many nodes have their maximum flow sooner than heat gathers.
_BY_FLOW = 30_000


@dataclass(slots=True, eq=False)
class Deciding:
    """The cheapest cuts of networks, and what heat last did."""

    method: Method
    options: HeatOptions | ThesisOptions | None
    #: Interfaces that cost as much or more are forbidden.
    forbidden: float
    heat: Heat | None = None

    def __call__(self, network: Network, cost: Floats) -> tuple[Mask, Floats]:
        """By the method that was asked for: the nodes on the hot side, (n,) bool, and their potential."""
        cost = self._bounded(cost)
        if isinstance(self.options, HeatOptions):
            self.heat = gather_heat(network, cost, self.options.tolerance, self.options.max_iterations)
            return self.heat.hot[:-2], np.clip(self.heat.soft[:-2], 0.0, 1.0)
        hot = (least_cut if self.method == "graph-cut" else minimum_cut)(network, cost)
        return hot, hot.astype(np.float64)

    def exactly(self, network: Network, cost: Floats) -> tuple[Mask, Floats]:
        """The same where no potential is wanted: a maximum flow ends sooner than heat on small networks."""
        if not isinstance(self.options, HeatOptions) or network.n > _BY_FLOW:
            return self(network, cost)
        hot = minimum_cut(network, self._bounded(cost))
        return hot, hot.astype(np.float64)

    def _bounded(self, cost: Floats) -> Floats:
        """As much as all others together is forbidding enough."""
        if np.isfinite(self.forbidden):
            ordinary = float(cost[cost < self.forbidden].sum())
            cost = np.minimum(cost, 1.01 * ordinary if ordinary > 0 else cost.max())
        return cost
