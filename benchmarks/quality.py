"""How good the iterative methods' seams are: cost ÷ exact optimum on random crops of photographs.

    python benchmarks/quality.py                       strips for every variant, about five minutes
    python benchmarks/quality.py --strips 20 --variant "thesis, Formulation 2"

Strips are 60 × 15 to 320 × 80 px, half of them horizontal, as in the tests. A plain transcription of the thesis and Formulation 2 are among
the variants to show what the changes that thesis.py lists are for.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np

import toposeam as ts
from seams import PHOTOGRAPHS, crops
from toposeam.errors import SolverError

SIZES = ((60, 15), (80, 20), (120, 30), (160, 40), (240, 60), (320, 80))
SHARES = (0.3, 0.25, 0.2, 0.15, 0.07, 0.03)

VARIANTS: dict[str, dict[str, Any]] = {
    "heat": {"method": "heat"},
    "thesis": {"method": "thesis"},
    "thesis, p = 3 from the start": {"method": "thesis", "first_penalty": 3.0},
    "thesis, moving asymptotes": {"method": "thesis", "asymptotes": "moving"},
    "thesis, plain transcription": {"method": "thesis", "asymptotes": "moving", "first_penalty": 3.0, "length_term": 0.0},
    "thesis, Formulation 2": {"method": "thesis", "formulation": 2},
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strips", type=int, default=60)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--variant", action="append", choices=VARIANTS, help="only this one; may be repeated")
    options = parser.parse_args()
    print(f"{options.strips} strips\n")
    print(f"{'':<32}{'single line':>12}{'≤ 4 stages':>12}{'iterations':>12}{'cost ÷ optimum':>16}{'worst':>8}{'broke':>7}{'CPU s':>8}")
    for name in options.variant or VARIANTS:
        ratios, single, staged, iterations, broke = [], 0, 0, [], 0
        started = time.process_time()
        for index in range(options.strips):
            rng = np.random.default_rng([options.seed, index])
            length, width = SIZES[rng.choice(len(SIZES), p=SHARES)]
            a, b = crops(PHOTOGRAPHS[index % len(PHOTOGRAPHS)], length, width, rng)
            if index % 2:
                a, b = a.swapaxes(0, 1), b.swapaxes(0, 1)
            try:
                seam = ts.find_seam(a, b, side="bottom" if index % 2 else "right", **VARIANTS[name])
            except SolverError:
                broke += 1
                continue
            done = seam.termination == ts.Termination.SINGLE_LINE
            single += done
            staged += done and seam.history[-1].stage <= 4 and len(seam.history) <= 100
            iterations.append(len(seam.history))
            ratios.append(seam.optimum_ratio())
        n = options.strips
        print(
            f"{name:<32}{single / n:>12.0%}{staged / n:>12.0%}{int(np.median(iterations)):>8}/{max(iterations):<3}"
            f"{np.median(ratios):>16.4f}{max(ratios):>8.3f}{broke:>7}{time.process_time() - started:>8.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
