"""The exact optimum: a shortest path between corners, and for topologies where the cut is more than one path a maximum flow.

On an overlap that the seam crosses from one gap to another (a strip, an L) a minimum cut between pixels is a shortest path between corners,
the planar dual (Ford and Fulkerson 1956), which Dijkstra's algorithm finds. Rings, islands and overlaps with more than two gaps are solved
by maximum flow with integer capacities.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, dijkstra, maximum_flow

from toposeam.heat.network import Ints, Network
from toposeam.images import Mask
from toposeam.seam.overlap import FREE, NONE, A, B
from toposeam.seam.problem import Interfaces, SeamProblem, geometry

#: Capacities of the maximum flow are rounded so that their sum stays below this.
_CAPACITY = 2**31 - 2


def exact_labels(problem: SeamProblem) -> Mask:
    """The labelling of least cost.

    Returns
    -------
    (h, w) bool array
    """
    side = problem.overlap.side
    component, count = ndimage.label(side == FREE)
    labels = problem.complete(np.zeros(side.shape, bool)).astype(bool)
    faces = problem.interfaces
    gap_corners = _corners_beside_gaps(side, component)
    owner = np.maximum(component.ravel()[faces.first], component.ravel()[faces.second])
    for index in range(1, count + 1):
        mine = owner == index if count > 1 else np.ones(len(owner), bool)
        part = Interfaces(faces.first[mine], faces.second[mine], faces.start[mine], faces.end[mine], faces.cost[mine])
        pixels = component == index
        # Costs beside further layers belong to no interface, hence to no path.
        found = _shortest_path(part, side, gap_corners.get(index), pixels) if not problem.tied else None
        labels[pixels] = (_maximum_flow(problem, pixels) if found is None else found)[pixels]
    return labels


_Pairs = tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]


def _corners_beside_gaps(side: npt.NDArray[np.uint8], component: npt.NDArray[np.int32]) -> dict[int, _Pairs]:
    """Per component, the pairs of corners that a gap joins at no cost: the edges between a free pixel and one that nobody covers."""
    free, nothing = side == FREE, side == NONE
    right, down = ((free[s] & nothing[t]) | (nothing[s] & free[t]) for s, t in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])))
    first, second, start, end = geometry(right, down)
    owner = np.maximum(component.ravel()[first], component.ravel()[second])
    return {int(index): (start[owner == index], end[owner == index]) for index in np.unique(owner)}


def _shortest_path(faces: Interfaces, side: npt.NDArray[np.uint8], gaps: _Pairs | None, pixels: Mask) -> Mask | None:
    """Labels cut by one shortest path between corners, or None where the cut is not a single path."""
    gap_start, gap_end = gaps if gaps is not None else (np.zeros(0, np.intp), np.zeros(0, np.intp))
    corners, place = np.unique(np.concatenate([faces.start, faces.end, gap_start, gap_end]), return_inverse=True)
    n, e = len(corners), len(faces.cost)
    u, v, gap_u, gap_v = np.split(place, [e, 2 * e, 2 * e + len(gap_start)])
    # Corners along one gap are one node.
    count, node = connected_components(coo_array((np.ones(len(gap_u), np.int8), (gap_u, gap_v)), shape=(n, n)), directed=False)
    u, v = node[u], node[v]
    # All free pixels to a is one valid cut; any other has the same ends, the nodes it meets an odd number of times.
    flat = side.ravel()
    to_b = (flat[faces.first] == B) | (flat[faces.second] == B)
    odd = np.flatnonzero(np.bincount(np.concatenate([u[to_b], v[to_b]]), minlength=count) % 2)
    if not to_b.any():
        return np.zeros(side.shape, bool)
    if not ((flat[faces.first] == A) | (flat[faces.second] == A)).any():
        return np.ones(side.shape, bool)
    if len(odd) != 2:
        return None
    # Parallel elements between merged corners: keep the cheaper one.
    low, high = np.minimum(u, v), np.maximum(u, v)
    order = np.lexsort((faces.cost, high, low))
    keep = order[np.r_[True, (low[order][1:] != low[order][:-1]) | (high[order][1:] != high[order][:-1])]]
    keep = keep[low[keep] != high[keep]]
    graph = csr_array((faces.cost[keep], (low[keep], high[keep])), shape=(count, count))
    _, before = dijkstra(graph, directed=False, indices=odd[0], return_predecessors=True)
    on_path = [int(odd[1])]
    while on_path[-1] != odd[0]:
        if before[on_path[-1]] < 0:
            return None
        on_path.append(int(before[on_path[-1]]))
    ends = np.sort(np.stack([on_path[1:], on_path[:-1]]), axis=0)
    index_of = np.searchsorted(low[keep].astype(np.int64) * count + high[keep], ends[0].astype(np.int64) * count + ends[1])
    cut = np.zeros(e, bool)
    cut[keep[index_of]] = True
    return _flood(faces, cut, side, pixels)


def _flood(faces: Interfaces, cut: Mask, side: npt.NDArray[np.uint8], pixels: Mask) -> Mask | None:
    """Labels of the pixels once the cut interfaces are opened; None when the cut does not separate the two sides."""
    size = side.size
    flat = side.ravel()
    first, second = faces.first[~cut], faces.second[~cut]
    # The fixed pixels of each side count as one node.
    first, second = (np.where(flat[p] == A, size, np.where(flat[p] == B, size + 1, p)) for p in (first, second))
    graph = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(size + 2, size + 2))
    _, region = connected_components(graph, directed=False)
    if region[size] == region[size + 1]:
        return None
    labels: Mask = (region[:size] == region[size + 1]).reshape(side.shape)
    undecided = pixels & ~labels & (region[:size] != region[size]).reshape(side.shape)
    return None if undecided.any() else labels


def _maximum_flow(problem: SeamProblem, pixels: Mask) -> Mask:
    """Labels of some free pixels by maximum flow between the two sides; costs are rounded to about 1e-9 of their sum."""
    network, weight, index = problem.grid.network(pixels)
    # Next to forbidden interfaces rounding would lose the others: as much as all of them together is forbidding enough.
    ordinary = float(weight[weight < problem.forbidden].sum())
    limit = 1.01 * ordinary if ordinary > 0 else weight.max()
    return labels_of_nodes(minimum_cut(network, np.minimum(weight, limit)), index, pixels.shape)


def minimum_cut(network: Network, weight: npt.NDArray[np.float64]) -> Mask:
    """Which free nodes end on the hot side of a minimum cut, (n,) bool."""
    n = network.n
    capacity = np.rint(weight * min(_CAPACITY / 4 / weight.sum(), 1e6 / np.median(weight))).astype(np.int32)
    rows, columns = np.concatenate([network.tail, network.head]), np.concatenate([network.head, network.tail])
    graph = csr_array((np.concatenate([capacity, capacity]), (rows, columns)), shape=(n + 2, n + 2))
    flow = maximum_flow(graph, n + 1, n).flow
    residual = graph - flow
    residual.data[residual.data < 0] = 0
    residual.eliminate_zeros()
    reached = breadth_first_order(residual, n + 1, return_predecessors=False)
    hot = np.zeros(n + 2, bool)
    hot[reached] = True
    return hot[:n]


def labels_of_nodes(hot: Mask, index: Ints, shape: tuple[int, int]) -> Mask:
    """The (h, w) labelling in which the pixels of the hot nodes are True."""
    labels = np.zeros(shape, bool)
    labels.ravel()[index] = hot
    return labels
