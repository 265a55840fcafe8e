"""The labels of a seam and nothing else: for textures, which cut hundreds of small patches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Mask
from toposeam.seam.automatic import FLOW_PIXELS
from toposeam.seam.exact.optimum import cut_by_flow
from toposeam.seam.find import Method, method_options, solve
from toposeam.seam.problem.match_cost import MatchCost, match_cost, match_options
from toposeam.seam.problem.overlap import FREE, between_masks
from toposeam.seam.problem.seam_problem import SeamProblem

if TYPE_CHECKING:
    from toposeam.seam.heat.method import HeatOptions
    from toposeam.seam.thesis.options import ThesisOptions

#: Methods that look for the seam of least cost.
BEST: tuple[Method, ...] = ("auto", "shortest-path")


def decided_by(problem: SeamProblem, method: Method, options: HeatOptions | ThesisOptions | None) -> Mask:
    """Label a problem by a method; where it looks for the best seam of a small overlap, by maximum flow.

    Parameters
    ----------
    problem : SeamProblem
    method, options
        As for :func:`toposeam.seam.find.solve`.
    """
    free = problem.overlap.side == FREE
    if method in BEST and np.count_nonzero(free) <= FLOW_PIXELS:
        return problem.complete(cut_by_flow(problem, free)).astype(bool, copy=False)
    return solve(problem, method, options).labels


def seam_labels(
    a: npt.NDArray[np.float32],
    b: npt.NDArray[np.float32],
    mask_a: Mask,
    mask_b: Mask,
    method: Method = "auto",
    cost: MatchCost | None = None,
    *,
    closed: bool = False,
) -> Mask:
    """Find the labels of :func:`toposeam.find_seam` with ``speck=0``, faster on small overlaps.

    Parameters
    ----------
    a, b : (H, W, C) float32 arrays
        In [0, 1]; their values where they have no pixels do not matter.
    mask_a, mask_b : (H, W) bool arrays
    method, cost
        As for :func:`toposeam.find_seam`.
    closed : bool
        Whether the seam is likely to be closed, so that no path is looked for.

    Returns
    -------
    (H, W) bool array

    Raises
    ------
    OverlapError
        When the masks share no pixel, or nothing divides them.

    Examples
    --------
    >>> a, b = np.random.default_rng(0).random((2, 9, 9, 1)).astype(np.float32)
    >>> columns = np.broadcast_to(np.arange(9), (9, 9))
    >>> labels = seam_labels(a, b, columns < 6, columns > 2)
    >>> labels[:, :4].any(), labels[:, 5:].all()
    (np.False_, np.True_)
    """
    overlap = between_masks(mask_a, mask_b, speck=0)
    on_a, on_b = overlap.window(mask_a), overlap.window(mask_b)
    part_a, part_b = overlap.window(a), overlap.window(b)
    part_a[~on_a], part_b[~on_b] = 0, 0
    right, down = match_cost(part_a, part_b, overlap, on_a, on_b, match_options(None, cost, "gradient"))
    problem = SeamProblem(overlap, right, down)
    labels = decided_by(problem, method, method_options(method, {}))
    found: Mask = problem.on_canvas(labels, mask_b & ~mask_a)
    return found
