"""Pictures resampled by cubic splines: ours, all channels with the same weights, beside SciPy's
`map_coordinates`, one after the other.

    python benchmarks/warping.py

Prints processor time a pixel, ns, of blocks as `toposeam stitch` warps them, and how far the results are
apart in 8 bits.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import scipy.ndimage

from stamp import stamp
from toposeam.layers.canvas import resampled

SIDE, MARGIN, TIMES = 256, 12, 20


def theirs(picture: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The same by SciPy, from a part that is as large."""
    low = np.floor(points.min(axis=0)).astype(int) - MARGIN
    high = np.ceil(points.max(axis=0)).astype(int) + MARGIN + 1
    part = picture[low[1] : high[1], low[0] : high[0]].astype(np.float32)
    where = (points - low)[:, ::-1].T
    planes = [scipy.ndimage.map_coordinates(plane, where, order=3) for plane in np.moveaxis(part, -1, 0)]
    return np.stack(planes, axis=-1)


def least(run: Callable[[], np.ndarray]) -> float:
    """The least of several times, ns a pixel."""
    took = []
    for _ in range(TIMES):
        begun = time.process_time_ns()
        run()
        took.append(time.process_time_ns() - begun)
    return min(took) / SIDE**2


def main() -> None:
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    print(stamp())
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
    points = np.stack([0.99 * x + 0.02 * y + 40.3, 1.01 * y - 0.03 * x + 50.7], axis=-1).reshape(-1, 2)
    print(f"{'channels':>8}{'ours':>8}{'SciPy':>8}{'ratio':>8}{'apart':>10}")
    for channels in (1, 3, 4):
        picture = rng.integers(0, 256, (400, 400, channels)).astype(np.float32)
        ours = least(partial(resampled, picture, 255.0, points))
        scipys = least(partial(theirs, picture, points))
        apart = np.abs(resampled(picture, 255, points) - theirs(picture, points)).max()
        print(f"{channels:8}{ours:8.0f}{scipys:8.0f}{ours / scipys:8.2f}{apart:10.1e}")


if __name__ == "__main__":
    main()
