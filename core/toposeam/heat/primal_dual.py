"""The heat path of least cost: a primal-dual Newton method whose every step heats the network anew.

With potential ψ between 0 on the cold and 1 on the hot terminal, jump d = ψ(head) - ψ(tail) and cost M per
element, the relaxed seam is the least of Σ M |d|; its dual is the largest flow f between the terminals with
|f| ≤ M. Writing d = u - v with u, v ≥ 0, points near both optima satisfy u (M - f) = v (M + f) = μ for a
small μ (the *central path*). One Newton step towards it is one heat network: element e conducts k = 1 / (u /
(M - f) + v / (M + f)), and the heat that enters at the nodes is the imbalance that the step removes. Where
the flow leaves room, M - |f|, the potential becomes level; it jumps where the flow fills the elements: there
is the seam. Mehrotra's predictor and corrector (1992, doi:10.1137/0802028) take two solutions with one
factorisation.

*Nothing here knows of pictures*, nor of how many dimensions they have: nodes and elements are all there is.
To divide anything else (voxels, superpixels, time) number the free nodes from 0 on and the fixed ones n
(cold) or n + 1 (hot), give every pair of neighbours an element and its cost, merge parallel ones
(:meth:`Network.quotient`), and step until the best cut is near enough to the bound::

    state = PrimalDual(Network(n, tail, head), cost)
    while (cut := state.best_cut())[0] > (1 + 1e-3) * state.bound:
        state.step()
    hot = state.potential[:n] > cut[1]

Every free node must be joined, through elements, to a terminal; BLAS should run on one thread
(:func:`toposeam.heat.threads.one_thread`).

*Bounds at every step.* The flow is feasible, so its size is a lower bound on every seam. The potential
cut at any threshold is a seam. When the two meet, the seam is proven to be the best one, up to the tolerance.
"""

from __future__ import annotations

from math import isfinite

import numpy as np

from toposeam.arrays import Floats
from toposeam.errors import SolverError
from toposeam.heat.network import Network

#: Longest step, as a share of the way to the boundary of the feasible set.
_LONGEST_STEP = 0.99
#: Largest share of a capacity that the first flow fills.
_FIRST_FILLING = 0.95
#: μ of the first state, as a share of the mean of M |d|.
_FIRST_MU = 0.25
#: Largest conductance of the first network, as a multiple of the median cost.
_FIRST_CONDUCTANCE = 1e3
#: Bounds of an element's cost, as multiples of the cost of a known seam: conductances span the square of the
#: range of costs. The upper one exceeds the seam itself, for if all elements of a chain cost the same, no
#: potential would tell which of them is the cheapest.
_LEAST_COST, _MOST_COST = 1e-7, 2.0
#: Thresholds at which the potential is cut.
_THRESHOLDS = 64


class PrimalDual:
    """State of the method between steps.

    Parameters
    ----------
    network : Network
        With free nodes; no element may join the two terminals.
    cost : (E,) float64 array, positive
        M, the cost of dividing the two nodes of each element.

    Attributes
    ----------
    cost : (E,) float64 array
        M, limited to between a ten-millionth and twice the cost of a first seam. Costs of cuts are computed
        from the given values.
    potential : (n + 2,) float64 array
        ψ; between steps it may lie a little outside [0, 1].
    jump, flow : (E,) float64 arrays
        d and f, counted from tail to head.
    bound : float
        The size of the flow: no seam costs less.
    """

    def __init__(self, network: Network, cost: Floats) -> None:
        self.network = network
        hot = network.terminal_elements[1]
        self._hot, self._into = hot, np.where(network.head[hot] == network.n + 1, 1.0, -1.0)
        self.cost = self._given = cost
        # Beside very large conductances double precision would lose the others, and where no seam will run
        # they are not needed: an element that costs more than a known seam is in no better one. Nor does it
        # matter how much less than the seam a very cheap element costs.
        limit = np.inf
        if cost.max() > _FIRST_CONDUCTANCE * cost.mean():
            limit = _FIRST_CONDUCTANCE * float(np.median(cost))
        while True:
            conductance = np.minimum(cost, limit)
            self.potential = network.solve(conductance)
            known = self.best_cut()[0]
            if not 0 < known < 0.1 * float(conductance.max()):
                break
            limit = known
        if known > 0:
            self.cost = np.clip(cost, _LEAST_COST * known, _MOST_COST * known)
        self.jump = self._jumps(self.potential)
        # Heat flow through these conductances is k d; scaled it fits the capacities.
        flow = conductance * self.jump
        fullest = float((np.abs(flow) / self.cost).max())
        self.flow = flow * (_FIRST_FILLING / fullest if fullest > 0 else 0.0)
        self.bound = self._flow_size()
        self._split(
            _FIRST_MU * float(self.cost @ np.abs(self.jump)) / len(cost) / self.cost + np.finfo(float).tiny
        )

    def _split(self, least: Floats) -> None:
        """Set u and v, whose difference is the jump, and the smaller of which is given."""
        self._up, self._down = np.maximum(self.jump, 0.0) + least, np.maximum(-self.jump, 0.0) + least

    def _jumps(self, potential: Floats) -> Floats:
        jump: Floats = potential.take(self.network.head) - potential.take(self.network.tail)
        return jump

    def _flow_size(self) -> float:
        return float(self.flow.take(self._hot) @ self._into)

    def best_cut(self) -> tuple[float, float]:
        """Find the cheapest cut of the potential: its cost, and the threshold above which nodes are hot.

        Of equally cheap cuts the one nearest to the middle is taken.
        """
        scaled = np.minimum(np.maximum(self.potential, 0.0), 1.0)  # np.clip takes longer on small networks
        scaled *= _THRESHOLDS
        scaled -= 0.5
        level = np.ceil(scaled, out=scaled).astype(np.intp)
        tail, head = level.take(self.network.tail), level.take(self.network.head)
        # Threshold j divides the elements whose levels lie at or below j on one side, above j on the other.
        opened = np.bincount(np.minimum(tail, head), self._given, _THRESHOLDS + 1)
        closed = np.bincount(np.maximum(tail, head), self._given, _THRESHOLDS + 1)
        costs = (opened - closed).cumsum()[:-1]
        ties = (costs <= (1 + 1e-9) * costs.min() + 1e-14 * costs.max()).nonzero()[0]
        best = int(ties[0] if len(ties) == 1 else ties[np.argmin(np.abs(ties - (_THRESHOLDS - 1) / 2))])
        return float(costs[best]), (best + 0.5) / _THRESHOLDS

    @np.errstate(divide="ignore", invalid="ignore", over="ignore")  # refused below if not finite
    def step(self) -> None:
        """Take one Newton step.

        Two free nodes that are joined to each other (cost 1), to the cold terminal (1 and 5) and to the hot
        one (5 and 1.5). Of the four cuts, 1 + 1 + 1.5 = 3.5 is the best: the first node hot, the second cold.
        The first network's potential says so already; each step raises the bound, and the heat gathers
        until the potential is the cut:

        >>> tail, head = np.array([2, 2, 0, 0, 1]), np.array([0, 1, 1, 3, 3])
        >>> state = PrimalDual(Network(2, tail, head), np.array([1.0, 5.0, 1.0, 5.0, 1.5]))
        >>> for _ in range(4):
        ...     print(state.potential[:2].round(3), f"{state.bound:.3f} ≤ {state.best_cut()[0]:.3f}")
        ...     state.step()
        [0.757 0.301] 2.838 ≤ 3.500
        [0.989 0.023] 3.454 ≤ 3.500
        [1. 0.] 3.500 ≤ 3.500
        [1. 0.] 3.500 ≤ 3.500

        Raises
        ------
        SolverError
            When the factorisation breaks down, or its solution is not finite.
        """
        up, down, flow, jump = self._up, self._down, self.flow, self.jump
        left_up, left_down = self.cost - flow, self.cost + flow
        conductance = 1.0 / (up / left_up + down / left_down)
        solve = self.network.factor(conductance)
        # Predictor: straight at μ = 0. x and y are the changes of f relative to the capacity that is left in
        # either direction.
        change = np.zeros(len(self.potential))
        change[:-2] = solve(self.network.surplus(-conductance * jump - flow))
        more = (self._jumps(change) + jump) * conductance
        x, y = more / left_up, more / left_down
        slow, fast = min(float(x.min()), -float(y.max())), max(float(x.max()), -float(y.min()))
        primal, dual = _step_length(1.0 - slow), _step_length(fast)
        product_up, product_down = up * left_up, down * left_down
        gap = float(product_up.sum() + product_down.sum())
        linear = float(product_up @ x - product_down @ y)
        square = float((product_up * x) @ x + (product_down * y) @ y)
        rest = (1.0 - primal) * gap + (primal - dual * (1.0 - primal)) * linear - primal * dual * square
        target = (rest / gap) ** 3 * gap / (2 * len(flow))
        # Corrector: at a smaller μ > 0, with the predictor's second-order terms.
        toward_up, toward_down = (
            target / left_up + up * x * (x - 1.0),
            target / left_down + down * y * (y + 1.0),
        )
        wanted = toward_up - toward_down - jump
        change[:-2] = solve(self.network.surplus(conductance * wanted - flow))
        more = (self._jumps(change) - wanted) * conductance
        x, y = more / left_up, more / left_down
        more_up, more_down = toward_up + up * (x - 1.0), toward_down - down * (y + 1.0)
        primal = _step_length(-min(float((more_up / up).min()), float((more_down / down).min())))
        fastest = max(float(x.max()), -float(y.min()))
        dual = _step_length(fastest)
        # Where a value is not finite, x or y is not, either.
        if not isfinite(fastest) and not (np.isfinite(change).all() and np.isfinite(more).all()):
            raise SolverError(
                "the heat network cannot be solved: its conductances are too far apart", kind="unsolved"
            )
        self.potential = self.potential + primal * change
        self._up, self._down = up + primal * more_up, down + primal * more_down
        self.jump = self._jumps(self.potential)
        self.flow = flow + dual * more
        self.bound = self._flow_size()


def _step_length(fastest: float) -> float:
    """Compute the length of a step, at most 1, when positive variables fall by up to the share `fastest`."""
    return 1.0 if fastest <= _LONGEST_STEP else _LONGEST_STEP / fastest
