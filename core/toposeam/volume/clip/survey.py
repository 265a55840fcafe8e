"""The survey of a clip: one pass over its frames, after which only those of transitions are read again."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats32
from toposeam.volume.clip.frames import ClipFrames, reduced_shares

#: Sizes, px a frame, about: small frames on which all moments are compared, and the largest number of values
#: compared, frames² × px; frames of a middle size, on which loops are tried.
_PIXELS, _MAX_COMPARED, _MIDDLE_PIXELS = 1500, 4e8, 3600
#: Frames of long clips have fewer px each, so that all have about so many, but at least so many each.
_MOST_PIXELS, _LEAST_PIXELS = 2e7, 100.0
#: Longer side, px at most, and number of the moments that tell what comes and goes, and the camera's motion.
_MAX_SIDE, _MOMENTS = 320, 200
#: Standard deviation, as a share of the longer side, of what is slow light, which patches are without.
_SLOW = 0.1
#: Mean step between frames that is a cut: as a multiple of the median, and as a share of white at least; the
#: step of frames that are shown twice.
_CUT_STEPS, _LEAST_CUT, _REPEATED = 5.0, 0.04, 0.002


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Survey:
    """What is known of a clip, or of a shot of it, without its frames."""

    #: Number of its first frame in the clip.
    first: int
    #: (T, h, w, C): small frames, as shares of white.
    small: Floats32
    #: (T, h, w, C): frames of a middle size, on which loops are tried; and the side of their squares on the
    #: working size.
    middle: Floats32
    middle_side: int
    #: (T, h, w): the same, gray and without slow light, in which patches are looked for.
    gray: Floats32
    #: (N, h, w, C) uint8: moments, `lag` frames apart, of at most 320 px; and the side of their squares on
    #: the working size.
    moments: npt.NDArray[np.uint8]
    lag: int
    moment_side: int
    #: (h, w, C): least and greatest share of white in every square of the working size; the squares' side.
    low: Floats32
    high: Floats32
    side: int

    def part(self, first: int, last: int) -> Survey:
        """Return the survey of frames `first` to ``last - 1``."""
        moments = self.moments[-(-first // self.lag) : -(-last // self.lag)]
        return replace(
            self,
            first=self.first + first,
            small=self.small[first:last],
            middle=self.middle[first:last],
            gray=self.gray[first:last],
            moments=moments,
        )

    def shots(self) -> list[tuple[int, int]]:
        """Find the shots between cuts: number of the first frame of each, and of the first one after it."""
        return cuts_of(self.small)


def cuts_of(small: Floats32) -> list[tuple[int, int]]:
    """Find the shots of small frames, (T, h, w, C)."""
    steps = np.abs(np.diff(small, axis=0)).mean(axis=(1, 2, 3))
    # Of clips that show frames twice half of the steps are none; if all others are large, pictures stand
    # between cuts: larger than where a lamp is lit.
    moved = steps[steps > _REPEATED]
    large = 3 * _LEAST_CUT
    stands = 2 * len(moved) < len(steps) and bool((moved > large).all())
    least = large if stands else max(_LEAST_CUT, _CUT_STEPS * float(np.median(moved)))
    cuts = [0, *(np.flatnonzero(steps > least) + 1).tolist(), len(small)]
    return list(itertools.pairwise(cuts))


def survey_of(
    clip: ClipFrames, side: int, data_range: float | None, progress: Callable[[float], None] | None
) -> Survey:
    """Read all frames of a clip once.

    Parameters
    ----------
    clip : ClipFrames
    side : int
        Side of the squares of the working size, px.
    data_range : float or None
    progress : callable, optional
        Called with the share of the frames read, in [0, 1].
    """
    count, height, width = clip.shape[:3]
    rows, columns = height // side, width // side
    small_side = _side(height, width, min(_PIXELS, max(_LEAST_PIXELS, _MAX_COMPARED / count**2)))
    middle_side = _side(rows, columns, min(_MIDDLE_PIXELS, max(_LEAST_PIXELS, _MOST_PIXELS / count)))
    lag = max(1, count // _MOMENTS)
    moment_side = min(max(1, -(-max(rows, columns) // _MAX_SIDE)), rows, columns)
    small, middle, moments = [], [], []
    low = high = np.zeros(0, np.float32)
    for start, stop in clip.ranges(0, count):
        frames = clip.part(start, stop)
        work = reduced_shares(frames, side, data_range)
        small.append(reduced_shares(frames, small_side, data_range))
        middle.append(reduced_shares(work, middle_side, None))
        chosen = work[-start % lag :: lag]
        if len(chosen):
            shown = reduced_shares(chosen, moment_side, None)
            moments.append(np.rint(np.clip(shown, 0, 1) * 255).astype(np.uint8))
        bottom, top = work.min(axis=0), work.max(axis=0)
        low, high = (bottom, top) if start == 0 else (np.minimum(low, bottom), np.maximum(high, top))
        if progress is not None:
            progress(stop / count)
    every = np.concatenate(middle)
    return Survey(
        first=0,
        small=np.concatenate(small),
        middle=every,
        middle_side=middle_side,
        gray=without_slow_light(every.mean(axis=3)),
        moments=np.concatenate(moments),
        lag=lag,
        moment_side=moment_side,
        low=ndimage.minimum_filter(low, (3, 3, 1)),
        high=ndimage.maximum_filter(high, (3, 3, 1)),
        side=side,
    )


def without_slow_light(gray: Floats32) -> Floats32:
    """Take slow light out of (T, h, w) frames."""
    reach = _SLOW * max(gray.shape[1:])
    result: Floats32 = gray - ndimage.gaussian_filter(gray, (0, reach, reach), mode="nearest")
    return result


def _side(height: int, width: int, pixels: float) -> int:
    """Return the side of squares of which a frame has about so many."""
    return min(max(1, math.ceil(math.sqrt(height * width / pixels))), height, width)
