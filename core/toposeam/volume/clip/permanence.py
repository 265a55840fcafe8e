"""Things of a loop that appear or vanish in the picture, as none does in its clip.

What moves before a calm ground is found by its difference from the median of the clip. While nothing
appears or vanishes, the foreground of one frame can be carried to that of a later one, each pixel by no more
than some reach. By Hall's theorem ("On representatives of subsets", J. London Math. Soc. 1935) that is
possible only if no set of places holds more foreground than the widened set holds in the other frame. The
sets that are tried are squares; how much more they hold is the area of what is missing, however slowly it
dissolves. It is compared with the area that is missing thereabouts in the clip, where things go behind
others, and with the foreground that is usual there, as in water.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats32, Mask
from toposeam.volume.clip.coherence import MOMENTS

#: Reach of what moves, and of "thereabouts", as a share of the longer side.
_REACH = 0.05
#: Frames between the two that are compared, about; successive ones are compared, too.
_APART = 4
#: Least difference from the ground that is foreground, as a share of white and as a multiple of the median.
_LEAST_DIFFERENCE, _USUAL_DIFFERENCE = 0.06, 5.0
#: Area that nobody misses, as a share of the frame.
_UNSEEN = 3e-4


def missing(
    made: Floats32, moments: npt.NDArray[np.uint8], lag: int, moving: Mask
) -> tuple[float, int, tuple[float, float]]:
    """Find what appears or vanishes in a transition.

    Parameters
    ----------
    made : (D + 2, h, w, C) float32 array
        The frame before the transition, its D frames and the one after it, as shares of white.
    moments : (N, h, w, C) uint8 array
        Frames of the clip, `lag` frames apart.
    lag : int
    moving : (h, w) bool array
        False on pixels that stand still.

    Returns
    -------
    area : float
        Greatest area that is missing, as a multiple of what is usual there.
    frame : int
        Number of the frame of `made` about which it appears or vanishes.
    where : (float, float)
        Its row and column, as shares of the frame's height and width.
    """
    ground = np.median(moments[:: max(1, len(moments) // MOMENTS)], axis=0).astype(np.float32) / 255
    apart = np.stack([_apart(moment.astype(np.float32) / 255, ground) for moment in moments])
    usual = ndimage.maximum_filter(np.median(apart, axis=0), 3)
    level = np.where(moving, np.maximum(_LEAST_DIFFERENCE, _USUAL_DIFFERENCE * usual), np.inf)
    clip = _sums(apart > level)
    loop = _sums(np.stack([_apart(frame, ground) for frame in made]) > level)
    height, width = moving.shape
    reach = max(1, round(_REACH * max(height, width)))
    worst = (0.0, 0, (0.5, 0.5))
    for frames in {1, max(1, round(_APART / lag))}:
        if len(moments) <= frames or len(made) <= frames * lag:
            continue
        for side in (max(1, reach // 2), reach, 2 * reach):
            step = max(1, side // 4)
            rows, columns = (np.arange(reach, size - side - reach + 1, step) for size in (height, width))
            if not len(rows) or not len(columns):
                continue
            held = np.median(_held(clip, rows, columns, side, 0), axis=0)
            about = 2 * round(reach / step) + 1
            own = [less.max(axis=0) for _, less in _losses(clip, frames, rows, columns, side, reach)]
            known = (
                ndimage.maximum_filter(np.maximum(own[0], own[1]), about) + held + _UNSEEN * height * width
            )
            for at, less in _losses(loop, frames * lag, rows, columns, side, reach):
                share = less / known
                place = np.unravel_index(int(share.argmax()), share.shape)
                where = ((rows[place[1]] + side / 2) / height, (columns[place[2]] + side / 2) / width)
                worst = max(worst, (float(share[place]), int(place[0]) + at, where))
    return worst


def _apart(frame: Floats32, ground: Floats32) -> Floats32:
    """Compute the difference of an (h, w, C) frame from the ground."""
    result: Floats32 = np.sqrt(np.square(frame - ground).mean(axis=2))
    return result


def _sums(foreground: Mask) -> npt.NDArray[np.int32]:
    """Sum (T, h, w) masks from the first row and column on, (T, h + 1, w + 1)."""
    sums = np.zeros((len(foreground), foreground.shape[1] + 1, foreground.shape[2] + 1), np.int32)
    np.cumsum(foreground, axis=1, dtype=np.int32, out=sums[:, 1:, 1:])
    np.cumsum(sums[:, 1:, 1:], axis=2, out=sums[:, 1:, 1:])
    return sums


def _held(
    sums: npt.NDArray[np.int32],
    rows: npt.NDArray[np.int_],
    columns: npt.NDArray[np.int_],
    side: int,
    reach: int,
) -> npt.NDArray[np.int32]:
    """Return the foreground in squares that are widened by a reach."""
    low, high = sums[:, rows - reach], sums[:, rows + side + reach]
    rows_of = high - low
    held: npt.NDArray[np.int32] = rows_of[:, :, columns + side + reach] - rows_of[:, :, columns - reach]
    return held


def _losses(
    sums: npt.NDArray[np.int32],
    frames: int,
    rows: npt.NDArray[np.int_],
    columns: npt.NDArray[np.int_],
    side: int,
    reach: int,
) -> Iterator[tuple[int, npt.NDArray[np.int32]]]:
    """Yield the foreground that squares lose within some frames, and that they win; and the middle frame."""
    held, wide = (_held(sums, rows, columns, side, more) for more in (0, reach))
    yield frames // 2, np.maximum(held[:-frames] - wide[frames:], 0)
    yield frames - frames // 2, np.maximum(held[frames:] - wide[:-frames], 0)
