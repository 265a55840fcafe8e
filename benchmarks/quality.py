"""How good the iterative methods' seams are: cost ÷ exact optimum on random crops of photographs.

    python benchmarks/quality.py                       strips for every variant, about five minutes
    python benchmarks/quality.py --strips 20 --variant "thesis, Formulation 2"
    python benchmarks/quality.py --cases               the thesis's own validation cases instead

Strips are 60 × 15 to 320 × 80 px, half of them horizontal, as in the tests. A plain transcription of the
thesis and Formulation 2 are among the variants to show what the changes that thesis.py lists are for. "in
Σ M²" is the ratio in the currency of the text, whose elements weigh M²: what the seam costs so, ÷ the least.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

import toposeam as ts
from seam_pairs import PHOTOGRAPHS, crops
from stamp import stamp
from toposeam.errors import SolverError
from toposeam.seam.exact.optimum import exact_labels
from toposeam.seam.problem.seam_problem import SeamProblem

SIZES = ((60, 15), (80, 20), (120, 30), (160, 40), (240, 60), (320, 80))
SHARES = (0.3, 0.25, 0.2, 0.15, 0.07, 0.03)

VARIANTS: dict[str, dict[str, Any]] = {
    "heat": {"method": "heat"},
    "thesis": {"method": "thesis"},
    "thesis, p = 3 from the start": {"method": "thesis", "first_penalty": 3.0},
    "thesis, moving asymptotes": {"method": "thesis", "asymptotes": "moving"},
    "thesis, plain, move ≤ 0.2": {"method": "thesis", "options": ts.seam.ThesisOptions.plain(move=0.2)},
    "thesis, plain, move ≤ 1": {"method": "thesis", "options": ts.seam.ThesisOptions.plain(move=1.0)},
    "thesis, Formulation 2": {"method": "thesis", "formulation": 2},
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--strips", type=int, default=60)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--variant", action="append", choices=VARIANTS, help="only this one; may be repeated")
    parser.add_argument("--cases", action="store_true", help="the constructed cases of chapter 3 instead")
    options = parser.parse_args()
    if options.cases:
        cases(options.variant or list(VARIANTS))
        return
    print(f"{options.strips} strips\n")
    print(
        f"{'':<32}{'single line':>12}{'≤ 4 stages':>12}{'iterations':>12}"
        f"{'cost ÷ optimum':>16}{'worst':>8}{'in Σ M²':>9}{'broke':>7}{'CPU s':>8}"
    )
    for name in options.variant or VARIANTS:
        ratios, squares, single, staged, iterations, broke, took = [], [], 0, 0, [], 0, 0.0
        for index in range(options.strips):
            rng = np.random.default_rng([options.seed, index])
            length, width = SIZES[rng.choice(len(SIZES), p=SHARES)]
            a, b = crops(PHOTOGRAPHS[index % len(PHOTOGRAPHS)], length, width, rng)
            if index % 2:
                a, b = a.swapaxes(0, 1), b.swapaxes(0, 1)
            started = time.process_time()
            try:
                seam = ts.find_seam(
                    a, b, side="bottom" if index % 2 else "right", gradient=True, **VARIANTS[name]
                )
            except SolverError:
                broke += 1
                continue
            done = seam.termination == ts.optimize.Termination.SINGLE_LINE
            single += done
            staged += done and seam.history[-1].stage <= 4 and len(seam.history) <= 100
            iterations.append(len(seam.history))
            took += time.process_time() - started
            ratios.append(seam.optimum_ratio())
            squares.append(optimum_ratio_of_squares(seam))
        n = options.strips
        print(
            f"{name:<32}{single / n:>12.0%}{staged / n:>12.0%}"
            f"{int(np.median(iterations)):>8}/{max(iterations):<3}{np.median(ratios):>16.4f}"
            f"{max(ratios):>8.3f}{np.median(squares):>9.4f}{broke:>7}{took:>8.1f}",
            flush=True,
        )


def optimum_ratio_of_squares(seam: ts.seam.Seam) -> float:
    """Σ M² of a seam ÷ the least there is."""
    problem = seam.problem
    squared = SeamProblem(problem.overlap, problem.right**2, problem.down**2)
    return squared.cost(problem.overlap.window(seam.labels)) / squared.cost(exact_labels(squared))


def cases(variants: list[str]) -> None:
    """Figures 3.5, 3.11, 3.13 and 3.14: cost ÷ optimum of each variant, * where no single line is left."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))
    import thesis_cases

    made = {
        "3.5 toy": (thesis_cases.toy(), {}),
        "3.11 zigzag": (thesis_cases.zigzag(), {}),
        "3.11 no grad.": (thesis_cases.zigzag(), {"cost": ts.seam.MatchCost(law="colour")}),
        "3.13 L": (thesis_cases.ell(), {}),
        "3.14 colours": (thesis_cases.random_colours(), {}),
    }
    print(f"{'':<32}" + "".join(f"{name:>14}" for name in made))
    for name in variants:
        line = f"{name:<32}"
        for case, more in made.values():
            try:
                seam = case.find(**VARIANTS[name], **more)
                several = "*" if seam.termination == ts.optimize.Termination.ITERATIONS else ""
                line += f"{seam.optimum_ratio():>13.4f}{several or ' '}"
            except SolverError:
                line += f"{'broke':>13} "
        print(line, flush=True)


if __name__ == "__main__":
    print(stamp())
    main()
