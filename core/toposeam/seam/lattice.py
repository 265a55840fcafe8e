"""Where cheap paths between two corners run, as a lattice of every eighth corner shows.

Its corners lie as the black fields of a chessboard of 2 × 2 corners do. Each is joined to the four that are
two rows and two columns off, and to the four that are four rows or four columns off, at what the cheapest way
among the corners between them costs. Paths on it are about a tenth dearer than the best ones, but they are so
everywhere: of ways that lead far from each other the best seam takes one that is among the cheapest here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from toposeam.heat.network import Floats
from toposeam.images import Mask
from toposeam.seam.grid import CELL
from toposeam.seam.match_cost import Floats32

#: Corners from one of a half of the lattice to the next in its row, or column.
PITCH = 4


@dataclass(frozen=True, slots=True)
class Half:
    """One half of the lattice: the corners (y + 4 a, x + 4 b), as many of them as the shape says.

    ``below`` and ``beside`` are as in :mod:`toposeam.seam.corner_graph`.
    """

    below: Floats32
    beside: Floats32
    y: int
    x: int
    shape: tuple[int, int]

    def _at(self, costs: Floats32, y: int, x: int) -> Floats32:
        """What a step costs that starts so many rows and columns from each corner; infinite off the grid."""
        y, x = y + self.y, x + self.x
        off = int(y < 0), int(x < 0)
        part = costs[y + PITCH * off[0] :: PITCH, x + PITCH * off[1] :: PITCH]
        part = part[: self.shape[0] - off[0], : self.shape[1] - off[1]]
        if part.shape == self.shape:
            return part
        found = np.full(self.shape, np.inf, np.float32)
        found[off[0] : off[0] + part.shape[0], off[1] : off[1] + part.shape[1]] = part
        return found

    def downwards(self, rows: int, columns: int, wide: int = 0) -> Floats32:
        """What the cheapest way costs that leads so many rows down and columns right, never up, and at most
        `wide` columns further than it must.
        """
        return _cheapest(
            rows,
            columns,
            wide,
            lambda y, x: self._at(self.below, y, x),
            lambda y, x: self._at(self.beside, y, x),
        )

    def right(self, columns: int, wide: int) -> Floats32:
        """What the cheapest way costs that leads so many columns right, never left, and at most `wide` rows
        up or down.
        """
        return _cheapest(
            columns,
            0,
            wide,
            lambda x, y: self._at(self.beside, y, x),
            lambda x, y: self._at(self.below, y, x),
        )


def _cheapest(
    ahead: int,
    across: int,
    wide: int,
    step: Callable[[int, int], Floats32],
    rung: Callable[[int, int], Floats32],
) -> Floats32:
    """The cheapest way that many steps ahead and across; `step` and `rung` are what those ahead and across
    cost that start at a place.
    """
    least, most = min(across, 0) - wide, max(across, 0) + wide
    reached: dict[int, Floats32] = {0: np.zeros_like(step(0, 0))}
    for line in range(ahead + 1):
        for there, here in [(place, place - 1) for place in range(least + 1, most + 1)] + [
            (place, place + 1) for place in range(most - 1, least - 1, -1)
        ]:
            if here in reached:
                cost = reached[here] + rung(line, min(here, there))
                reached[there] = np.minimum(reached[there], cost) if there in reached else cost
        if line < ahead:
            reached = {place: cost + step(line, place) for place, cost in reached.items()}
    return reached[across]


def beside_cheap_paths(
    below: Floats32, beside: Floats32, ends: tuple[int, int], free: Mask, cells: int
) -> Mask:
    """Free pixels that the cheapest paths of the lattice pass, and their neighbourhood; none where it does
    not join the ends.

    Parameters
    ----------
    below, beside : (h + 1, w + 1) float32 arrays
    ends : (int, int)
        Two corners, flat indices.
    free : (h, w) bool array
    cells : int
        How many cells of 8 px are open for each that the cheapest path crosses.

    Returns
    -------
    (h, w) bool array
        Whole cells, as many in all as a corridor that wide along the cheapest path would have.
    """
    at = [divmod(end, below.shape[1]) for end in ends]
    first = at[0][0] % 2, at[0][1] % 2
    rows, columns = (-(-(size - begin) // PITCH) for size, begin in zip(below.shape, first, strict=True))
    half = rows * columns
    graph = _graph(below, beside, first, (rows, columns))
    found = [_node(graph, y - first[0], x - first[1], (rows, columns)) for y, x in at]
    nothing = np.zeros(free.shape, bool)
    if None in found:
        return nothing
    length: Floats = sum(dijkstra(graph, indices=node) for node in found)
    del graph
    best = float(length[found[0]])
    if not np.isfinite(best):
        return nothing
    squares = np.full((2 * -(-rows // 2), 2 * -(-columns // 2)), np.inf)
    squares[:rows, :columns] = np.minimum(length[:half], length[half:]).reshape(rows, columns)
    each = squares.reshape(len(squares) // 2, 2, -1, 2).min(axis=(1, 3))
    count = cells * int(np.count_nonzero(each <= (1 + 1e-9) * best))
    near = scipy.ndimage.minimum_filter(each, 3)
    limit = np.partition(near, count, axis=None)[count] if count < near.size else np.inf
    wide = (np.isfinite(near) & (near <= limit)).repeat(CELL, axis=0).repeat(CELL, axis=1)
    nothing[: wide.shape[0], : wide.shape[1]] = wide[: free.shape[0], : free.shape[1]]
    return nothing & free


def _node(graph: csr_array, y: int, x: int, shape: tuple[int, int]) -> int | None:
    """The node of the lattice at a corner, or next to it; None where none is joined to others."""
    y, x = y // 2 * 2, x // 2 * 2
    best, found = np.inf, None
    for dy, dx in ((0, 0), (0, 2), (0, -2), (2, 0), (-2, 0)):
        row, column = y + dy, x + dx
        odd = row % PITCH == 2
        if row % PITCH != column % PITCH or min(row, column) < 0:
            continue
        row, column = row // PITCH, column // PITCH
        if row < shape[0] and column < shape[1]:
            node = (int(odd) * shape[0] + row) * shape[1] + column
            cost = float(graph.data[8 * node : 8 * node + 8].min())
            if cost < best:
                best, found = cost, node
    return found


def _graph(below: Floats32, beside: Floats32, first: tuple[int, int], shape: tuple[int, int]) -> csr_array:
    """The lattice, the corners of its two halves one after the other; eight edges each, those that are
    missing at infinite cost.
    """
    n = 2 * shape[0] * shape[1]
    number = np.arange(n, dtype=np.int32).reshape(2, *shape)
    cost = np.full((2, *shape, 8), np.inf)
    there = np.zeros((2, *shape, 8), np.int32)
    halves = [Half(below, beside, first[0] + shift, first[1] + shift, shape) for shift in (0, PITCH // 2)]
    for index, half in enumerate(halves):
        other = 1 - index
        # Two rows on lies the other half: of the second one in the next row.
        for edges, to, dy, dx, places in (
            (half.downwards(PITCH, 0, 1), index, 1, 0, (0, 1)),
            (half.right(PITCH, 1), index, 0, 1, (2, 3)),
            (half.downwards(2, 2), other, index, index, (4, 6)),
            (half.downwards(2, -2), other, index, index - 1, (5, 7)),
        ):
            here_at = np.s_[: shape[0] - dy, max(-dx, 0) : shape[1] - max(dx, 0)]
            there_at = np.s_[dy:, max(dx, 0) : shape[1] - max(-dx, 0)]
            for of, at, neighbour, target, place in (
                (index, here_at, to, there_at, places[0]),
                (to, there_at, index, here_at, places[1]),
            ):
                cost[of][at][..., place] = edges[here_at]
                there[of][at][..., place] = number[neighbour][target]
    return csr_array((cost.ravel(), there.ravel(), np.arange(0, 8 * n + 1, 8, dtype=np.int32)), shape=(n, n))
