"""Cheapest paths between the corners of pixels: two arrays of costs, one of SciPy's searches.

``below[y, x]`` is the cost of going down from corner (y, x), ``beside[y, x]`` of going right; infinite is no
way. Beyond the last row, and the last column, nothing leads anywhere.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from toposeam.seam.problem.match_cost import Floats32

#: Edges are laid out for so many corners at a time.
_BLOCK = 1 << 16


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
        """The graph of some costs between two ends; None where nothing leads from one of them.

        It is laid out by arithmetic: each corner that has an edge gets four, up, left, right and down, those
        that are missing to itself at infinite cost, which is beyond any limit.
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
        # Counted from the end, what is before the first corner is the last one, from which nothing leads on.
        ways = ((-stride, below, True), (-1, beside, True), (1, beside, False), (stride, below, False))
        for start in range(0, len(used), _BLOCK):
            part = slice(start, start + _BLOCK)
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
        """The corners of the cheapest path from one end to the other, flat indices, and its length; None
        where there is none within the limit.
        """
        length, before = dijkstra(self.edges, indices=self.source, return_predecessors=True, limit=limit)
        path = [self.target]
        while path[-1] != self.source:
            if before[path[-1]] < 0:
                return None, np.inf
            path.append(int(before[path[-1]]))
        return self.corner[path[::-1]], float(length[self.target])
