"""The exact optimum: a shortest path between corners, and for topologies where the cut is more than one path
a maximum flow.

On an overlap that the seam crosses from one gap to another (a strip, an L) a minimum cut between pixels is a
shortest path between corners, the planar dual (Ford and Fulkerson 1956), which Dijkstra's algorithm finds.
Rings, islands and overlaps with more than two gaps are solved by maximum flow with integer capacities.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, dijkstra, maximum_flow

from toposeam.heat.network import Ints, Network
from toposeam.images import Mask
from toposeam.seam.match_cost import Floats32
from toposeam.seam.overlap import FREE, NONE, TOUCHING, A, B
from toposeam.seam.problem import SeamProblem, geometry

_Box = tuple[slice, slice]
#: Each pixel and its right, or lower, neighbour.
_ACROSS, _ALONG = (np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])

#: Capacities of the maximum flow are rounded so that their sum stays below this.
_CAPACITY = 2**31 - 2


def exact_labels(
    problem: SeamProblem, most: float = np.inf, flow: Callable[[SeamProblem, Mask], Mask] | None = None
) -> Mask:
    """The labelling of least cost.

    Parameters
    ----------
    problem : SeamProblem
    most : float
        What some seam is known to cost: none dearer is looked for.
    flow : callable, optional
        Divides some free pixels where the cut is no path; by default SciPy's maximum flow does.

    Returns
    -------
    (h, w) bool array
    """
    side = problem.overlap.side
    labels = problem.complete(np.zeros(side.shape, bool)).astype(bool, copy=False)
    component, count = ndimage.label(side == FREE)
    for index, box in enumerate(ndimage.find_objects(component), 1):
        # The piece and one pixel around it, which always is there.
        box = tuple(slice(part.start - 1, part.stop + 1) for part in box)
        pixels = component[box] == index
        # Costs beside further layers belong to no interface, hence to no path.
        found = None if problem.tied else shortest_path(problem, box, pixels, most if count == 1 else np.inf)
        if found is None:
            whole = component == index
            labels[whole] = (flow or _maximum_flow)(problem, whole)[whole]
        else:
            labels[box][pixels] = found[pixels]
    return labels


def shortest_path(
    problem: SeamProblem, box: _Box, free: Mask, most: float = np.inf, zone: Mask | None = None
) -> Mask | None:
    """Labels of the free pixels of a box, cut by one shortest path between corners; None where the cut is not
    a single path.

    Parameters
    ----------
    problem : SeamProblem
    box : (slice, slice)
        Rows and columns of the window, one pixel more all round than what is free in it.
    free : (h, w) bool array
        On the box.
    most : float
        What some seam there is known to cost: none dearer is looked for.
    zone : (h, w) bool array, optional
        On the box: the seam runs beside these pixels only.

    Returns
    -------
    (h, w) bool array
        On the box; what is not free has any value.

    Notes
    -----
    Corner (y, x) of the box is the upper left one of its pixel (y, x). ``below[y, x]`` is the cost of going
    down from it, ``beside[y, x]`` of going right, 0 along gaps and infinite where no seam may run::

        pixel (y-1, x-1)       │         pixel (y-1, x)
                               │ below[y-1, x]
        ─── beside[y, x-1] ─── corner (y, x) ─── beside[y, x] ───
                               │ below[y, x]
        pixel (y, x-1)         │         pixel (y, x)
    """
    side = problem.overlap.side[box]
    h, w = side.shape
    rows, columns = box
    # Beyond the last row, and the last column, nothing leads anywhere.
    below, beside = (np.full((h + 1, w + 1), np.inf, np.float32) for _ in range(2))
    to_b: list[Mask] = []
    gaps: list[Mask] = []
    reaches_a, all_a = False, 0.0
    for cost, costs, (s, t) in (
        (problem.right[rows, columns.start : columns.stop - 1], below[:-1, 1:-1], _ACROSS),
        (problem.down[rows.start : rows.stop - 1, columns], beside[1:-1, :-1], _ALONG),
    ):
        within = (free[s] | free[t]) & (cost > 0)
        if zone is not None:
            within &= zone[s] | zone[t]
        np.copyto(costs, cost, where=within)
        # Of the interfaces with what is decided there are few.
        outer = np.flatnonzero(free[s] != free[t])
        one, other = (side[part].ravel()[outer] for part in (s, t))
        beyond = np.where(one == FREE, other, one)
        usable = cost.ravel()[outer] > 0
        reaches_a |= bool((usable & (beyond == A)).any())
        for found, chosen in ((to_b, usable & (beyond == B)), (gaps, beyond == NONE)):
            found.append(np.zeros(costs.shape, bool))
            found[-1].ravel()[outer[chosen]] = True
        all_a += float(cost.ravel()[outer[usable & (beyond == B)]].sum(dtype=np.float64))
        costs[gaps[-1]] = 0.0
    if not any(mask.any() for mask in to_b):
        return np.zeros(side.shape, bool)
    if not reaches_a:
        return np.ones(side.shape, bool)
    ends = _ends(to_b, gaps)
    if ends is None:
        return None
    path, length = _cheapest_path(below, beside, ends, min(most, all_a) * (1 + 1e-6))
    if path is None:
        return None
    for flip in (False, True):
        labels = _sides_of(path, side, free, flip)
        if labels is not None and cut_cost(problem, box, free, labels) <= length * (1 + 1e-6):
            return labels
    return None


def cut_cost(problem: SeamProblem, box: _Box, free: Mask, labels: Mask) -> float:
    """What a labelling of a box costs beside its free pixels."""
    rows, columns = box
    return sum(
        float(cost[(labels[s] != labels[t]) & (free[s] | free[t])].sum(dtype=np.float64))
        for cost, (s, t) in (
            (problem.right[rows, columns.start : columns.stop - 1], _ACROSS),
            (problem.down[rows.start : rows.stop - 1, columns], _ALONG),
        )
    )


def _ends(to_b: list[Mask], gaps: list[Mask]) -> tuple[int, int] | None:
    """The two corners between which the seam runs; None where it is no single path.

    All free pixels to ``a`` is one valid cut. Any other has the same ends: those it meets an odd number of
    times, corners along one gap counting as one.
    """
    on_cut, along_gap = geometry(*to_b)[2:], geometry(*gaps)[2:]
    corners, place = np.unique(np.concatenate([*on_cut, *along_gap]), return_inverse=True)
    start, end, gap_start, gap_end = np.split(place, np.cumsum([len(on_cut[0])] * 2 + [len(along_gap[0])]))
    joined = coo_array((np.ones(len(gap_start), np.int8), (gap_start, gap_end)), shape=(len(corners),) * 2)
    _, group = connected_components(joined, directed=False)
    odd = np.flatnonzero(np.bincount(group[np.concatenate([start, end])]) % 2)
    if len(odd) != 2:
        return None
    first, last = (int(corners[np.argmax(group == one)]) for one in odd)
    return first, last


def _cheapest_path(
    below: Floats32, beside: Floats32, ends: tuple[int, int], limit: float
) -> tuple[npt.NDArray[np.intp] | None, float]:
    """The corners of the cheapest path from one end to the other, flat indices, and its length; None where
    there is none.

    The graph is laid out by arithmetic: each corner that has an edge gets four, up, left, right and down,
    those that are missing to itself at infinite cost, which is beyond the limit.
    """
    stride = below.shape[1]
    edges = np.isfinite(below), np.isfinite(beside)
    corner = edges[0] | edges[1]
    corner[1:] |= edges[0][:-1]
    corner[:, 1:] |= edges[1][:, :-1]
    used = np.flatnonzero(corner)
    number = np.zeros(corner.size, np.int32)
    number[used] = np.arange(len(used), dtype=np.int32)
    neighbour, cost = np.empty((len(used), 4), np.int32), np.empty((len(used), 4))
    # Counted from the end, what is before the first corner is the last one, from which nothing leads on.
    for column, (step, costs, back) in enumerate(
        ((-stride, below, True), (-1, beside, True), (1, beside, False), (stride, below, False))
    ):
        there = used + step
        neighbour[:, column] = number.take(there, mode="wrap")
        cost[:, column] = costs.ravel().take(there if back else used, mode="wrap")
    graph = csr_array(
        (cost.ravel(), neighbour.ravel(), np.arange(0, 4 * len(used) + 1, 4, dtype=np.int32)),
        shape=(len(used), len(used)),
    )
    source, target = (int(number[end]) for end in ends)
    length, before = dijkstra(graph, indices=source, return_predecessors=True, limit=limit)
    path = [target]
    while path[-1] != source:
        if before[path[-1]] < 0:
            return None, np.inf
        path.append(int(before[path[-1]]))
    return used[path[::-1]], float(length[target])


def _sides_of(path: npt.NDArray[np.intp], side: npt.NDArray[np.uint8], free: Mask, flip: bool) -> Mask | None:
    """Which pixels show ``b``, once a path of corners divides them: those on its right, or on its left with
    `flip`; None when a piece of them lies on both.

    The free pixels beside the path are marked by its direction; what they leave are whole pieces
    (:func:`scipy.ndimage.label`), and each takes after its neighbours.
    """
    w = side.shape[1]
    y, x = np.divmod(path, w + 1)
    down, right = np.diff(y), np.diff(x)
    y, x = np.minimum(y[1:], y[:-1]), np.minimum(x[1:], x[:-1])
    # Somebody who walks right has the upper pixel on the left, somebody who walks down the right one.
    on_left = y * w + x - np.where(right == 1, w, 0) - (down == -1)
    on_right = y * w + x - np.where(right == -1, w, 0) - (down == 1)
    a_shows, b_shows = 1, 2
    known = np.where(side == A, a_shows, np.where(side == B, b_shows, 0)).astype(np.uint8)
    for beside, mark in ((on_left, b_shows if flip else a_shows), (on_right, a_shows if flip else b_shows)):
        inner = beside[free.ravel()[beside]]
        known.ravel()[inner] = mark
    piece, count = ndimage.label(free & (known == 0), TOUCHING)
    takes = np.zeros((3, count + 1), bool)
    for s, t in (_ACROSS, _ALONG):
        for here, there in ((s, t), (t, s)):
            border = (piece[here] > 0) & (known[there] > 0)
            takes[known[there][border], piece[here][border]] = True
    if (takes[a_shows] & takes[b_shows]).any():
        return None
    labels: Mask = np.where(piece > 0, takes[b_shows][piece], known == b_shows)
    return labels


def _maximum_flow(problem: SeamProblem, pixels: Mask) -> Mask:
    """Labels of some free pixels by maximum flow between the two sides; costs are rounded to about 1e-9 of
    their sum.
    """
    network, weight, index = problem.grid.network(pixels)
    # Next to forbidden interfaces rounding would lose the others: as much as all of them together is
    # forbidding enough.
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
