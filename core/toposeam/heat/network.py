"""Networks of heat conductors between two terminals, and their exact solution.

A network has ``n`` free nodes, numbered ``0 … n-1``, and two terminals: node ``n`` is *cold* (temperature 0), node ``n + 1`` *hot* (1). Element ``e`` joins nodes ``tail[e]`` and ``head[e]`` with conductance ``k[e]``. The steady state obeys K θ = F (thesis 3.6)
with K assembled from the two-node element matrix k [[1, -1], [-1, 1]] (3.11).

The assembly is a fixed template: where each element lands in the matrix is worked out once per network, so that a new set of conductances
costs two passes over the elements and one Cholesky factorisation. Direct solution only: late in the optimisation conductances differ by nine
orders of magnitude, where iterative solvers stall.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dpbsv, dposv
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.csgraph import connected_components, reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from toposeam.errors import SolverError

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.signedinteger[Any]]

#: Up to this many free nodes a dense factorisation beats setting up a banded one.
DENSE_NODES = 48
#: Beyond this half-bandwidth sparse elimination (SuperLU) beats a banded factorisation.
WIDEST_BAND = 100


@dataclass(frozen=True, eq=False)
class Network:
    """Conductors between ``n`` free nodes and two terminals.

    Parameters
    ----------
    n : int
        Number of free nodes. Node ``n`` is the cold terminal, node ``n + 1`` the hot one.
    tail, head : (E,) int arrays
        The nodes each element joins. Every free node must be connected, through elements, to a terminal.
    order : (n,) int array, optional
        Elimination order of the free nodes; by default reverse Cuthill-McKee.
    """

    n: int
    tail: Ints
    head: Ints
    order: Ints | None = field(default=None, repr=False)

    @cached_property
    def _template(self) -> _Template:
        return _Template(self)

    def solve(self, conductance: Floats) -> Floats:
        """Temperatures for the given conductances.

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
            When the factorisation breaks down (a free node without connection, or a contrast beyond double precision).
        """
        return self._template.solve(conductance)

    def difference(self, temperature: Floats) -> Floats:
        """Temperature difference |θ_head - θ_tail| of every element, (E,) floats."""
        return np.abs(temperature[self.head] - temperature[self.tail])

    def components(self, joined: npt.NDArray[np.bool_]) -> Ints:
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
        graph = coo_array((np.ones(np.count_nonzero(joined), np.int8), (self.tail[joined], self.head[joined])), shape=(total, total))
        count, component = connected_components(graph, directed=False)
        cold, hot = component[self.n], component[self.n + 1]
        if cold == hot:
            raise SolverError("the merged elements join the two terminals")
        number = np.full(count, -1, np.int32)
        number[cold], number[hot] = count - 2, count - 1
        number[number < 0] = np.arange(count - 2, dtype=np.int32)
        group: Ints = number[component]
        return group

    def quotient(self, group: Ints) -> tuple[Network, Ints]:
        """The network between groups of nodes, in which parallel elements are one.

        Parameters
        ----------
        group : (n + 2,) int array
            As `components` returns it.

        Returns
        -------
        network : Network
        element_map : (E,) int array
            The new number of every element, -1 where its nodes are in one group or in those of the two terminals.
        """
        count = int(group[-1]) + 1
        first, second = group[self.tail], group[self.head]
        low, high = np.minimum(first, second), np.maximum(first, second)
        alive = np.flatnonzero((low != high) & (low < count - 2))
        key, inverse = np.unique(low[alive].astype(np.int64) * count + high[alive], return_inverse=True)
        element_map = np.full(len(self.tail), -1, np.int32)
        element_map[alive] = inverse
        return Network(count - 2, (key // count).astype(np.int32), (key % count).astype(np.int32)), element_map


class _Template:
    """Where each element of a network lands in the matrix, for the cheapest of three factorisations."""

    def __init__(self, network: Network) -> None:
        n, tail, head = network.n, network.tail, network.head
        self.n = n
        inner = (tail < n) & (head < n)
        self.inner = np.flatnonzero(inner)
        i, j = tail[self.inner], head[self.inner]
        self.i, self.j = i, j
        outer = np.flatnonzero(~inner)
        side = np.maximum(tail[outer], head[outer])
        self.cold = outer[side == n]
        self.hot = outer[side == n + 1]
        self.cold_node = np.minimum(tail[self.cold], head[self.cold])
        self.hot_node = np.minimum(tail[self.hot], head[self.hot])
        self.rank = np.arange(n, dtype=np.int32)
        if n <= DENSE_NODES:
            self.kind = "dense"
            return
        order = network.order
        if order is None:
            graph = csr_array((np.ones(2 * len(i), np.int8), (np.concatenate([i, j]), np.concatenate([j, i]))), shape=(n, n))
            order = reverse_cuthill_mckee(graph, symmetric_mode=True)
        rank = np.empty(n, np.int32)
        rank[order] = np.arange(n, dtype=np.int32)
        ri, rj = rank[i], rank[j]
        low, gap = np.minimum(ri, rj), np.abs(ri - rj)
        self.width = int(gap.max(initial=0))
        if self.width <= WIDEST_BAND:
            self.kind = "banded"
            self.position = low.astype(np.int64) * (self.width + 1) + gap
            self.rank = rank
        else:
            self.kind = "sparse"
            self.ordered = False
            self._compressed(np.arange(n, dtype=np.int32))

    def _compressed(self, rank: Ints) -> None:
        """Positions of the elements in compressed columns, diagonal included, once the nodes are numbered by rank."""
        n = self.n
        i, j, nodes = rank[self.i], rank[self.j], rank
        rows, columns = np.concatenate([i, j, nodes]), np.concatenate([j, i, nodes])
        place = np.lexsort((rows, columns))
        self.indices = rows[place].astype(np.int32)
        self.indptr = np.searchsorted(columns[place], np.arange(n + 1)).astype(np.int32)
        self.position = np.empty(len(place), np.int64)
        self.position[place] = np.arange(len(place))
        self.rank = rank

    def _eliminate(self, inner: Floats, diagonal: Floats, load: Floats) -> Floats:
        """Solve by SuperLU. The first factorisation finds an elimination order, which the later ones take as it is."""
        n = self.n
        data = np.empty(len(self.indices))
        data[self.position] = np.concatenate([-inner, -inner, diagonal])
        matrix = csc_array((data, self.indices, self.indptr), shape=(n, n))
        order = "NATURAL" if self.ordered else "MMD_AT_PLUS_A"
        try:
            # One column a panel: the supernodes of these matrices are narrow.
            factor = splu(matrix, order, diag_pivot_thresh=0.0, relax=8, panel_size=1, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise SolverError(f"the heat network cannot be solved: {error}") from error
        right = np.empty(n)
        right[self.rank] = load
        theta: Floats = factor.solve(right)[self.rank]
        if not self.ordered:
            self._compressed(factor.perm_c[self.rank].astype(np.int32))
            self.ordered = True
        return theta


    def solve(self, k: Floats) -> Floats:
        n = self.n
        inner, cold, hot = k[self.inner], k[self.cold], k[self.hot]
        load: Floats = np.bincount(self.hot_node, hot, n).astype(np.float64, copy=False)
        diagonal: Floats = np.bincount(self.i, inner, n) + np.bincount(self.j, inner, n) + np.bincount(self.cold_node, cold, n) + load
        theta = np.empty(n + 2)
        theta[n], theta[n + 1] = 0.0, 1.0
        if n == 0:
            return theta
        if self.kind == "dense":
            matrix = np.zeros((n, n), order="F")
            matrix[self.j, self.i] = matrix[self.i, self.j] = -inner
            matrix[np.arange(n), np.arange(n)] = diagonal
            _, x, info = dposv(matrix, load, overwrite_a=1)
            _check(info)
            theta[:n] = x
        elif self.kind == "banded":
            rows = self.width + 1
            band = np.zeros(rows * n)
            band[self.position] = -inner
            band[self.rank.astype(np.int64) * rows] = diagonal
            right = np.empty(n)
            right[self.rank] = load
            _, x, info = dpbsv(band.reshape(rows, n, order="F"), right, lower=1, overwrite_ab=1, overwrite_b=1)
            _check(info)
            theta[:n] = x[self.rank]
        else:
            theta[:n] = self._eliminate(inner, diagonal, load)
        return theta


def _check(info: int) -> None:
    if info:
        raise SolverError(
            f"the heat network cannot be solved: Cholesky stopped at row {info}; "
            "a node is not connected to a terminal, or the conductances differ too much"
        )
