"""Method `auto`: the exact solver that is fastest for the overlap at hand, and heat where none is.

An overlap that one path between corners divides, like a strip or an L, is left to the shortest path
(:mod:`toposeam.seam.exact.optimum`), which is fastest at every size that was measured (docs/heat.md) and
exact up to :data:`PATH_CORNERS`; beyond, it is searched among every other corner first. Rings, islands and
overlaps with several seams are left to a maximum flow (:mod:`toposeam.seam.exact.maximum_flow`) up to
:data:`FLOW_PIXELS`. Beyond, heat takes no longer, and its seam suffers from no rounded capacities.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from toposeam.arrays import Mask
from toposeam.heat.threads import one_thread
from toposeam.seam.exact.optimum import cut_by_flow, exact_labels
from toposeam.seam.problem.seam_problem import SeamProblem, Solution

#: Largest piece, in free pixels, that is cut by maximum flow where no single path divides it; beyond, heat is
#: as fast.
FLOW_PIXELS = 30_000
#: Largest window, in corners, in which a shortest path is searched among all of them at once; in larger ones
#: it is searched near the best path between every other corner.
PATH_CORNERS = 1 << 20


class _TooLargeError(Exception):
    """Raised where more than `FLOW_PIXELS` pixels would have to be cut by maximum flow."""


def best_path(problem: SeamProblem, progress: Callable[[float], None] | None = None) -> Solution:
    """Find the best seam by the solver that suits the overlap.

    Parameters
    ----------
    problem : SeamProblem
    progress : callable, optional
        Called with the share of the work done, in [0, 1].

    Returns
    -------
    Solution
        Its `method` is "shortest-path"; "graph-cut" where a maximum flow cut some of the overlap; or "heat".
        Of the first two `bound` is the cost, or 0 where the window has more than :data:`PATH_CORNERS`, and
        `contracted` is True: heat computes the label potential when it is first read.
    """
    flows: list[Mask] = []

    def flow(problem: SeamProblem, pixels: Mask) -> Mask:
        if np.count_nonzero(pixels) > FLOW_PIXELS:
            raise _TooLargeError
        flows.append(pixels)
        return cut_by_flow(problem, pixels)

    try:
        labels = exact_labels(problem, flow=flow, whole=PATH_CORNERS)
    except _TooLargeError:
        from toposeam.seam.heat.method import HeatOptions, heat_path

        with one_thread():
            return heat_path(problem, HeatOptions(), progress=progress)
    if progress is not None:
        progress(1.0)
    whole = math.prod(size + 1 for size in labels.shape) <= PATH_CORNERS
    return Solution(
        labels=labels,
        soft=labels.astype(np.float32),
        contracted=True,
        method="graph-cut" if flows else "shortest-path",
        bound=problem.total(labels) if whole else 0.0,
    )
