"""Minimum cuts between the two terminals of a network, by maximum flow.

OR-tools computes the flow where it is installed and there is much to cut (push and relabel, Goldberg and
Tarjan 1988, doi:10.1145/48014.61051), SciPy elsewhere (Dinic 1970), and the cut is the same to the bit:
capacities are whole numbers, and the nodes that the hot terminal still reaches in the residual network of any
maximum flow are the smallest hot side of all minimum cuts (Ford and Fulkerson 1962).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from toposeam.arrays import Floats, Ints32, Mask
from toposeam.heat.network import Network

#: A solver of maximum flows from the hot to the cold terminal: from the number of free nodes, and the tails,
#: heads and capacities of all elements in both directions, (2 E,) each, to the nodes that the hot terminal
#: still reaches in the residual network.
Engine = Callable[[int, Ints32, Ints32, Ints32], Ints32]

#: Bound of the sum of all rounded capacities: SciPy's flows are 32-bit integers.
_LARGEST_SUM = 2**31 - 2
#: Bound of the median rounded capacity: a millionth of it is fine enough.
_LARGEST_MEDIAN = 1e6
#: Nodes that a process must have cut, in all, before OR-tools saves more time than loading it takes.
LOADED = 70_000


def minimum_cut(network: Network, weight: Floats) -> Mask:
    """Find the free nodes on the hot side of a minimum cut: the smallest such side.

    Parameters
    ----------
    network : Network
    weight : (E,) float64 array
        Cost of dividing the two nodes of each element, not negative, not all 0. They are rounded to about
        1e-9 of their sum.

    Returns
    -------
    (n,) bool array
    """
    n = network.n
    scale = _LARGEST_SUM / 4 / weight.sum()
    if len(weight) < _LARGEST_SUM / 2 / _LARGEST_MEDIAN:  # else the median, at most twice the mean, is small
        middle = np.median(weight)
        scale = min(scale, _LARGEST_MEDIAN / middle) if middle > 0 else scale
    capacity = np.rint(weight * scale).astype(np.int32)
    tail, head = network.tail.astype(np.int32), network.head.astype(np.int32)
    one_way, other_way = np.concatenate([tail, head]), np.concatenate([head, tail])
    reached = _engine_for(n)(n, one_way, other_way, np.concatenate([capacity, capacity]))
    hot = np.zeros(n + 2, bool)
    hot[reached] = True
    return hot[:n]


def by_scipy(n: int, tail: Ints32, head: Ints32, capacity: Ints32) -> Ints32:
    """Solve by SciPy, which is always installed: an :data:`Engine`."""
    graph = csr_array((capacity, (tail, head)), shape=(n + 2, n + 2))
    flow = maximum_flow(graph, n + 1, n).flow
    graph.data -= flow.data  # both hold every element in both directions, in the same order
    graph.eliminate_zeros()
    reached: Ints32 = breadth_first_order(graph, n + 1, return_predecessors=False)
    return reached


class _Work:
    """The work of this process so far."""

    #: Free nodes of all networks that it has cut.
    nodes = 0


def _engine_for(n: int) -> Engine:
    """Choose the engine for the next `n` nodes.

    OR-tools is loaded once the work so far would have paid for it, so that a process with little work never
    loads it, and any other loses at most the time that loading takes.
    """
    _Work.nodes += n
    return (or_tools() if _Work.nodes > LOADED else None) or by_scipy


@cache
def or_tools() -> Engine | None:
    """Load OR-tools' :data:`Engine`; None where it is not installed, or fails on a network of one node."""
    try:
        from ortools.graph.python.max_flow import SimpleMaxFlow

        def by_or_tools(n: int, tail: Ints32, head: Ints32, capacity: Ints32) -> Ints32:
            graph: Any = SimpleMaxFlow()
            graph.add_arcs_with_capacity(tail, head, capacity.astype(np.int64))
            graph.solve(n + 1, n)
            return np.array(graph.get_source_side_min_cut(), np.int32)

        small = np.array([[0, 0, 1, 2], [1, 2, 0, 0], [1, 2, 1, 2]], np.int32)
        works = sorted(by_or_tools(1, *small)) == [0, 2]
    except Exception:  # another version's interface, or a library that does not load
        return None
    return by_or_tools if works else None
