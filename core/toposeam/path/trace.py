"""Tracing of ways through optimised material: pixel by pixel, then straightened; and the cost of a line."""

from __future__ import annotations

from array import array
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from toposeam.arrays import Floats


def trace(
    density: Floats, cost: Floats, sources: list[tuple[int, int]], sinks: list[tuple[int, int]]
) -> list[Floats]:
    """Find the way of least resistance from every source to a sink, as (n, 2) x and y of pixel centres."""
    cells = np.flatnonzero(np.isfinite(cost))
    number = np.full(cost.shape, -1, np.int32)
    number.ravel()[cells] = np.arange(len(cells))
    _, before, _ = dijkstra(
        _neighbours(density, number),
        directed=False,
        indices=[number[sink] for sink in sinks],
        return_predecessors=True,
        min_only=True,
    )
    lines = []
    for source in sources:
        here = int(number[source])
        chain = array("q", [here])
        while before[here] >= 0:
            here = int(before[here])
            chain.append(here)
        rows, columns = np.divmod(cells[np.array(chain)], cost.shape[1])
        lines.append(np.column_stack([columns, rows]) + 0.5)
    return lines


def _neighbours(density: Floats, number: npt.NDArray[np.int32]) -> csr_array:
    """Return the resistances between neighbouring pixels as a sparse matrix.

    `number` holds the row of every pixel in the matrix, -1 on obstacles. This is a function of its own so
    that its temporary arrays are freed before the search.
    """
    free = number >= 0
    height, width = number.shape
    resistance = np.where(free, 1.0 / (density + 1e-3), np.inf)
    rows, columns, weights = [], [], []
    for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
        one = (slice(0, height - dy), slice(max(0, -dx), width - max(0, dx)))
        other = (slice(dy, height), slice(max(0, dx), width + min(0, dx)))
        open_ = free[one] & free[other]
        if dx and dy:  # no step between two obstacles that touch at a corner
            open_ &= free[one[0], other[1]] & free[other[0], one[1]]
        rows.append(number[one][open_])
        columns.append(number[other][open_])
        weights.append((np.hypot(dy, dx) * 0.5 * (resistance[one] + resistance[other]))[open_])
    return csr_array(
        (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))),
        shape=(int(number.max()) + 1,) * 2,
    )


#: Largest number of a line's points between which straight lines are tried; longer lines are thinned out.
_MAX_TAUT_POINTS = 512
#: Largest number of px, about, over all straight lines together: long lines are thinned out further.
_MAX_TRIED_PX = 100_000_000


def pull_taut(line: Floats, cost: Floats) -> Floats:
    """Replace parts of a line by straight ones wherever these cost no more.

    `line`, (n, 2) x and y, leads from centre to centre of neighbouring pixels.
    """
    columns, rows = line.astype(np.int64).T
    prices = cost[rows, columns]
    steps = np.hypot(*np.diff(line, axis=0).T) * 0.5 * (prices[1:] + prices[:-1])
    upto = np.concatenate([[0.0], np.cumsum(steps)])
    lines_each = 72 * float(np.ptp(line, axis=0).max() + 1)
    every = -(-len(line) // int(np.clip(_MAX_TRIED_PX / lines_each, 16, _MAX_TAUT_POINTS)))
    chosen = np.unique(np.append(np.arange(0, len(line), every), len(line) - 1))
    points = line[chosen]
    least = np.full(len(points), np.inf)  # cost of the cheapest way from each point to the end
    following = np.zeros(len(points), np.int64)
    straight_on = np.ones(len(points), bool)  # straight to the next point, or along the given line
    least[-1] = 0.0
    for at in range(len(points) - 2, -1, -1):
        reach = np.unique(
            np.concatenate(
                [
                    np.arange(at + 1, min(at + 9, len(points))),
                    np.arange(len(points) - 1, at, -max(1, len(points) // 64)),
                ]
            )
        )
        straight = np.array([cost_along(points[[at, to]], cost) for to in reach])
        along = upto[chosen[at + 1]] - upto[chosen[at]]
        straight_on[at] = straight[0] <= along * (1 + 1e-9)
        straight[0] = min(straight[0], along)
        totals = straight + least[reach]
        best = int(totals.argmin())
        least[at], following[at] = totals[best], reach[best]
    assert least[0] <= upto[-1] * (1 + 1e-9) + 1e-6  # noqa: S101 - the given line is among the choices
    kept = [0]
    at = 0
    while at < len(points) - 1:
        to = int(following[at])
        if to == at + 1 and not straight_on[at]:
            kept.extend(range(int(chosen[at]) + 1, int(chosen[to])))
        kept.append(int(chosen[to]))
        at = to
    return line[kept]


def cost_along(points: Floats, cost: Floats) -> float:
    """Integrate costs along a line exactly: Σ of the cost of each pixel times the line's length in it.

    The cost is infinite if the line crosses an obstacle, or leads between two that touch at a corner.
    """
    total = 0.0
    for (x, y), (to_x, to_y) in pairwise(points.tolist()):
        crossings = [np.zeros(1), np.ones(1)]
        for start, end in ((x, to_x), (y, to_y)):
            low, high = sorted((start, end))
            if high > low:
                crossings.append((np.arange(np.floor(low) + 1, np.ceil(high)) - start) / (end - start))
        share = np.sort(np.concatenate(crossings))
        middle = 0.5 * (share[1:] + share[:-1])
        inside = share[1:] - share[:-1] > 1e-12
        at = share[1:][~inside]  # where the line runs through a corner
        column, row = (np.rint(a + at * (b - a)).astype(np.int64) for a, b in ((x, to_x), (y, to_y)))
        within = (column > 0) & (column < cost.shape[1]) & (row > 0) & (row < cost.shape[0])
        column, row = column[within], row[within]
        rising = (to_x - x) * (to_y - y) < 0
        if (np.isinf(cost[row - 1, column - rising]) & np.isinf(cost[row, column - (not rising)])).any():
            return float("inf")
        columns = (x + middle[inside] * (to_x - x)).astype(np.int64)
        rows = (y + middle[inside] * (to_y - y)).astype(np.int64)
        values = cost[np.minimum(rows, cost.shape[0] - 1), np.minimum(columns, cost.shape[1] - 1)]
        total += float(np.hypot(to_x - x, to_y - y)) * float((values * np.diff(share)[inside]).sum())
    return total
