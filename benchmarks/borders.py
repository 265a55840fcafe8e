"""Whether an eye would find the borders: every rule, and pairs of joined motifs, with three seeds each.

    python benchmarks/borders.py [--size 96] [--pairs 40]

Prints how conspicuous borders are, in units of the 95th percentile of inner lines (`ts.border_visibility`),
per ink and in the composite. Of lines that are nothing special one in twenty is above 1, so of the larger of
two directions about one in ten: "anywhere" is the control, the same patterns with the cells laid elsewhere.
Joins are measured as they are made, and by the thesis's way, `shared=0`.
"""

from __future__ import annotations

import argparse
from itertools import combinations

import numpy as np

import toposeam as ts
from stamp import stamp
from toposeam.motif.tiling import period


def values(layers: np.ndarray, image: np.ndarray, cell: tuple[int, int]) -> list[float]:
    """Of every ink, and of the composite."""
    return [ts.border_visibility(plane, cell) for plane in (*layers, image)]


def report(name: str, found: list[float]) -> None:
    worst = np.array(found)
    print(
        f"{name:<28}{np.median(worst):>8.2f}{worst.max():>8.2f}{(worst > 1).sum():>6} of {worst.size}",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--pairs", type=int, default=40)
    given = parser.parse_args()
    print(f"{'':<28}{'median':>8}{'worst':>8}   above 1")
    every: list[float] = []
    anywhere: list[float] = []
    rng = np.random.default_rng(0)
    for rule in ts.REPEATS[1:]:
        found = []
        for seed in range(3):
            motif = ts.generate_motif(given.size, repeat=rule, seed=seed)
            counts, cell = period(rule), (motif.densities.shape[1], motif.densities.shape[2])
            layers, image = ts.repeat_densities(motif, counts), ts.repeat(motif, counts)
            found += values(layers, image, cell)
            moved = tuple(int(rng.integers(round(0.1 * side), round(0.9 * side))) for side in cell)
            anywhere += values(np.roll(layers, moved, (1, 2)), np.roll(image, moved, (0, 1)), cell)
        report(rule, found)
        every += found
    report("all rules", every)
    report("anywhere", anywhere)
    for shared in (None, 0):
        found = []
        for number, (a, b) in zip(range(given.pairs), combinations(range(1, 20), 2), strict=False):
            recipes = [
                ts.random_recipe(
                    given.size, seed=seed, layers=2, repeat="translate", palette="sea", iterations=25
                )
                for seed in (a, b)
            ]
            joined = ts.join_motifs(recipes, shared=shared)
            for seed in range(3):
                laid = ts.arrange(joined.motifs, (4, 4), seed=100 * number + seed)
                found += values(laid.coverage(), laid.image(), (given.size, given.size))
        report(f"{given.pairs} joins" + (", shared=0" if shared == 0 else ""), found)


if __name__ == "__main__":
    print(stamp())
    main()
