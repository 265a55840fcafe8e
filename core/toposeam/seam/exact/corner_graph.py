"""Cheapest paths between the corners of pixels, on two arrays of costs, by a kernel or SciPy's search.

``below[y, x]`` is the cost of going down from corner (y, x), ``beside[y, x]`` of going right; an infinite
cost means that there is no edge. No edge leads beyond the last row or the last column.

*Large windows.* The path is first searched among every other corner, recursively until few corners are left,
and then among all corners near that coarse path. A coarse path stands for all paths within one corner of it.
The cheapest of these takes the least of three edges in each row, the straight one always the middle edge; a
coarse edge costs a mean of both::

    M'(X, Y) = Σ over y = 2Y, 2Y + 1:  w min(M(2X - 1, y), M(2X, y), M(2X + 1, y)) + (1 - w) M(2X, y)

with M(x, y) the cost of going down from corner (x, y); likewise across.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from toposeam import _kernels
from toposeam.arrays import Bytes, Floats32, Mask

#: Corners whose edges are laid out at a time, to bound the memory.
_BLOCK_CORNERS = 1 << 16
#: The weight w above, of paths that wander.
_WANDERING = 0.6
#: Largest distance of the path from the coarse path, in corners.
_BAND_CORNERS = 16
#: Largest distance of an end of the coarse path from that of the path, in coarse corners.
_END_CORNERS = 8
#: Corners that the kernel counts in 32 bits, with three times that each is reached.
_MOST_BY_KERNEL = 2**31 // 4
_NO_WAY = np.float32(np.inf)


def cheapest_path(
    below: Floats32, beside: Floats32, ends: tuple[int, int], limit: float = np.inf, whole: float = np.inf
) -> tuple[npt.NDArray[np.intp] | None, float]:
    """Search the cheapest path between two corners.

    Parameters
    ----------
    below, beside : (h, w) float32 arrays
    ends : (int, int)
        Flat indices.
    limit : float
        Longer paths are not searched.
    whole : float
        Largest number of corners that are searched at once. Among more, every other one is searched first;
        the path then need not be the cheapest.

    Returns
    -------
    path : (n,) int array, or None
        Flat indices; None where there is no path within the limit.
    length : float
    """
    if below.size > whole:
        near = _beside_coarse_path(below, beside, ends, whole)
        if near is not None:
            narrowed = np.where(near, below, _NO_WAY), np.where(near, beside, _NO_WAY)
            path, length = _searched(*narrowed, ends, limit)
            if path is not None:
                return path, length
    return _searched(below, beside, ends, limit)


def _searched(
    below: Floats32, beside: Floats32, ends: tuple[int, int], limit: float
) -> tuple[npt.NDArray[np.intp] | None, float]:
    """Search the cheapest path among all corners; returns as :func:`cheapest_path` does.

    The kernel finds a path of the same length, but where there are several perhaps another one.
    """
    if _kernels.library is not None and below.size < _MOST_BY_KERNEL:
        back, length = np.empty(below.size, np.uint8), np.empty(1)
        found = _kernels.library.cheapest_way(
            *below.shape, *map(np.ascontiguousarray, (below, beside)), *ends, limit, back, length
        )
        if found >= 0:
            return (_traced(back, ends, below.shape[1]), float(length[0])) if found else (None, np.inf)
    graph = CornerGraph.of(below, beside, ends)
    return (None, np.inf) if graph is None else graph.cheapest_path(limit)


def _traced(back: Bytes, ends: tuple[int, int], stride: int) -> npt.NDArray[np.intp]:
    """Follow the ways back, up, left, right or down, from the second of the ends to the first."""
    steps, path = (-stride, -1, 1, stride), [ends[1]]
    while path[-1] != ends[0]:
        path.append(path[-1] + steps[back[path[-1]]])
    return np.array(path[::-1], np.intp)


def _beside_coarse_path(
    below: Floats32, beside: Floats32, ends: tuple[int, int], whole: float
) -> Mask | None:
    """Mark the corners near the cheapest coarse path, (h, w) bool; None where there is no such path."""
    stride = below.shape[1]
    coarse = _halved(below), np.ascontiguousarray(_halved(beside.T).T)
    start, end = (_nearest(*coarse, divmod(end, stride)) for end in ends)
    if start is None or end is None:
        return None
    path, _ = cheapest_path(*coarse, (start, end), whole=whole)
    if path is None:
        return None
    near = np.zeros(below.shape, bool)
    corners = [2 * value for value in np.divmod(path, coarse[0].shape[1])]
    for y, x in [*zip(*corners, strict=True), *(divmod(end, stride) for end in ends)]:
        near[
            max(y - _BAND_CORNERS, 0) : y + _BAND_CORNERS + 1,
            max(x - _BAND_CORNERS, 0) : x + _BAND_CORNERS + 1,
        ] = True
    return near


def _halved(below: Floats32) -> Floats32:
    """Compute M', the costs of going down between every other corner."""
    h, w = below.shape
    even = np.full((h + h % 2, w // 2 + w % 2), np.inf, np.float32)
    odd = even.copy()
    even[:h], odd[:h, : w // 2] = below[:, ::2], below[:, 1::2]
    least = np.minimum(even, odd)
    np.minimum(least[:, 1:], odd[:, :-1], out=least[:, 1:])
    closed = np.isinf(even)
    even[closed] = least[closed]
    missing = np.isinf(even)
    even *= np.float32(1 - _WANDERING)
    least *= np.float32(_WANDERING)
    even += least
    # On the border of the overlap, where paths may begin, one of two edges may be missing; it costs nothing.
    even[missing] = 0
    result = even[::2] + even[1::2]
    result[missing[::2] & missing[1::2]] = np.inf
    return result


def _nearest(below: Floats32, beside: Floats32, corner: tuple[int, int]) -> int | None:
    """Find the coarse corner that is nearest to a given one and has an edge.

    Returns its flat index among the coarse corners; None where there is none close by.
    """
    top, left = (max(value // 2 - _END_CORNERS, 0) for value in corner)
    box = np.s_[top : top + 2 * _END_CORNERS, left : left + 2 * _END_CORNERS]
    y, x = np.nonzero(np.isfinite(below[box]) | np.isfinite(beside[box]))
    if not len(y):
        return None
    y, x = y + top, x + left
    nearest = np.argmin((2 * y - corner[0]) ** 2 + (2 * x - corner[1]) ** 2)
    return int(y[nearest] * below.shape[1] + x[nearest])


class CornerGraph(NamedTuple):
    """Corners joined by edges, and the two ends of a path."""

    #: (n, n), the cost of each edge, and (n,) the flat index of each corner.
    edges: csr_array
    corner: npt.NDArray[np.intp]
    source: int
    target: int
    #: Rows and columns of corners.
    shape: tuple[int, int]

    @classmethod
    def of(cls, below: Floats32, beside: Floats32, ends: tuple[int, int]) -> CornerGraph | None:
        """Build the graph between two ends; None where no edge leaves one of them.

        Each corner that has an edge gets four of them, up, left, right and down, so that the table of edges
        is laid out by arithmetic; a missing edge has infinite cost, which is beyond any limit.
        """
        stride = below.shape[1]
        edges = np.isfinite(below), np.isfinite(beside)
        corner = edges[0] | edges[1]
        corner[1:] |= edges[0][:-1]
        corner[:, 1:] |= edges[1][:, :-1]
        del edges
        if not all(corner.ravel()[end] for end in ends):
            return None
        used = np.flatnonzero(corner)
        number = np.zeros(corner.size, np.int32)
        number[used] = np.arange(len(used), dtype=np.int32)
        source, target = (int(number[end]) for end in ends)
        neighbour, cost = np.empty((len(used), 4), np.int32), np.empty((len(used), 4))
        # Indices wrap round: before the first corner comes the last one, from which no edge leads on.
        ways = ((-stride, below, True), (-1, beside, True), (1, beside, False), (stride, below, False))
        for start in range(0, len(used), _BLOCK_CORNERS):
            part = slice(start, start + _BLOCK_CORNERS)
            for column, (step, costs, back) in enumerate(ways):
                there = used[part] + step
                neighbour[part, column] = number.take(there, mode="wrap")
                cost[part, column] = costs.ravel().take(there if back else used[part], mode="wrap")
        table = csr_array(
            (cost.ravel(), neighbour.ravel(), np.arange(0, 4 * len(used) + 1, 4, dtype=np.int32)),
            shape=(len(used), len(used)),
        )
        return cls(table, used, source, target, below.shape)

    def cheapest_path(self, limit: float = np.inf) -> tuple[npt.NDArray[np.intp] | None, float]:
        """Search the cheapest path from one end to the other.

        Returns the flat indices of its corners and its length; None and infinity where there is no path
        within the limit.
        """
        length, before = dijkstra(self.edges, indices=self.source, return_predecessors=True, limit=limit)
        path = [self.target]
        while path[-1] != self.source:
            if before[path[-1]] < 0:
                return None, np.inf
            path.append(int(before[path[-1]]))
        return self.corner[path[::-1]], float(length[self.target])
