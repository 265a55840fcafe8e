"""Minimum cuts between the two terminals of a network, by maximum flow.

The kernel computes the flow where it was built (Boykov and Kolmogorov 2004, doi:10.1109/TPAMI.2004.60),
SciPy elsewhere (Dinic 1970), and the cut is the same to the bit: capacities are whole numbers, and the nodes
that the hot terminal still reaches in the residual network of any maximum flow are the smallest hot side of
all minimum cuts (Ford and Fulkerson 1962).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from toposeam import _kernels
from toposeam.arrays import Floats, Ints32, Mask
from toposeam.heat.network import Network

#: Bound of the sum of all rounded capacities, both ways: SciPy's flows are 32-bit integers.
_LARGEST_SUM = 2**31 - 2
#: Bound of the median rounded capacity: a millionth of it is fine enough.
_LARGEST_MEDIAN = 1e6


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
    if _kernels.library is None:
        return by_scipy(n, tail, head, capacity)
    hot = np.empty(n, bool)
    if _kernels.library.smallest_hot_side(n, len(capacity), tail, head, capacity, hot):
        raise MemoryError
    return hot


def by_scipy(n: int, tail: Ints32, head: Ints32, capacity: Ints32) -> Mask:
    """Find the smallest hot side of `n` free nodes by SciPy.

    Parameters
    ----------
    n : int
    tail, head, capacity : (E,) int32 arrays
        The elements, which carry up to their capacity either way.

    Returns
    -------
    (n,) bool array
    """
    one_way, other_way = np.concatenate([tail, head]), np.concatenate([head, tail])
    graph = csr_array((np.concatenate([capacity, capacity]), (one_way, other_way)), shape=(n + 2, n + 2))
    flow = maximum_flow(graph, n + 1, n).flow
    graph.data -= flow.data  # both hold every element in both directions, in the same order
    graph.eliminate_zeros()
    hot = np.zeros(n + 2, bool)
    hot[breadth_first_order(graph, n + 1, return_predecessors=False)] = True
    return hot[:n]
