"""Minimum cuts between the two terminals of a network, by maximum flow.

OR-tools computes the flow where it is installed and there is much to cut (push and relabel, Goldberg and
Tarjan 1988, doi:10.1145/48014.61051), SciPy elsewhere (Dinic 1970), and the cut is the same to the bit:
capacities are whole numbers, and what the hot terminal still reaches beside a maximum flow, whichever of
several it is, is the one smallest hot side of all minimum cuts (Ford and Fulkerson 1962).
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

#: From the number of free nodes, and tails, heads and capacities of all elements in both directions, (2 E,)
#: each, to the nodes that the hot terminal still reaches beside a maximum flow from there to the cold one.
Engine = Callable[[int, Ints32, Ints32, Ints32], Ints32]

#: Capacities are rounded so that their sum stays below this.
_CAPACITY = 2**31 - 2
#: … and the median one is at most this.
_FINEST = 1e6
#: On networks of so many nodes in all OR-tools saves the time that loading it takes.
LOADED = 70_000


def minimum_cut(network: Network, weight: Floats) -> Mask:
    """Which free nodes end on the hot side of a minimum cut, of all those the one with the fewest.

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
    scale = _CAPACITY / 4 / weight.sum()
    if len(weight) < _CAPACITY / 2 / _FINEST:  # else the median, at most twice the mean, bounds nothing
        middle = np.median(weight)
        scale = min(scale, _FINEST / middle) if middle > 0 else scale
    capacity = np.rint(weight * scale).astype(np.int32)
    tail, head = network.tail.astype(np.int32), network.head.astype(np.int32)
    one_way, other_way = np.concatenate([tail, head]), np.concatenate([head, tail])
    reached = _engine_for(n)(n, one_way, other_way, np.concatenate([capacity, capacity]))
    hot = np.zeros(n + 2, bool)
    hot[reached] = True
    return hot[:n]


def by_scipy(n: int, tail: Ints32, head: Ints32, capacity: Ints32) -> Ints32:
    """An :data:`Engine` that is always there."""
    graph = csr_array((capacity, (tail, head)), shape=(n + 2, n + 2))
    flow = maximum_flow(graph, n + 1, n).flow
    graph.data -= flow.data  # both have every element in both directions, in one order
    graph.eliminate_zeros()
    reached: Ints32 = breadth_first_order(graph, n + 1, return_predecessors=False)
    return reached


class _Work:
    """What this process has had to cut."""

    nodes = 0


def _engine_for(n: int) -> Engine:
    """The engine for the next `n` nodes. OR-tools' is loaded once that would have been worth it: where there
    is little to cut nothing is lost, and elsewhere never more than loading takes.
    """
    _Work.nodes += n
    return (or_tools() if _Work.nodes > LOADED else None) or by_scipy


@cache
def or_tools() -> Engine | None:
    """OR-tools' :data:`Engine`; None where it is not installed, or cannot divide a network of one node."""
    try:
        from ortools.graph.python.max_flow import SimpleMaxFlow

        def by_or_tools(n: int, tail: Ints32, head: Ints32, capacity: Ints32) -> Ints32:
            graph: Any = SimpleMaxFlow()
            graph.add_arcs_with_capacity(tail, head, capacity.astype(np.int64))
            graph.solve(n + 1, n)
            return np.array(graph.get_source_side_min_cut(), np.int32)

        small = np.array([[0, 0, 1, 2], [1, 2, 0, 0], [1, 2, 1, 2]], np.int32)
        works = sorted(by_or_tools(1, *small)) == [0, 2]
    except Exception:  # another version's ways, or a library that does not load
        return None
    return by_or_tools if works else None
