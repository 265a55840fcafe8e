"""Paths by heat against the shortest ways along the grid, on random grounds, in one run: ``python
benchmarks/paths.py``, half a minute.

Grounds of 40 to 110 px have two to eight discs and boxes as obstacles; every other one costs between 1 and 9
a step. The peer is scikit-image's MCP_Geometric, which steps to the eight neighbours. Ways in any direction
can be up to 8 % shorter than its. Seconds are CPU.
"""

from __future__ import annotations

import statistics
import time

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from skimage.graph import MCP_Geometric

import toposeam as ts
from stamp import stamp

Point = tuple[int, int]


def random_ground(seed: int) -> tuple[npt.NDArray[np.float64], Point, Point] | None:
    """Costs, start and end as (x, y); None if obstacles part the two."""
    rng = np.random.default_rng(seed)
    height, width = rng.integers(40, 110, 2)
    cost = np.ones((height, width))
    rows, columns = np.mgrid[:height, :width]
    for _ in range(rng.integers(2, 9)):
        y, x = rng.integers(0, height), rng.integers(0, width)
        if rng.random() < 0.5:
            cost[np.hypot(rows - y, columns - x) < rng.integers(3, 16)] = np.inf
        else:
            cost[y : y + rng.integers(2, 30), x : x + rng.integers(2, 30)] = np.inf
    if seed % 2:
        smooth = ndimage.gaussian_filter(rng.random((height, width)), 5)
        cost = np.where(np.isinf(cost), cost, 1 + 8 * (smooth - smooth.min()) / np.ptp(smooth))
    free = np.argwhere(np.isfinite(cost))
    (y0, x0), (y1, x1) = free[rng.integers(len(free), size=2)]
    pieces, _ = ndimage.label(np.isfinite(cost))
    if pieces[y0, x0] != pieces[y1, x1] or (y0, x0) == (y1, x1):
        return None
    return cost, (int(x0), int(y0)), (int(x1), int(y1))


def main() -> None:
    """Print a line per ground and the medians."""
    ratios, seconds, peer_seconds = [], [], []
    for seed in range(24):
        found = random_ground(seed)
        if found is None:
            continue
        cost, start, end = found
        started = time.process_time()
        way = ts.plan_path(cost, start, end)
        seconds.append(time.process_time() - started)
        started = time.process_time()
        reached, _ = MCP_Geometric(np.where(np.isinf(cost), -1, cost)).find_costs([start[::-1]])
        peer_seconds.append(time.process_time() - started)
        least = float(reached[end[::-1]])
        ratios.append(way.cost / least)
        print(
            f"{cost.shape[1]:4d} × {cost.shape[0]:3d}: heat {way.cost:7.1f}, grid {least:7.1f}, ratio "
            f"{ratios[-1]:.4f}, {seconds[-1]:.2f} s"
        )
    print(
        f"{len(ratios)} grounds: cost ÷ grid's {min(ratios):.3f} to {max(ratios):.3f}, median "
        f"{statistics.median(ratios):.3f}; heat {statistics.median(seconds):.2f} s, grid "
        f"{1000 * statistics.median(peer_seconds):.1f} ms"
    )


if __name__ == "__main__":
    print(stamp())
    main()
