"""The engines of `find_seam` beside each other: what docs/heat.md says of them.

    python benchmarks/engines.py            a few minutes
    python benchmarks/engines.py --write    into docs/heat.md
    python benchmarks/engines.py --only rings

*Strips*, law natural, whole calls: heat, and the shortest path among all corners, ÷ auto, which above a
million pixels searches among every other corner first. *Rings*, match cost (2.4):
the search alone, in ms; the kernel's and SciPy's maximum flow with capacities rounded as `auto` rounds them.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import toposeam as ts
from seam_pairs import pair, ring
from stamp import stamp
from toposeam import _kernels
from toposeam.heat.threads import one_thread
from toposeam.seam.exact.graph_cut import graph_cut_labels
from toposeam.seam.exact.optimum import exact_labels
from toposeam.seam.heat.method import HeatOptions, heat_path
from toposeam.seam.problem.overlap import FREE
from toposeam.seam.problem.posing import seam_problem
from toposeam.seam.problem.seam_problem import SeamProblem
from written import write_table

STRIPS = {"160x40": 8, "320x80": 8, "640x160": 8, "1000x250": 8, "2000x500": 4, "4000x1000": 2}
RINGS = (48, 96, 192, 384, 640, 1290)
FLOW = "kernel's flow"
METHODS = {"heat": "heat", "shortest-path": "whole path"}


def strips() -> list[list[str]]:
    """Heat, the shortest path among all corners and auto on strips."""
    rows = [
        [
            "overlap",
            "pairs",
            "auto, ms",
            *(
                f"{name}: {value}"
                for name in METHODS.values()
                for value in ("time ÷ auto's", "cost ÷ auto's, median and worst")
            ),
        ]
    ]
    for size, count in STRIPS.items():
        length, width = map(int, size.split("x"))
        auto: list[float] = []
        ratios: dict[str, list[tuple[float, float]]] = {method: [] for method in METHODS}
        for index in range(count):
            a, b = pair(length, width, index, 3)
            took, found = {}, {}
            for method in ("auto", *METHODS):
                took[method], found[method] = timed(partial(ts.find_seam, a, b, method=method))
            auto.append(1e3 * took["auto"])
            for method, ratio in ratios.items():
                ratio.append((took[method] / took["auto"], found[method].cost / found["auto"].cost))
        row = [size.replace("x", " × "), str(count), three_digits(statistics.median(auto))]
        for ratio in ratios.values():
            times, costs = zip(*ratio, strict=True)
            row += [
                f"{statistics.median(times):.1f}",
                f"{statistics.median(costs):.4f}, {max(costs):.4f}",
            ]
        rows.append(row)
        print(" | ".join(rows[-1]), flush=True)
    return rows


def three_digits(value: float) -> str:
    """Return a number of milliseconds with three digits, and no exponent."""
    return f"{float(f'{value:.3g}'):g}"


def rings() -> list[list[str]]:
    """Heat and maximum flows on closed seams."""
    if _kernels.library is None:
        raise SystemExit("no kernels were built; build them with: make kernels")
    engines: dict[str, Callable[[SeamProblem], np.ndarray]] = {
        "heat": lambda problem: heat_path(problem, HeatOptions()).labels,
        FLOW: lambda problem: flowing(problem, _kernels.library),
        "SciPy's flow": lambda problem: flowing(problem, None),
        "PyMaxflow": graph_cut_labels,
    }
    rows = [["free pixels", *(f"{name}, ms" for name in engines), "flow's cost ÷ heat's"]]
    for side in RINGS:
        masks = ring(side, 2 * side // 15)
        problem = seam_problem(*pair(side, side, 1, 0), *masks, "right", ts.seam.MatchCost(law="gradient"))[0]
        row, cost = [f"{np.count_nonzero(problem.overlap.side == FREE):,}"], {}
        for name, engine in engines.items():
            fresh = SeamProblem(problem.overlap, problem.right, problem.down)
            took, labels = timed(partial(engine, fresh))
            cost[name] = problem.cost(labels)
            row.append(three_digits(1e3 * took))
        rows.append([*row, f"{cost[FLOW] / cost['heat']:.4f}"])
        print(" | ".join(rows[-1]), flush=True)
    return rows


def flowing(problem: SeamProblem, library: Any) -> np.ndarray:
    """The best seam by maximum flow, of the kernels or, without them, of SciPy."""
    before, _kernels.library = _kernels.library, library
    try:
        return exact_labels(problem)
    finally:
        _kernels.library = before


def timed(call: Callable[[], object]) -> tuple[float, object]:
    """The least processor time of three calls, s, and the result."""
    times = []
    with one_thread():
        for _ in range(3):
            started = time.process_time()
            found = call()
            times.append(time.process_time() - started)
            if times[-1] > 2:
                break
    return min(times), found


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--only", choices=("strips", "rings"))
    asked = parser.parse_args()
    print(stamp())
    for name, table in {"strips": strips, "rings": rings}.items():
        if asked.only in (None, name):
            rows = table()
            if asked.write:
                write_table("heat.md", f"benchmarks/engines.py, {name}", rows)


if __name__ == "__main__":
    main()
