"""Whether a texture that repeats keeps step with the lattice on which its order closes: ``python
benchmarks/texture_order.py [--seeds 3]`` checks the measure on breaks that were planted.

What an ordered sample looks like on average at each phase of its lattice (the edges of it, as bricks and
cells differ in tone) is compared with every place of the tile, as seen through a window of half a period, in
each of 8 or 8 × 8 phases. A place is out of step where another phase than the lattice's own, by more than a
quarter of a period, is nearest to what is there; the connected places are the pieces that are told.

An earlier measure looked at the tile's values through one wave of the lattice and a window of a period. Tones
of bricks that happen to stand in a diagonal have that wave too, at any phase; and it hardly saw breaks of a
patch's size. Both are run here on tiles as they are grown, and with a square of 40 px taken from half a
period aside.
"""

from __future__ import annotations

import argparse
import itertools

import numpy as np
from scipy import ndimage

import toposeam as ts
from stamp import stamp
from texture import gray
from texture_samples import samples
from toposeam.texture.periodicity.period import Order, find_order

#: Bins of a period of the mean cell, and phases of it that are compared.
BINS, PHASES = 24, 8
#: Deviation of the window, in periods, and of the edges, px; blocks by which windows are taken, px.
WINDOW, EDGES, BLOCK = 0.5, 1.0, 4
#: Side of a planted break, px.
SIDE = 40


def broken(image: np.ndarray, sample: np.ndarray, order: Order, repeats: bool = True) -> int:
    """Pieces of a tile, or of a texture with borders, that are out of step by more than a quarter of a
    period.
    """
    size, mode = np.array(image.shape[:2]), "wrap" if repeats else "nearest"
    closed = np.rint(order.reciprocal * size) / size if repeats else order.reciprocal
    cell = mean_cell(edges(sample, "reflect"), order.reciprocal)
    cell = (cell - cell.mean()) / cell.std()
    values = edges(image, mode)
    values = (values - values.mean()) / values.std()
    axes = tuple(range(len(closed)))
    # Where the tile begins in the cell: the shift at which the tile's own mean cell is most like it.
    own = mean_cell(values, closed)
    likeness = np.fft.ifftn(np.conj(np.fft.fftn(own)) * np.fft.fftn(cell)).real
    start = np.array(np.unravel_index(likeness.argmax(), likeness.shape))
    phase = [line + first / BINS for line, first in zip(phases(values.shape, closed), start, strict=True)]
    period = float(np.mean(1 / np.linalg.norm(closed, axis=1)))
    least: dict[bool, np.ndarray] = {}
    for steps in itertools.product(range(PHASES), repeat=len(axes)):
        near = all(min(step, PHASES - step) <= PHASES / 4 for step in steps)
        at = tuple(
            ((line + step / PHASES) % 1 * BINS).astype(int) % BINS
            for line, step in zip(phase, steps, strict=True)
        )
        apart = blocks(np.square(values - cell[at]))
        apart = ndimage.gaussian_filter(apart, WINDOW * period / BLOCK, mode=mode)
        least[near] = np.minimum(least.get(near, np.inf), apart)
    return int(ndimage.label(least[False] < least[True])[1])


def edges(image: np.ndarray, mode: str) -> np.ndarray:
    """How steep a picture is, as far as most of its edges are."""
    steep = np.hypot(
        *[ndimage.gaussian_filter(gray(image), EDGES, order=o, mode=mode) for o in ((1, 0), (0, 1))]
    )
    return np.minimum(steep / max(np.percentile(steep, 75), 1e-9), 2)


def phases(shape: tuple[int, ...], cycles: np.ndarray) -> list[np.ndarray]:
    y, x = np.ogrid[: shape[0], : shape[1]]
    return [k[0] * y + k[1] * x for k in cycles]


def mean_cell(values: np.ndarray, cycles: np.ndarray) -> np.ndarray:
    """The mean of values by their phases, one axis for each vector."""
    at = tuple((line % 1 * BINS).astype(int) % BINS for line in phases(values.shape, cycles))
    total, count = np.zeros((2, *(BINS,) * len(cycles)))
    np.add.at(total, at, values)
    np.add.at(count, at, 1)
    total, count = (ndimage.gaussian_filter(one, 1, mode="wrap") for one in (total, count))
    return total / np.maximum(count, 1e-9)


def blocks(values: np.ndarray) -> np.ndarray:
    """Means of blocks; what does not fill one is left out."""
    height, width = (length // BLOCK for length in values.shape)
    part = values[: height * BLOCK, : width * BLOCK]
    return part.reshape(height, BLOCK, width, BLOCK).mean(axis=(1, 3))


def turned_waves(image: np.ndarray, order: Order) -> int:
    """The earlier measure: where the wave of a reciprocal vector, seen through a window of a period, is
    turned by more than a quarter.
    """
    values, size = gray(image), np.array(image.shape[:2])
    found = np.zeros(values.shape, bool)
    for cycles in order.reciprocal:
        period = 1 / np.linalg.norm(cycles)
        (line,) = phases(values.shape, (np.rint(cycles * size) / size)[np.newaxis])
        wave = values - ndimage.gaussian_filter(values, period, mode="wrap")
        local = ndimage.gaussian_filter(wave * np.exp(-2j * np.pi * line), period, mode="wrap")
        found |= (local * np.exp(-1j * np.angle(local.sum()))).real <= 0
    return int(ndimage.label(found)[1])


def planted(image: np.ndarray, shift: np.ndarray, seed: int) -> np.ndarray:
    """A tile in which a square comes from some px aside."""
    at = np.random.default_rng(seed).integers(0, np.array(image.shape[:2]) - SIDE)
    square = tuple(slice(first, first + SIDE) for first in at)
    result = image.copy()
    result[square] = np.roll(image, np.rint(shift).astype(int), (0, 1))[square]
    return result


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    parser.add_argument("--only", default="", help="names of samples, with commas between")
    options = parser.parse_args()
    print(f"{'':14}{'pieces out of step':>24}{'with a break planted':>28}")
    print(f"{'':14}{'edges':>12}{'wave':>12}{'edges':>14}{'wave':>14}")
    for sample in samples():
        if options.only and sample.name not in options.only.split(","):
            continue
        height, width = sample.image.shape[:2]
        values = (sample.image / np.float32(255)).reshape(height, width, -1)
        order = find_order(values, np.ones((height, width), bool))
        if order is None:
            continue
        told, seen, breaks = np.zeros(2, int), np.zeros(2, int), 0
        for seed in range(options.first, options.first + options.seeds):
            tile = ts.synthesize(sample.image, 512, seed=seed, tileable="both").image
            plain = np.array([broken(tile, sample.image, order), turned_waves(tile, order)])
            told += plain
            for period in order.periods:
                bad = planted(tile, period / 2, seed)
                seen += np.array([broken(bad, sample.image, order), turned_waves(bad, order)]) > plain
                breaks += 1
        print(
            f"{sample.name:14}{told[0]:>12}{told[1]:>12}"
            + "".join(f"{f'{count} of {breaks} seen':>14}" for count in seen),
            flush=True,
        )


if __name__ == "__main__":
    print(stamp())
    main()
