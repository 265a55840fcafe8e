"""What a seam costs that is best by another power of the match cost (docs/theorem.md).

    python benchmarks/currencies.py [--strips 24] [--seed 100]

The dissertation weighs elements by M², and its penalty p = 3 turns that into M^1.5; a seam costs Σ M. Of each
power the path of least cost is found exactly, and priced in each other one.
"""

from __future__ import annotations

import argparse

import numpy as np

from seam_pairs import pair
from stamp import stamp
from toposeam.seam.exact.optimum import exact_labels
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.seam.problem.posing import seam_problem
from toposeam.seam.problem.seam_problem import SeamProblem

POWERS = (1.0, 1.5, 2.0)
SIZES = ((80, 20), (60, 15), (40, 10))


def priced(length: int, width: int, index: int, seed: int) -> np.ndarray:
    """(3, 3): the best path of each power, in each power, ÷ the least."""
    a, b = pair(length, width, index, seed)
    problem = seam_problem(a, b, None, None, "right", MatchCost(law="gradient"))[0]
    problems = [SeamProblem(problem.overlap, problem.right**power, problem.down**power) for power in POWERS]
    labels = [exact_labels(one) for one in problems]
    costs = np.array([[one.cost(found) for one in problems] for found in labels])
    return costs / np.diag(costs)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--strips", type=int, default=24)
    parser.add_argument("--seed", type=int, default=100)
    options = parser.parse_args()
    print(stamp())
    ratios = np.array(
        [priced(*SIZES[index % 3], index, options.seed + index) for index in range(options.strips)]
    )
    print("best by     ÷ least Σ M      ÷ least Σ M^1.5    ÷ least Σ M²      (median, worst)")
    for row, power in enumerate(POWERS):
        found = "    ".join(
            f"{np.median(ratios[:, row, column]):7.4f} {ratios[:, row, column].max():6.3f}"
            for column in range(3)
        )
        print(f"Σ M^{power:<6g}{found}")


if __name__ == "__main__":
    main()
