"""The cheapest seam that crosses every row once, by dynamic programming (Efros and Freeman 2001,
doi:10.1145/383259.383296).
"""

from __future__ import annotations

import numpy as np

from toposeam.arrays import AnyInts, Floats, Mask
from toposeam.errors import OverlapError
from toposeam.seam.problem.overlap import FREE, A, B
from toposeam.seam.problem.seam_problem import SeamProblem


def dp_labels(problem: SeamProblem) -> Mask:
    """Find the labelling cut by the cheapest monotone seam, (h, w) bool.

    The seam takes one interface per row (column) and moves by at most one pixel from a row to the next; both
    the interfaces it runs along and those it steps over count. Where the two sides leave only one place, that
    place is taken.

    Raises
    ------
    OverlapError
        When the overlap is not a rectangle between the two patches.
    """
    side = problem.overlap.side
    rows, columns = np.nonzero(problem.overlap.shared)
    box = side[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    window = (slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1))
    right = problem.right[window[0], window[1].start : window[1].stop - 1]
    down = problem.down[window[0].start : window[0].stop - 1, window[1]]
    labels = np.zeros(side.shape, bool)
    for transpose in (False, True):
        turned = box.T if transpose else box
        for first, last in ((A, B), (B, A)):
            if (
                (turned[:, 0] == first).all()
                and (turned[:, -1] == last).all()
                and (turned[:, 1:-1] == FREE).all()
            ):
                crossing, stepping = (down.T, right.T) if transpose else (right, down)
                cut = _cheapest_crossings(crossing.astype(np.float64), stepping.astype(np.float64))
                beyond = np.arange(turned.shape[1])[np.newaxis, :] > cut[:, np.newaxis]
                result = beyond if last == B else ~beyond
                labels[window] = result.T if transpose else result
                return labels
    raise OverlapError(
        "method dp handles only rectangular overlaps with the {patches} on opposite "
        "sides; use heat for this shape",
        kind="not side by side",
    )


def _cheapest_crossings(crossing: Floats, stepping: Floats) -> AnyInts:
    """Find the cheapest path through all rows: for each row the x of the interface (x, x + 1) it crosses.

    `crossing` holds the (m, n - 1) costs of these interfaces, `stepping` the (m - 1, n) costs between rows.
    """
    m, n = crossing.shape
    best = crossing.copy()
    came = np.zeros((m, n), np.int8)
    for row in range(1, m):
        above, step = best[row - 1], stepping[row - 1]
        options = np.full((3, n), np.inf)
        options[0, 1:] = above[:-1] + step[1:-1]
        options[1] = above
        options[2, :-1] = above[1:] + step[1:-1]
        came[row] = options.argmin(axis=0) - 1
        best[row] += options.min(axis=0)
    cut = np.empty(m, np.intp)
    cut[-1] = best[-1].argmin()
    for row in range(m - 1, 0, -1):
        cut[row - 1] = cut[row] + came[row, cut[row]]
    return cut
