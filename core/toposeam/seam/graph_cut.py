"""Graph cut with PyMaxflow (Boykov and Kolmogorov 2004), the method of Kwatra et al.; an optional extra because it is GPL."""

from __future__ import annotations

import numpy as np

from toposeam.errors import MissingPackageError
from toposeam.images import Mask
from toposeam.seam.exact import labels_of_nodes
from toposeam.seam.problem import SeamProblem


def graph_cut_labels(problem: SeamProblem) -> Mask:
    """The labelling of least cost, (h, w) bool.

    Raises
    ------
    MissingPackageError
        When PyMaxflow is not installed.
    """
    try:
        import maxflow
    except ImportError as error:
        raise MissingPackageError("method graph-cut needs PyMaxflow (GPL); install it with: pip install 'toposeam[graphcut]'") from error
    grid = problem.grid
    network, weight, index = grid.network(grid.free)
    n = network.n
    if n == 0:
        return np.zeros(grid.free.shape, bool)
    graph = maxflow.GraphFloat(n, len(weight))
    graph.add_nodes(n)
    inner = network.head < n
    graph.add_edges(network.tail[inner], network.head[inner], weight[inner], weight[inner])
    ends = [np.bincount(network.tail[network.head == terminal], weight[network.head == terminal], n) for terminal in (n, n + 1)]
    graph.add_grid_tedges(np.arange(n), ends[0], ends[1])
    graph.maxflow()
    return labels_of_nodes(graph.get_grid_segments(np.arange(n)), index, grid.free.shape)
