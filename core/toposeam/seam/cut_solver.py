"""Minimum cuts of networks by a seam method, for the moves of a labelling."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from toposeam.arrays import Floats, Mask
from toposeam.heat.network import Network
from toposeam.seam.automatic import FLOW_PIXELS
from toposeam.seam.find import Method, method_options
from toposeam.seam.heat.method import Heat, HeatOptions, gather_heat

#: Methods that cut any network; in the place of the others `auto` does.
_ANY_NETWORK: tuple[Method, ...] = ("auto", "heat", "shortest-path", "graph-cut")


@dataclass(frozen=True, slots=True)
class CutSolver:
    """Finds minimum cuts of networks.

    Parameters
    ----------
    method, options
        As for :func:`toposeam.find_seam`. With `auto` networks of up to `flow_nodes` nodes are cut by maximum
        flow; larger ones gather heat, which is sooner found there.
    forbidden : float
        Interfaces that cost as much or more are forbidden.
    flow_nodes : int
        Largest network, in nodes, that `auto` cuts by maximum flow.
    """

    method: Method
    options: HeatOptions | None
    forbidden: float = float("inf")
    flow_nodes: int = FLOW_PIXELS

    @classmethod
    def of(cls, method: Method, options: Mapping[str, Any], forbidden: float = float("inf")) -> CutSolver:
        """Choose the solver for a method and its options, both as for :func:`toposeam.find_seam`."""
        own: Method = method if method in _ANY_NETWORK else "auto"
        # With `auto` heat cuts large networks and computes label potentials; these are its options.
        chosen = method_options("heat" if own == "auto" else own, options if own == method else {})
        return cls(own, chosen if isinstance(chosen, HeatOptions) else None, forbidden)

    def rougher(self, tolerance: float) -> CutSolver:
        """Return a solver whose heat stops at this tolerance, or at its own where that is larger."""
        if self.options is None:
            return self
        options = dataclasses.replace(self.options, tolerance=max(tolerance, self.options.tolerance))
        return dataclasses.replace(self, options=options)

    def __call__(self, network: Network, cost: Floats) -> Mask:
        """Find the nodes on the hot side of the cheapest cut, (n,) bool."""
        if self.method == "heat" or (self.method == "auto" and network.n > self.flow_nodes):
            return self.heat(network, cost).hot[:-2]
        if self.method == "graph-cut":
            from toposeam.seam.exact.graph_cut import least_cut

            return least_cut(network, self._bounded(cost))
        from toposeam.seam.exact.maximum_flow import minimum_cut

        return minimum_cut(network, self._bounded(cost))

    def heat(self, network: Network, cost: Floats) -> Heat:
        """Gather the heat of a network along its cheapest cut."""
        options = self.options or HeatOptions()
        return gather_heat(network, self._bounded(cost), options.tolerance, options.max_iterations)

    def _bounded(self, cost: Floats) -> Floats:
        """Limit forbidden costs to just above the sum of all others, which no best cut pays."""
        if np.isfinite(self.forbidden):
            ordinary = float(cost[cost < self.forbidden].sum())
            cost = np.minimum(cost, 1.01 * ordinary if ordinary > 0 else cost.max())
        return cost
