"""Minimum cuts by which moves are decided."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.heat.network import Floats, Ints, Network
from toposeam.images import Mask
from toposeam.seam.automatic import FLOW_PIXELS
from toposeam.seam.exact.graph_cut import least_cut
from toposeam.seam.exact.maximum_flow import minimum_cut
from toposeam.seam.find import Method
from toposeam.seam.heat.method import HeatOptions
from toposeam.seam.heat.newton import Heat, gather_heat
from toposeam.seam.thesis.options import ThesisOptions

#: Decides a network: from conductors and costs to the nodes on the hot side, (n,) bool.
Decide = Callable[[Network, Floats], Mask]


@dataclass(frozen=True, slots=True)
class CutSolver:
    """Finds minimum cuts of networks.

    Parameters
    ----------
    method, options
        As for :func:`toposeam.find_seam`. With `auto` networks of up to 30,000 nodes are cut by maximum flow;
        larger ones gather heat, which is sooner found there.
    forbidden : float
        Interfaces that cost as much or more are forbidden.
    """

    method: Method
    options: HeatOptions | ThesisOptions | None
    forbidden: float

    def __call__(self, network: Network, cost: Floats) -> Mask:
        """(n,) bool: the nodes on the hot side of the cheapest cut."""
        if self.method == "heat" or (self.method == "auto" and network.n > FLOW_PIXELS):
            return self.heat(network, cost).hot[:-2]
        cut = least_cut if self.method == "graph-cut" else minimum_cut
        return cut(network, self._bounded(cost))

    def heat(self, network: Network, cost: Floats) -> Heat:
        """The heat of a network gathered along its cheapest cut."""
        options = self.options if isinstance(self.options, HeatOptions) else HeatOptions()
        return gather_heat(network, self._bounded(cost), options.tolerance, options.max_iterations)

    def _bounded(self, cost: Floats) -> Floats:
        """As much as all others together is forbidding enough."""
        if np.isfinite(self.forbidden):
            ordinary = float(cost[cost < self.forbidden].sum())
            cost = np.minimum(cost, 1.01 * ordinary if ordinary > 0 else cost.max())
        return cost


def decided(
    component: npt.NDArray[np.int32],
    white: Mask,
    tail: Ints,
    head: Ints,
    link: Floats,
    pull: Floats,
    decide: Decide,
    now: Mask | None = None,
) -> Mask:
    """(n,) bool: which nodes end on the hot side; `pull` is what not ending there costs more. `component` is
    the connected one of each node, (n,), and of `white` nodes no two are linked.
    """
    tied = np.flatnonzero(pull)
    warm, cool = np.zeros((2, int(component.max()) + 1), bool)
    for side, pulls in ((warm, pull[tied] > 0), (cool, pull[tied] < 0)):
        side[component[tied[pulls]]] = True
    result: Mask = warm[component]
    if now is not None:  # nothing pulls: all stays
        result = result | (now & ~(warm | cool)[component])
    open_ = (warm & cool)[component]
    chosen = np.flatnonzero(open_)
    size = len(chosen)
    if not size:
        return result
    if size < len(open_):
        inner, order = np.flatnonzero(open_[tail]), np.cumsum(open_) - 1
        tail, head, link = order[tail[inner]], order[head[inner]], link[inner]
        pull, white = pull[chosen], white[chosen]
        tied = np.flatnonzero(pull)
    strength = pull[tied]
    network = Network(
        size,
        np.concatenate([tail, tied]),
        np.concatenate([head, np.where(strength > 0, size + 1, size)]),
        white,
    )
    result[chosen] = decide(network, np.concatenate([link, np.abs(strength)]))
    return result
