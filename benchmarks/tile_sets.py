"""Do the tiles of a set fit? Steps across borders of tiles ÷ steps between pixels in them, on random fields.

    python benchmarks/tile_sets.py [FIELDS]

Each field is 8 × 8 tiles, whose corners are either material at random. At most 1.0 means that borders show no
more than the rest. Beside it, under *unfit*, are the same tiles in another order, in which they do not fit.
"""

from __future__ import annotations

import sys
import time

import numpy as np

import toposeam as ts
from stamp import stamp
from texture_samples import samples

PAIRS = (
    ("grass", "gravel"),
    ("gravel", "cobbles"),
    ("grass", "leaves"),
    ("marble", "cloth"),
    ("grass", "brick"),
)
SIZE = 64


def ratio(tiles: ts.texture.TileSet, numbers: np.ndarray) -> float:
    """Mean step across borders over the mean step within tiles."""
    field, size = tiles.laid(numbers).astype(float), tiles.size
    field = field.reshape(*field.shape[:2], -1).mean(2)
    border, inner = [], []
    for values in (field, field.T):
        steps = np.abs(np.diff(values, axis=0))
        at = np.arange(1, len(values)) % size == 0
        border.append(steps[at].mean())
        inner.append(steps[~at].mean())
    return float(np.mean(border) / np.mean(inner))


def main(fields: int) -> None:
    """Print a table."""
    print(stamp())
    print(f"{'':20}{'mean':>8}{'most':>8}{'> 1.0':>8}{'unfit':>8}{'s':>8}")
    known = {one.name: one.image for one in samples()}
    for names in PAIRS:
        pair = [
            image if image.ndim == 3 else np.repeat(image[..., np.newaxis], 3, 2)
            for image in map(known.get, names)
        ]
        start = time.process_time()
        tiles = ts.texture.tile_set(pair, SIZE)
        took = time.process_time() - start
        rng = np.random.default_rng(0)
        found, unfit = [], []
        for _ in range(fields):
            numbers = tiles.numbers(rng.random((9, 9)) < 0.5, rng)
            found.append(ratio(tiles, numbers))
            if len(unfit) < 20:
                unfit.append(ratio(tiles, rng.permutation(numbers.ravel()).reshape(numbers.shape)))
        print(
            f"{' and '.join(names):20}{np.mean(found):8.3f}{max(found):8.3f}"
            f"{np.mean(np.array(found) > 1):8.1%}{np.mean(unfit):8.3f}{took:8.1f}",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
