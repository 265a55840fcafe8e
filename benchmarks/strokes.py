"""How clean strokes are: pinholes, crumbs and fine lines of every rule.

    python benchmarks/strokes.py [--size 192] [--seeds 77 9] [--write]

Each rule is printed with crisp strokes at once and twice its elements, and as wash. A pinhole is a hole, a
crumb a piece of ink that hangs on nothing, of at most 16 elements (more than half of a pixel inked counts as
ink). A fine line is a row or column of wash whose second difference is 2.5 times that of the lines round it;
straight strokes make some in every rule. ``--write`` puts the table into docs/motifs.md.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy import ndimage

import toposeam as ts
from stamp import stamp
from toposeam.motif.symmetry.mirrors import mirror_places
from toposeam.motif.symmetry.tiling import tile
from written import write_table

#: Elements of the largest speck.
SPECK = 16


def specks(mask: np.ndarray, most: int, neighbours: int) -> int:
    """Pieces of a mask that are small, but for those that the picture's border cuts."""
    labels, count = ndimage.label(mask, ndimage.generate_binary_structure(2, neighbours))
    small = np.bincount(labels.ravel(), minlength=count + 1) <= most
    small[0] = False
    for end in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        small[end] = False
    return int(small.sum())


def fine_lines(print_: np.ndarray) -> int:
    """Rows and columns that stand out from those round them."""
    found = 0
    for one in (print_, print_.T):
        second = np.abs(np.diff(one, 2, axis=1)).mean(axis=0)
        around = ndimage.median_filter(second, 9, mode="wrap")
        found += int(((second > 2.5 * around) & (second > 1e-3)).sum())
    return found


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--size", type=int, default=192)
    parser.add_argument("--seeds", type=int, nargs="+", default=[77, 9])
    parser.add_argument("--write", action="store_true")
    asked = parser.parse_args()
    print(stamp())
    totals = {kind: np.zeros(3, int) for kind in ("rules with mirrors", "rules without")}
    for rule in ts.motif.REPEATS:
        counts = np.zeros(3, int)
        for seed in asked.seeds:
            given = {"layers": 1, "repeat": rule, "seed": seed, "palette": "sumi"}
            motif = ts.motif(asked.size, edge="crisp", **given)
            rows, columns = motif.densities.shape[1:]
            for fine in (1, 2):
                covered = tile(motif.coverage((fine * rows, fine * columns)), rule, (2, 2))[0]
                counts[0] += specks(covered <= 0.5, SPECK * fine**2, 1)
                counts[1] += specks(covered > 0.5, SPECK * fine**2, 2)
            wash = ts.motif(asked.size, penalty=1.1, edge="soft", **given)
            counts[2] += fine_lines(tile(wash.coverage(), rule, (2, 2))[0])
        kind = "rules with mirrors" if any(mirror_places(rule)) else "rules without"
        totals[kind] += counts
        print(f"{rule:<12}{counts[0]:>8} pinholes{counts[1]:>8} crumbs{counts[2]:>8} fine lines", flush=True)
    table = [(kind, *map(str, counts)) for kind, counts in totals.items()]
    print(*table, sep="\n")
    if asked.write:
        write_table(
            "motifs.md", "benchmarks/strokes.py", [("", "pinholes", "crumbs", "fine lines in wash"), *table]
        )


if __name__ == "__main__":
    main()
