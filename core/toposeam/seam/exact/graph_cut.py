"""Graph cut with PyMaxflow (Boykov and Kolmogorov 2004), the method of Kwatra et al.; an optional extra
because it is GPL.
"""

from __future__ import annotations

import numpy as np

from toposeam.arrays import Floats, Mask
from toposeam.errors import MissingPackageError
from toposeam.heat.network import Network
from toposeam.seam.exact.optimum import labels_of_nodes
from toposeam.seam.problem.seam_problem import SeamProblem


def graph_cut_labels(problem: SeamProblem) -> Mask:
    """Find the labelling of least cost, (h, w) bool.

    Raises
    ------
    MissingPackageError
        When PyMaxflow is not installed.
    """
    grid = problem.grid
    network, weight, index = grid.network(grid.free)
    return labels_of_nodes(least_cut(network, weight), index, grid.free.shape)


def least_cut(network: Network, weight: Floats) -> Mask:
    """Find the nodes on the hot side of the cheapest cut, (n,) bool.

    Parameters
    ----------
    network : Network
    weight : (E,) float64 array
        Cost of dividing the two nodes of each element.

    Raises
    ------
    MissingPackageError
        When PyMaxflow is not installed.
    """
    try:
        import maxflow
    except ImportError as error:
        raise MissingPackageError(
            "method graph-cut needs PyMaxflow (GPL); install it with: pip install PyMaxflow",
            kind="no PyMaxflow",
        ) from error
    n = network.n
    if n == 0:
        return np.zeros(0, bool)
    graph = maxflow.GraphFloat(n, len(weight))
    graph.add_nodes(n)
    inner = network.head < n
    graph.add_edges(network.tail[inner], network.head[inner], weight[inner], weight[inner])
    ends = [
        np.bincount(network.tail[network.head == terminal], weight[network.head == terminal], n)
        for terminal in (n, n + 1)
    ]
    graph.add_grid_tedges(np.arange(n), ends[0], ends[1])
    graph.maxflow()
    hot: Mask = graph.get_grid_segments(np.arange(n))
    return hot
