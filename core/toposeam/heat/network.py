"""Networks of heat conductors between two terminals, and their exact solution.

A network has ``n`` free nodes, numbered ``0 … n-1``, and two terminals: node ``n`` is *cold* (temperature 0),
node ``n + 1`` *hot* (1). Element ``e`` joins nodes ``tail[e]`` and ``head[e]`` with conductance ``k[e]``. The
steady state obeys K θ = F (thesis 3.6) with K assembled from the two-node element matrix k [[1, -1], [-1, 1]]
(3.11).

The assembly is a fixed template: the place of each element in the matrix is computed once per network, so
that a new set of conductances costs two passes over the elements and one factorisation
(:mod:`toposeam.heat.elimination`). Direct solution only: late in the optimisation conductances differ by nine
orders of magnitude, where iterative solvers stall.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from toposeam.arrays import AnyInts, Floats
from toposeam.errors import SolverError
from toposeam.heat.elimination import Factor, System, system

__all__ = ["Network"]


@dataclass(frozen=True, eq=False)
class Network:
    """Conductors between ``n`` free nodes and two terminals.

    Parameters
    ----------
    n : int
        Number of free nodes. Node ``n`` is the cold terminal, node ``n + 1`` the hot one.
    tail, head : (E,) int arrays
        The nodes each element joins; 64-bit integers are quicker to use, 32-bit ones half as large. Every
        free node must be connected, through elements, to a terminal.
    apart : (n,) bool array, optional
        Nodes of which no two are joined, such as the black fields of a chessboard. They are eliminated first,
        all at once.
    """

    n: int
    tail: AnyInts
    head: AnyInts
    apart: npt.NDArray[np.bool_] | None = field(default=None, repr=False)

    @cached_property
    def _inner(self) -> AnyInts:
        """The elements between two free nodes."""
        return np.flatnonzero((self.tail < self.n) & (self.head < self.n))

    @cached_property
    def _ends(self) -> tuple[tuple[AnyInts, AnyInts], tuple[AnyInts, AnyInts]]:
        """The elements that join free nodes to the cold terminal, with these nodes; likewise the hot one."""
        low, high = np.minimum(self.tail, self.head), np.maximum(self.tail, self.head)
        cold, hot = (np.flatnonzero((high == terminal) & (low < self.n)) for terminal in (self.n, self.n + 1))
        return (cold, low[cold]), (hot, low[hot])

    @property
    def terminal_elements(self) -> tuple[AnyInts, AnyInts]:
        """The elements that join a free node to the cold terminal, and to the hot one."""
        (cold, _), (hot, _) = self._ends
        return cold, hot

    @cached_property
    def _system(self) -> System:
        return system(self.n, self.tail[self._inner], self.head[self._inner], self.apart)

    @property
    def repeatable(self) -> bool:
        """True if every solution is the same to the last bit; otherwise that holds from the second one on."""
        return self._system.repeatable

    def solve(self, conductance: Floats) -> Floats:
        """Solve for the temperatures at given conductances.

        Parameters
        ----------
        conductance : (E,) float array, positive

        Returns
        -------
        (n + 2,) float array
            Temperatures in [0, 1]; the last two entries are the terminals' 0 and 1.

        Raises
        ------
        SolverError
            When the factorisation breaks down (a free node without connection, or a contrast beyond double
            precision).
        """
        n = self.n
        hot, hot_node = self._ends[1]
        load: Floats = np.bincount(hot_node, conductance[hot], n).astype(np.float64, copy=False)
        temperature = np.empty(n + 2)
        temperature[:n] = self.factor(conductance)(load)
        temperature[n:] = 0.0, 1.0
        return temperature

    def factor(self, conductance: Floats) -> Factor:
        """Factorise the network at given conductances.

        Returns a solver from the heat that enters at each free node, (n,), to temperatures (n,), with both
        terminals at 0.

        Parameters
        ----------
        conductance : (E,) float array, positive

        Raises
        ------
        SolverError
            As for :meth:`solve`.
        """
        diagonal = self._sums(self.tail, conductance) + self._sums(self.head, conductance)
        return self._system.factor(conductance.take(self._inner), diagonal[:-2])

    def surplus(self, flow: Floats) -> Floats:
        """Sum a flow (E,), counted from tail to head, to the net flow into every free node, (n,)."""
        return (self._sums(self.head, flow) - self._sums(self.tail, flow))[:-2]

    def _sums(self, node: AnyInts, values: Floats) -> Floats:
        return np.bincount(node, values, self.n + 2).astype(np.float64, copy=False)

    def difference(self, temperature: Floats) -> Floats:
        """Compute the temperature difference |θ_head - θ_tail| of every element, (E,) floats."""
        return np.abs(temperature.take(self.head) - temperature.take(self.tail))

    def components(self, joined: npt.NDArray[np.bool_]) -> AnyInts:
        """Merge the nodes that some elements join.

        Parameters
        ----------
        joined : (E,) bool array

        Returns
        -------
        (n + 2,) int array
            The group of every node, numbered from 0; the two terminals' groups come last.

        Raises
        ------
        SolverError
            When the elements join the two terminals.
        """
        total = self.n + 2
        graph = coo_array(
            (np.ones(np.count_nonzero(joined), np.int8), (self.tail[joined], self.head[joined])),
            shape=(total, total),
        )
        count, component = connected_components(graph, directed=False)
        cold, hot = component[self.n], component[self.n + 1]
        if cold == hot:
            raise SolverError("the merged elements join the two terminals", kind="unsolved")
        number = np.full(count, -1, np.int32)
        number[cold], number[hot] = count - 2, count - 1
        number[number < 0] = np.arange(count - 2, dtype=np.int32)
        group: AnyInts = number[component]
        return group

    def quotient(self, group: AnyInts) -> tuple[Network, AnyInts]:
        """Build the network between groups of nodes, in which parallel elements are one.

        Parameters
        ----------
        group : (n + 2,) int array
            As `components` returns it.

        Returns
        -------
        network : Network
        element_map : (E,) int array
            The new number of every element, -1 where its nodes are in one group or in those of the two
            terminals.
        """
        count = int(group[-1]) + 1
        first, second = group[self.tail], group[self.head]
        low, high = np.minimum(first, second), np.maximum(first, second)
        alive = np.flatnonzero((low != high) & (low < count - 2))
        key, inverse = np.unique(low[alive].astype(np.int64) * count + high[alive], return_inverse=True)
        element_map = np.full(len(self.tail), -1, np.int32)
        element_map[alive] = inverse
        apart = None
        if self.apart is not None:  # a node that stays alone stays apart
            apart = np.zeros(count, bool)
            apart[group[:-2][self.apart]] = True
            apart = (apart & (np.bincount(group, minlength=count) == 1))[:-2]
        kind = self.tail.dtype
        return Network(count - 2, (key // count).astype(kind), (key % count).astype(kind), apart), element_map
