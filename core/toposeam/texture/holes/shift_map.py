"""A hole as a stitching problem: the layers are copies of the picture, each shifted as a whole; which shows
where is found by expansion moves, each a minimum cut, coarse to fine.

Every pixel of the hole, and of a band round it, gets one shift (a shift-map: Pritch et al. 2009,
doi:10.1109/ICCV.2009.5459159); beyond, the picture shows itself, which is shift 0. A shift-map costs

    Σ_(p,q) |I(p + s_p) - I(p + s_q)| + |I(q + s_p) - I(q + s_q)|  +  Σ_p λ |D(p + s_p) - D̄(p)|

over neighbours p and q: the match cost of the seams, and a data term. D are the features of the picture at a
pixel, and D̄ those expected there from the surroundings of the hole
(:mod:`toposeam.texture.holes.expectation`). So a smooth sky is continued, a horizon stays level, and no
object appears that was not there. The first term is a metric, so letting one shift expand over all others is
a minimum cut (:mod:`toposeam.seam.exact.expansion` derives it).

Coarse to fine: at stride f every f-th pixel of the picture blurred over f pixels stands for f × f, but shifts
stay exact to the pixel. A finer stride decides again only near the seams of the coarser one, and not at all
where that is much.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from toposeam.arrays import Indices, Ints32
from toposeam.seam.find import Method
from toposeam.texture.canvas.progress import stage
from toposeam.texture.holes.expectation import expectation
from toposeam.texture.holes.shift_map_moves import Ground, ShiftMoves

#: Largest number of pixels at the coarsest stride: there all shifts are tried.
_COARSEST_PIXELS = 1500
#: Largest number of pixels near the seams that are decided again at a finer stride; where there are more,
#: seams stay as the coarser stride has them.
_MOST_FREE = 150_000
#: Largest number of sweeps over all shifts at the coarsest stride, and over those that show at finer ones.
_SWEEPS, _FINE_SWEEPS = 3, 1


def shift_map(
    ground: Ground, shifts: Indices, method: Method, progress: Callable[[float], None] | None = None
) -> Ints32:
    """Find the shift of every pixel that costs least.

    Parameters
    ----------
    ground : Ground
    shifts : (K, 2) int array
    method : str
        Method by which seams are found.
    progress : callable, optional
        Called with the share of the work done.

    Returns
    -------
    (H, W) int32 array
        Number of the shift at each pixel; -1 where the picture shows itself, and where nothing is allowed.
    """
    stride = 1
    while np.count_nonzero(ground.near) / stride**2 > _COARSEST_PIXELS:
        stride *= 2
    expected, like = expectation(ground.planes, ground.hole, ground.present)
    rows, columns = (np.flatnonzero(ground.near.any(axis=axis)) for axis in (1, 0))
    box = slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
    first, levels = stride, int(np.log2(stride)) + 1
    label = np.full(ground.near[box].shape, -1, np.int32)
    for level in range(levels):
        report = stage(progress, level / levels, 1 / levels)
        moves = ShiftMoves(ground, shifts, box, stride, expected, like)
        if stride == first:
            moves.begin()
            moves.sweep(range(len(shifts)), _SWEEPS, method, report)
        else:
            moves.refine(label, 2 * stride)
            if np.count_nonzero(moves.free) <= _MOST_FREE:
                moves.sweep(np.unique(moves.label).tolist(), _FINE_SWEEPS, method, report)
            elif report is not None:
                report(1.0)
        label = moves.spread()
        del moves  # a copy of the picture, before the next one is made
        stride //= 2
    result = np.full(ground.hole.shape, -1, np.int32)
    result[box] = label
    return result
