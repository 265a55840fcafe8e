"""Whether an eye would find the borders: every rule, and pairs of joined motifs, with three seeds each.

    python benchmarks/borders.py [--size 96] [--pairs 40] [--write]

Prints how conspicuous borders are, in units of the 95th percentile of inner lines
(`ts.motif.border_visibility`), and the straight edges along them (`ts.motif.border_edges`), per ink and in
the composite. Of lines that are nothing special one in twenty
is above 1, so of the larger of two directions about one in ten: "anywhere" is the control, the same patterns
with the cells laid elsewhere. Joins are measured as they are made, and by the thesis's way, `shared=0`.
``--write`` puts the table into docs/motifs.md.
"""

from __future__ import annotations

import argparse
from itertools import combinations

import numpy as np

import toposeam as ts
from stamp import stamp
from toposeam.motif.symmetry.tiling import period
from written import write_table


def values(layers: np.ndarray, image: np.ndarray, cell: tuple[int, int]) -> list[tuple[float, float]]:
    """Return visibility and edges of every ink, and of the composite."""
    return [
        (ts.motif.border_visibility(plane, cell), ts.motif.border_edges(plane, cell))
        for plane in (*layers, image)
    ]


def report(name: str, found: list[tuple[float, float]]) -> tuple[str, ...]:
    """Print a line, and return it as the cells of a row."""
    cells: list[str] = []
    for all_of_one in np.array(found).T:
        above = f"{(all_of_one > 1).sum()} of {all_of_one.size}"
        cells += [f"{np.median(all_of_one):.2f}", f"{all_of_one.max():.2f}", above]
    print(f"{name:<36}" + "".join(f"{cell:>14}" for cell in cells), flush=True)
    return name, *cells


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--pairs", type=int, default=40)
    parser.add_argument("--write", action="store_true")
    given = parser.parse_args()
    head = ("median", "worst", "above 1", "edges: median", "worst", "above 1")
    rows = [("", *head)]
    print(f"{'':<36}" + "".join(f"{each:>14}" for each in head))
    every: list[tuple[float, float]] = []
    anywhere: list[tuple[float, float]] = []
    rng = np.random.default_rng(0)
    for rule in ts.motif.REPEATS[1:]:
        found = []
        for seed in range(3):
            motif = ts.motif(given.size, repeat=rule, seed=seed)
            counts, cell = period(rule), (motif.densities.shape[1], motif.densities.shape[2])
            layers, image = ts.motif.repeat_densities(motif, counts), ts.repeat(motif, counts)
            found += values(layers, image, cell)
            moved = tuple(int(rng.integers(round(0.1 * side), round(0.9 * side))) for side in cell)
            anywhere += values(np.roll(layers, moved, (1, 2)), np.roll(image, moved, (0, 1)), cell)
        report(rule, found)
        every += found
    rows.append(report(f"all {len(ts.motif.REPEATS) - 1} rules but `none`", every))
    rows.append(report("… anywhere", anywhere))
    for shared in (None, 0):
        found = []
        for number, (a, b) in zip(range(given.pairs), combinations(range(1, 20), 2), strict=False):
            recipes = [
                ts.motif.random_recipe(
                    given.size, seed=seed, layers=2, repeat="translate", palette="sea", iterations=25
                )
                for seed in (a, b)
            ]
            joined = ts.motif.join_motifs(recipes, shared=shared)
            for seed in range(3):
                laid = ts.motif.arrange(joined.motifs, (4, 4), seed=100 * number + seed)
                found += values(laid.coverage(), laid.image(), (given.size, given.size))
        rows.append(report(f"{given.pairs} joins" + (", `shared=0`" if shared == 0 else ""), found))
    if given.write:
        write_table("motifs.md", "benchmarks/borders.py", rows)


if __name__ == "__main__":
    print(stamp())
    main()
