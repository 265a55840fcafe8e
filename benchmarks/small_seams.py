"""Many small seams, as texture synthesis asks for them: seams a second through `ts.find_seam`, and cost ÷
exact optimum.

    python benchmarks/small_seams.py
    python benchmarks/small_seams.py --seams 500

One process, one BLAS thread. The whole call is counted: overlap, match cost, search and `Seam`. Its median is
compared with PyMaxflow's on the same problems (given their match cost), and with the same call when no shape
is known. The L is a patch of 40 × 40 px laid over what is filled above and to the left of it, 10 px wide.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

import toposeam as ts
from seam_pairs import PHOTOGRAPHS, crops
from stamp import stamp
from toposeam.heat.threads import one_thread
from toposeam.seam.exact.graph_cut import graph_cut_labels
from toposeam.seam.problem import overlap
from toposeam.seam.problem import seam_problem as problem

Masks = tuple[npt.NDArray[np.bool_] | None, npt.NDArray[np.bool_] | None]


def ell(size: int, width: int) -> Masks:
    filled = np.zeros((size, size), bool)
    filled[:width] = filled[:, :width] = True
    return filled, np.ones((size, size), bool)


def forget() -> None:
    overlap._kept_side_by_side.cache_clear()
    overlap._kept_between_masks.cache_clear()
    problem._kept_pattern.cache_clear()


#: name: (height, width, masks)
CASES: dict[str, tuple[int, int, Masks]] = {
    "strip 70 × 10": (70, 10, (None, None)),
    "strip 40 × 10": (40, 10, (None, None)),
    "L 40 × 40, 10 wide": (40, 40, ell(40, 10)),
}


def timed(call: Callable[..., object], *arguments: object) -> float:
    started = time.process_time()
    call(*arguments)
    return time.process_time() - started


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seams", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print(f"{options.seams} seams each\n")
    print(f"{'':<22}{'seams/s':>9}{'÷ PyMaxflow':>13}{'÷ new shape':>13}{'cost ÷ optimum':>16}{'worst':>9}")
    for name, (height, width, masks) in CASES.items():
        known, new, cut, ratios = [], [], [], []
        for index in range(options.seams):
            a, b = crops(
                PHOTOGRAPHS[index % len(PHOTOGRAPHS)],
                height,
                width,
                np.random.default_rng([options.seed, index]),
            )
            forget()
            new.append(timed(ts.find_seam, a, b, *masks))
            known.append(timed(ts.find_seam, a, b, *masks))
            seam = ts.find_seam(a, b, *masks, gradient=True)
            _ = seam.problem.grid
            with one_thread():
                cut.append(timed(graph_cut_labels, seam.problem))
            ratios.append(seam.optimum_ratio())
        middle = float(np.median(known))
        print(
            f"{name:<22}{len(known) / sum(known):>9.0f}{middle / np.median(cut):>13.2f}"
            f"{middle / np.median(new):>13.2f}"
            f"{np.median(ratios):>16.4f}{max(ratios):>9.4f}",
            flush=True,
        )


if __name__ == "__main__":
    print(stamp())
    main()
