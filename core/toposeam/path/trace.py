"""The way read off the material that heat gathered: followed pixel by pixel, drawn taut, its cost."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

Floats = npt.NDArray[np.float64]


def trace(
    density: Floats, cost: Floats, sources: list[tuple[int, int]], sinks: list[tuple[int, int]]
) -> list[Floats]:
    """The way of least resistance through the material, from pixel centre to pixel centre."""
    free = np.isfinite(cost)
    height, width = cost.shape
    number = np.arange(height * width).reshape(height, width)
    resistance = np.where(free, 1.0 / (density + 1e-3), np.inf)
    rows, columns, weights = [], [], []
    for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
        one = (slice(0, height - dy), slice(max(0, -dx), width - max(0, dx)))
        other = (slice(dy, height), slice(max(0, dx), width + min(0, dx)))
        open_ = free[one] & free[other]
        if dx and dy:  # no squeezing between two obstacles that touch at a corner
            open_ &= free[one[0], other[1]] & free[other[0], one[1]]
        rows.append(number[one][open_])
        columns.append(number[other][open_])
        weights.append((np.hypot(dy, dx) * 0.5 * (resistance[one] + resistance[other]))[open_])
    graph = csr_array(
        (np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))),
        shape=(height * width,) * 2,
    )
    _, before, _ = dijkstra(
        graph,
        directed=False,
        indices=[number[sink] for sink in sinks],
        return_predecessors=True,
        min_only=True,
    )
    lines = []
    for source in sources:
        here = int(number[source])
        chain = [here]
        while before[here] >= 0:
            here = int(before[here])
            chain.append(here)
        lines.append(np.column_stack([np.array(chain) % width, np.array(chain) // width]) + 0.5)
    return lines


def taut(points: Floats, cost: Floats) -> Floats:
    """Leave points out wherever the straight line past them costs no more than the way through them."""
    steps = np.array([cost_along(points[at : at + 2], cost) for at in range(len(points) - 1)])
    upto = np.concatenate([[0.0], np.cumsum(steps)])
    least = np.full(len(points), np.inf)  # cost of the cheapest way to the end through some of the points
    following = np.zeros(len(points), np.int64)
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
        totals = straight + least[reach]
        best = int(totals.argmin())
        least[at], following[at] = totals[best], reach[best]
    assert least[0] <= upto[-1] + 1e-6  # noqa: S101 - single steps are among the choices
    chain = [0]
    while chain[-1] < len(points) - 1:
        chain.append(int(following[chain[-1]]))
    return points[chain]


def cost_along(points: Floats, cost: Floats) -> float:
    """The exact integral: pixel after pixel, each with the length of the line in it. No line leads through
    between two obstacles that touch at a corner.
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
        for at in share[1:][~inside].tolist():  # where the line runs through a corner
            column, row = round(x + at * (to_x - x)), round(y + at * (to_y - y))
            if not (0 < column < cost.shape[1] and 0 < row < cost.shape[0]):
                continue
            rising = (to_x - x) * (to_y - y) < 0
            if np.isinf([cost[row - 1, column - rising], cost[row, column - (not rising)]]).all():
                return float("inf")
        columns = (x + middle[inside] * (to_x - x)).astype(np.int64)
        rows = (y + middle[inside] * (to_y - y)).astype(np.int64)
        values = cost[np.minimum(rows, cost.shape[0] - 1), np.minimum(columns, cost.shape[1] - 1)]
        total += float(np.hypot(to_x - x, to_y - y)) * float((values * np.diff(share)[inside]).sum())
    return total
