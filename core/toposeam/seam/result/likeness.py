"""The verdict on a seam, from the two pictures: for seams of any law of the match cost, or any method."""

from __future__ import annotations

import numpy.typing as npt

from toposeam.checks import check_kind
from toposeam.errors import OptionError
from toposeam.images import as_array
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.seam.problem.posing import costs_on
from toposeam.seam.problem.seam_problem import SeamProblem
from toposeam.seam.result.seam import Seam
from toposeam.seam.result.verdict import Verdict, verdict_of


def seam_verdict(
    seam: Seam, a: npt.ArrayLike, b: npt.ArrayLike, *, data_range: float | None = None
) -> Verdict:
    """Judge how likely a seam is to be seen, by the law "natural", even if another law found it.

    Parameters
    ----------
    seam : Seam
    a, b : (H, W) or (H, W, C) array_like
        The patches on the seam's canvas.
    data_range : float, optional
        As for :func:`toposeam.find_seam`.

    Returns
    -------
    Verdict
        Likenesses are 1 without a seam.

    Raises
    ------
    OptionError
        When the patches have not the size of the seam's canvas.
    ImageError

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a = np.random.default_rng(0).random((20, 16))
    >>> str(ts.seam.seam_verdict(ts.find_seam(a, a, gradient=True), a, a))
    'no visible seam'
    """
    check_kind("seam", seam, Seam, "a Seam")
    a, b = as_array(a, "a"), as_array(b, "b")
    overlap = seam.problem.overlap
    if not a.shape[:2] == b.shape[:2] == overlap.canvas:
        raise OptionError(
            "{a} has shape {shape_a!s}, {b} {shape_b!s} and the seam's canvas {canvas!s}; "
            "pass the pictures it was found in",
            kind="shape",
            shape_a=a.shape[:2],
            shape_b=b.shape[:2],
            canvas=overlap.canvas,
        )
    costs = costs_on(a, b, overlap, overlap.shared, overlap.shared, MatchCost(), None, data_range)
    return verdict_of(*SeamProblem(overlap, *costs).crossings(overlap.window(seam.labels).astype(bool)))
