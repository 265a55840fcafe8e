"""How moves are decided: by the method asked for or, where only labels are wanted, by maximum flows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from toposeam.heat.network import Floats, Ints, Network
from toposeam.images import Mask
from toposeam.seam.automatic import FLOW_PIXELS
from toposeam.seam.find import Method
from toposeam.seam.flow import minimum_cut
from toposeam.seam.gathering import Heat, gather_heat
from toposeam.seam.graph_cut import least_cut
from toposeam.seam.heat import HeatOptions
from toposeam.seam.thesis_options import ThesisOptions

#: Decides a network: from conductors and costs to the nodes on the hot side, (n,) bool, and their potential.
Decide = Callable[[Network, Floats], tuple[Mask, Floats]]


class Deciding:
    """The cheapest cuts of networks, and what heat last did.

    Parameters
    ----------
    method, options
        As for :func:`toposeam.find_seam`; with `auto` heat finds potentials, by these options.
    forbidden : float
        Interfaces that cost as much or more are forbidden.
    """

    def __init__(self, method: Method, options: HeatOptions | ThesisOptions | None, forbidden: float) -> None:
        self.method: Method = method
        self.options, self.forbidden = options, forbidden
        #: How heat gathered when a cut was last found by it.
        self.heat: Heat | None = None

    @property
    def proves(self) -> bool:
        """Whether seams may as well be found by paths."""
        return self.method == "auto"

    def __call__(self, network: Network, cost: Floats) -> tuple[Mask, Floats]:
        """By the method that was asked for: the nodes on the hot side, (n,) bool, and their potential."""
        cost = self._bounded(cost)
        if isinstance(self.options, HeatOptions):
            self.heat = gather_heat(network, cost, self.options.tolerance, self.options.max_iterations)
            return self.heat.hot[:-2], np.clip(self.heat.soft[:-2], 0.0, 1.0)
        hot = (least_cut if self.method == "graph-cut" else minimum_cut)(network, cost)
        return hot, hot.astype(np.float64)

    def exactly(self, network: Network, cost: Floats) -> tuple[Mask, Floats]:
        """The same where no potential is wanted: with `auto` a maximum flow of small networks."""
        if self.method != "auto" or network.n > FLOW_PIXELS:
            return self(network, cost)
        hot = minimum_cut(network, self._bounded(cost))
        return hot, hot.astype(np.float64)

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
) -> tuple[Mask, Floats]:
    """(n,) bool: which nodes end on the hot side, and their potential; `pull` is what not ending there costs
    more. `component` is the connected one of each node, (n,), and of `white` nodes no two are linked.
    """
    tied = np.flatnonzero(pull)
    warm, cool = np.zeros((2, int(component.max()) + 1), bool)
    for side, pulls in ((warm, pull[tied] > 0), (cool, pull[tied] < 0)):
        side[component[tied[pulls]]] = True
    result: Mask = warm[component]
    if now is not None:  # nothing pulls: all stays
        result = result | (now & ~(warm | cool)[component])
    potential = result.astype(np.float64)
    open_ = (warm & cool)[component]
    chosen = np.flatnonzero(open_)
    size = len(chosen)
    if not size:
        return result, potential
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
    result[chosen], potential[chosen] = decide(network, np.concatenate([link, np.abs(strength)]))
    return result, potential


def questions(
    k: int, count: int, piece: npt.NDArray[np.int32], told: npt.NDArray[np.intp]
) -> list[tuple[int, bytes]]:
    """Of each piece of what may turn to k all that decides whether it does.

    Parameters
    ----------
    k, count : int
        How many pieces there are, numbered from 1 on.
    piece, told : (E,) int arrays
        In which piece each edge ends, and what is told of it.
    """
    if count > 1:
        told = told[np.argsort(piece.astype(np.int16) if count < 1 << 15 else piece, kind="stable")]
    ends = np.cumsum(np.bincount(piece, minlength=count + 1))
    bounds = zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)
    return [(k, told[first:last].tobytes()) for first, last in bounds]
