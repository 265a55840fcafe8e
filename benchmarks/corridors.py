"""Overlaps that are hard on a method, by narrow places, ragged masks or noise: what seams cost ÷ the best
that maximum flow finds without the library, what is proven of them, and how often they keep to the border.

    python benchmarks/corridors.py                     all three tables, about two minutes
    python benchmarks/corridors.py --table ragged --cases 100
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import toposeam as ts
from stamp import stamp
from toposeam.errors import SolverError

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "core"))

from narrow_cases import KINDS, at_border, least_by_flow, least_by_graph, narrow, noisy, ragged

#: A seam is the best one if it costs no more than so many times as much: costs are float32.
BEST = 1 + 1e-6
GRAPH = importlib.util.find_spec("maxflow") is not None
METHODS = ("heat", "shortest-path", *(("graph-cut",) if GRAPH else ()), "thesis")


def least(problem: Any) -> float:
    """What the best seam, or surface, costs."""
    return float(least_by_graph(problem) if GRAPH else least_by_flow(problem))


def narrow_places(count: int) -> None:
    """In how many overlaps with narrow places each method finds the best seam."""
    print(f"{count} overlaps with places 1, 2 and 3 px wide\n")
    print(f"{'':<12}" + "".join(f"{name:>26}" for name in (*METHODS, "proof")))
    found: dict[str, list[list[float]]] = {kind: [] for kind in (*KINDS, "all")}
    for index in range(count):
        *given, options = narrow(index)
        seams = [ts.find_seam(*given, **options, method=method) for method in METHODS]
        proof = ts.find_seam(*given, **options, prove=True).bound
        best = least(seams[0].problem)
        ratios = [*(seam.cost / best for seam in seams), max(proof / best, best / proof)]
        for kind in (list(KINDS)[index % len(KINDS)], "all"):
            found[kind].append(ratios)
    for kind, rows in found.items():
        cells = (
            f"{sum(ratio <= BEST for ratio in ratios)} of {len(ratios)}, worst {max(ratios):.4f}"
            for ratios in zip(*rows, strict=True)
        )
        print(f"{kind:<12}" + "".join(f"{cell:>26}" for cell in cells))


def ragged_masks(count: int) -> None:
    """How far what is proven lies below the best seam, and the best surface, of ragged masks."""
    print(f"\n{count} overlaps of ragged masks with specks, and {count // 5} of volumes\n")
    heads = "compared", "broke", "cost ÷ optimum, worst", "optimum ÷ bound, worst", "bound > it"
    print(f"{'':<18}" + "".join(f"{head:>{len(head) + 2}}" for head in heads))
    proved = {"method": "thesis", "prove": True}
    rows: list[tuple[str, Callable[..., Any], int, dict[str, Any]]] = [
        ("heat", ts.find_seam, 2, {"method": "heat"}),
        ("heat, proven", ts.find_seam, 2, {"method": "heat", "prove": True}),
        ("thesis, proven", ts.find_seam, 2, proved),
        *((method, ts.find_seam, 2, {"method": method}) for method in METHODS[1:-1]),
        ("heat, surfaces", ts.find_surface, 3, {}),
    ]
    for name, find, axes, options in rows:
        costs, bounds, broke = [], [], 0
        for index in range(count if axes == 2 else count // 5):
            try:
                made = find(*ragged(index, axes), **options)
            except ts.OverlapError:  # nothing to decide
                continue
            except SolverError:
                broke += 1
                continue
            best = least(made.problem)
            if best == made.cost == made.bound == 0:  # the patches touch nowhere
                continue
            costs.append(made.cost / best)
            bounds.append(best / made.bound)
        above = sum(ratio < 1 - 1e-6 for ratio in bounds)
        numbers = f"{len(costs):>10}{broke:>7}{max(costs):>23.6f}{max(bounds):>24.6f}{above:>12}"
        print(f"{name:<18}{numbers}", flush=True)


def noise_at_borders(seeds: int) -> None:
    """Which share of seams through noise lies in the two outermost columns of forty."""
    print(f"\n{seeds} overlaps of 160 × 40 px, one slow slope and noise of its own on either side\n")
    print(f"{'noise':<8}{'in the outermost columns':>26}{'without gradient':>18}{'seams mostly there':>20}")
    for noise in (0.005, 0.01, 0.02, 0.03, 0.05):
        shares, mostly = [], 0
        for gradient in (True, False):
            seams = (ts.find_seam(*noisy(seed, noise), gradient=gradient) for seed in range(seeds))
            crossed, outermost = np.transpose([at_border(seam.labels) for seam in seams])
            shares.append(outermost.sum() / crossed.sum())
            mostly = mostly if not gradient else int((outermost > crossed / 2).sum())
        print(f"{noise:<8.1%}{shares[0]:>26.3f}{shares[1]:>18.3f}{mostly:>13} of {seeds}")


TABLES = {"narrow": narrow_places, "ragged": ragged_masks, "noise": noise_at_borders}
CASES = {"narrow": 200, "ragged": 1000, "noise": 24}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", choices=TABLES, help="only this one")
    parser.add_argument("--cases", type=int, help="of each table")
    options = parser.parse_args()
    for name, table in TABLES.items():
        if options.table in (None, name):
            table(options.cases or CASES[name])


if __name__ == "__main__":
    print(stamp())
    main()
