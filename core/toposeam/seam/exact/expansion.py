r"""Expansion moves: some pixels may turn to another label, and a minimum cut decides which of them do
(Boykov, Veksler and Zabih 2001, doi:10.1109/34.969114).

At neighbours p and q that show i and j and may both turn to k, keeping both costs s = M_ij, turning p
c = M_kj, turning q b = M_ik, and turning both nothing. With x = 1 for a turned pixel that is ::

    s + (c - b - s) / 2 x_p + (b - c - s) / 2 x_q + (b + c - s) / 2 |x_p - x_q|

the unary costs of p and q and the cost of their interface, as in a seam problem. It is submodular while
s ≤ b + c. Where s > b + c, which a seam problem cannot express, b + c takes the place of s. The cut then
underestimates the cost of the present labels, and the move is made only where the true cost falls.

*A worked example.* One row of four pixels, of which the first shows i, the second and third j, the fourth k;
the second and third may turn to k. With M_ij = 5, M_ik = 1, M_jk = 3 at every interface::

    labels       i   j   j   k         turned        cost
    interfaces     5   0   3           none          5 + 0 + 3 = 8
                                       third         5 + 3 + 0 = 8
                                       both          1 + 0 + 0 = 1

Interface 1 (i is fixed, q = j may turn): unary 5 for q staying, 1 for q turning. Interface 2 (both may turn,
i = j): s = 0, b = c = 3, so 3 |x_p - x_q| and no unary. Interface 3 (k is fixed): unary 3 for p staying. The
least is 1: both turn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import AnyInts, Floats, Indices, Mask
from toposeam.heat.network import Network

#: A solver of minimum cuts: from a network and the costs of its elements to the nodes on the hot side, (n,)
#: bool.
Decide = Callable[[Network, Floats], Mask]

#: Least share by which a move must lower the cost of the pixels that it may change; less is rounding.
LEAST_GAIN = 1e-7
#: Least cost of an interface, so that every pixel is connected.
_LEAST_LINK = 1e-6


def interfaces_beside(open_: Mask, known: Mask) -> tuple[Indices, Indices]:
    """Return the interfaces beside some pixels of a box, first those between neighbours in a row.

    Parameters
    ----------
    open_ : (h, w) bool array
        At least one of the two pixels of an interface is among these,
    known : (h, w) bool array
        and both are among these.

    Returns
    -------
    first, second : (E,) int arrays
        Flat indices of the left or upper pixels, and of the others.
    """
    first = []
    for s, t in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        chosen = np.zeros(open_.shape, bool)
        chosen[s] = (open_[s] | open_[t]) & known[s] & known[t]
        first.append(np.flatnonzero(chosen))
    return np.concatenate(first), np.concatenate([first[0] + 1, first[1] + open_.shape[1]])


@dataclass(frozen=True, eq=False)
class BinaryCut:
    """Nodes to be divided between two terminals at least cost.

    A connected component that only one terminal pulls at goes to it as a whole; only the others need a
    minimum cut.
    """

    #: (n,) the connected component of each node, and a mask of nodes of which no two are joined.
    component: npt.NDArray[np.int32]
    apart: Mask
    #: (E,) elements: the nodes they join, n for the cold terminal, n + 1 for the hot one, and their costs.
    tail: AnyInts
    head: AnyInts
    cost: Floats

    @cached_property
    def _pulled(self) -> npt.NDArray[np.bool_]:
        """(2, n) bool: nodes whose component is joined to the cold terminal, and to the hot one."""
        n = len(self.component)
        pulled = np.zeros((2, int(self.component.max(initial=0)) + 1), bool)
        for side, terminal in zip(pulled, (n, n + 1), strict=True):
            side[self.component[self.tail[self.head == terminal]]] = True
        return pulled[:, self.component]

    def network(self) -> tuple[Network, Floats, Indices]:
        """Build the network of the nodes that both terminals pull at.

        Returns the network, the costs of its elements, and the indices of its nodes.
        """
        open_: Mask = np.logical_and(*self._pulled)
        chosen = np.flatnonzero(open_)
        size = len(chosen)
        number = np.empty(len(open_) + 2, np.intp)
        number[chosen] = np.arange(size)
        number[-2:] = size, size + 1
        own = np.flatnonzero(open_[self.tail])  # a component is open as a whole
        network = Network(size, number[self.tail[own]], number[self.head[own]], self.apart[chosen])
        return network, self.cost[own], chosen

    def hot(self, chosen: Indices, decided: Mask, now: Mask | None) -> Mask:
        """Return the hot nodes, (n,) bool, once a cut has decided the chosen ones.

        Nodes that no terminal pulls at stay as in `now`; by default they are cold.
        """
        cold, hot = self._pulled
        result = np.array(hot & ~cold if now is None else np.where(cold | hot, hot, now), bool)
        result[chosen] = decided
        return result

    def solve(self, decide: Decide, now: Mask | None = None) -> Mask:
        """Divide all nodes; returns those on the hot side, (n,) bool."""
        network, cost, chosen = self.network()
        return self.hot(chosen, decide(network, cost) if len(chosen) else np.zeros(0, bool), now)


class ExpansionMove:
    """A move on the pixels of a box, given by flat indices.

    Parameters
    ----------
    piece : (N,) int32 array
        The connected piece of each pixel that may turn, from 1 on; 0 of the others.
    width : int
        Pixels in a row of the box.
    ends : two (E,) int arrays
        The interfaces beside those pixels: their left or upper pixels, and the others.
    labels, turned : (N,) int arrays
        The present labels, and those when every pixel has turned that may.
    paid : callable
        Costs of interfaces, (e,) float64, from the labels at their two ends, (e,) each, and their numbers; 0
        where the labels are equal, and the same for either order of two labels.
    own : two (n,) float arrays, optional
        Unary costs of the pixels that may turn, in order: when they stay, and when they turn.
    """

    def __init__(
        self,
        piece: npt.NDArray[np.int32],
        width: int,
        ends: tuple[Indices, Indices],
        labels: npt.NDArray[Any],
        turned: npt.NDArray[Any],
        paid: Callable[[npt.NDArray[Any], npt.NDArray[Any], Any], Floats],
        own: tuple[npt.NDArray[Any], npt.NDArray[Any]] | None = None,
    ) -> None:
        self._piece, self._width, self._ends, self._own = piece, width, ends, own
        p, q = ends
        self._nodes = np.flatnonzero(piece)
        i, j, to_i, to_j = labels[p], labels[q], turned[p], turned[q]
        # Most interfaces lie within one label: they cost nothing now, and the same whether p or q turns.
        unlike = np.flatnonzero((i != j) | (to_i != to_j))
        self._q_turns = paid(i, to_j, slice(None))
        self._stay, self._p_turns = np.zeros(len(p)), self._q_turns.copy()
        self._stay[unlike] = paid(i[unlike], j[unlike], unlike)
        self._p_turns[unlike] = paid(to_i[unlike], j[unlike], unlike)
        #: Interfaces whose two ends differ in their present labels, or once both have turned.
        self._unlike = unlike

    def turned(self, decide: Decide, *, dearer: float = 0.0, now: Mask | None = None) -> Indices:
        """Find the pixels that turn in the minimum cut.

        Parameters
        ----------
        decide : callable
        dearer : float
            Share that is added to the costs of the present labels' interfaces.
        now : (N,) bool array, optional
            Pixels that turn where nothing decides; by default none.
        """
        nodes, piece, unlike = self._nodes, self._piece, self._unlike
        if not len(nodes):
            return nodes
        p, q = self._ends
        free_p, free_q = piece[p] > 0, piece[q] > 0
        both = free_p & free_q
        c, b, s = self._p_turns[unlike], self._q_turns[unlike], self._stay[unlike] * (1 + dearer)
        inside, on_p, on_q = both[unlike], free_p[unlike], free_q[unlike]
        least = np.minimum(s, c + b)
        # Cost of turning, less the cost of staying.
        more_p = np.where(inside, (c - b - least) / 2, c - s)[on_p]
        more_q = np.where(inside, (b - c - least) / 2, b - s)[on_q]
        count = len(nodes)
        number = np.empty(len(piece), np.intp)
        number[nodes] = np.arange(count)
        unary = np.zeros(count) if self._own is None else np.subtract(*self._own[::-1], dtype=float)
        unary += np.bincount(number[p[unlike[on_p]]], more_p, count)
        unary += np.bincount(number[q[unlike[on_q]]], more_q, count)
        link = self._q_turns.copy()
        link[unlike] = (c + b - least) / 2
        inner, tied = np.flatnonzero(both), np.flatnonzero(unary)
        cut = BinaryCut(
            component=piece[nodes],
            apart=np.add(*np.divmod(nodes, self._width)) % 2 == 0,
            tail=np.concatenate([number[p[inner]], tied]),
            head=np.concatenate([number[q[inner]], np.where(unary[tied] < 0, count + 1, count)]),
            cost=np.concatenate([np.maximum(link[inner], _LEAST_LINK), np.abs(unary[tied])]),
        )
        return nodes[cut.solve(decide, None if now is None else now[nodes])]

    def gaining(self, turned: Indices) -> tuple[Indices, float]:
        """Keep the turned pixels of those pieces whose cost falls; returns them, and by how much it falls."""
        if not len(turned):
            return turned, 0.0
        p, q = self._ends
        turning = np.zeros(len(self._piece), bool)
        turning[turned] = True
        one, other = turning[p], turning[q]
        after = np.select([one & other, one, other], [0.0, self._p_turns, self._q_turns], self._stay)
        number, count = np.maximum(self._piece[p], self._piece[q]), int(self._piece.max(initial=0)) + 1
        before, then = (np.bincount(number, costs, count) for costs in (self._stay, after))
        if self._own is not None:
            (stay, turn), number = self._own, self._piece[self._nodes]
            before += np.bincount(number, stay, count)
            then += np.bincount(number, np.where(turning[self._nodes], turn, stay), count)
        gains = then < before * (1 - LEAST_GAIN)
        return turned[gains[self._piece[turned]]], float((before - then)[gains].sum())
