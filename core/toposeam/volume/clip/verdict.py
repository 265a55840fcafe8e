"""How likely it is that the change of a loop is seen, and when; and whether the whole picture moves.

Between neighbours in time and space a loop has steps that neither of the two stretches has which overlap
there. Each is divided by what the stretches have round it themselves (what moves or is busy hides much) and
squared; the worst hundredth of small squares tells. Where steps were levelled, what was added counts as well,
against the contrast round it: a form that lies faintly over another one has no steps, and is seen.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from skimage.registration import phase_cross_correlation

from toposeam.arrays import Floats32, Mask, Volume
from toposeam.volume.clip.period import Jump
from toposeam.volume.problem.arrays import as_shares

#: Frames are judged reduced to at most this many pixels a side.
_SIDE = 256
#: A step is just seen beside steps of this share of white; added light, beside contrasts of the next.
_JUST, _FAINT = 0.02, 0.1
#: Side of the squares, in reduced pixels; of how many of them the worst tells; and from where on it is seen,
#: of steps and of added light.
_SQUARE, _WORST = 8, 99
_SEEN_STEPS, _SEEN_LIGHT = 2.0, 1.75
#: Contrast is taken round pixels as far as this; a pixel's step counts so many times.
_ROUND, _CONTRAST = 9, 4.0
#: Camera: in so many pairs of moments hardly any edges stand still, or few, and so many times as many when
#: the later moment is shifted as a whole; most are shifted, and in the end by so much of the frame.
_PAIRS, _HARDLY, _FEW, _TIMES, _MOST, _FAR = 16, 0.14, 0.25, 1.5, 0.8, 0.05
#: Smaller frames tell nothing of it.
_SMALLEST = 16
#: Edges are the steepest of these, and at least so steep; they stand still if they change by less than half.
_EDGES, _STEEP = 0.7, 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopVerdict:
    """How likely the change of a loop is to be seen.

    Examples
    --------
    >>> str(LoopVerdict(shows=0.4, frame=3)), str(LoopVerdict(shows=2.5, frame=12))
    ('will not be seen', 'look at frame 12')
    """

    #: What shows in the worst hundredth of it, in units of what is just seen.
    shows: float
    #: The loop's frame in which most of it shows.
    frame: int
    #: By how many px, across and down, the whole picture moves in the clip, as by a camera; or None.
    moved: tuple[int, int] | None = None

    @property
    def unseen(self) -> bool:
        """Whether it is likely not to be noticed."""
        return self.shows <= 1

    def __str__(self) -> str:
        return "will not be seen" if self.unseen else f"look at frame {self.frame}"

    def summary(self) -> dict[str, Any]:
        """Return the verdict as JSON has it."""
        return {
            "shows": round(self.shows, 3),
            "look_at_frame": None if self.unseen else self.frame,
            "camera_moved": None if self.moved is None else list(self.moved),
        }


def verdict_of(
    made: Volume,
    clip: Volume,
    jumps: Sequence[Jump],
    labels: Mapping[Jump, Mask],
    moving: Mask,
    data_range: float | None,
) -> LoopVerdict:
    """Judge a loop.

    Parameters
    ----------
    made, clip : (P, H, W, C) and (T, H, W, C) arrays
    jumps : sequence of Jump
        In their order; the first one's transition begins with the loop.
    labels : mapping from Jump to (D, H, W) bool arrays
        Within each transition, where what it enters shows.
    moving : (H, W) bool array
    data_range : float or None
    """
    side = max(1, -(-max(clip.shape[1:3]) // _SIDE))
    shows, worst, at = 0.0, 0, 0
    judged: dict[Jump, npt.NDArray[np.float64]] = {}
    for jump, after in zip(jumps, [*jumps[1:], jumps[0]], strict=True):
        depth = len(labels[jump])
        if jump not in judged:
            stretches = (made[at:], clip[jump.leaves :], clip[jump.enters :])
            there = _reduced(labels[jump][..., np.newaxis].astype(np.float32), side, 1.0)[..., 0] > 0.5
            one, a, b = (_reduced(values[:depth], side, data_range) for values in stretches)
            on = _reduced(moving[np.newaxis, ..., np.newaxis].astype(np.float32), side, 1.0)[0, ..., 0]
            judged[jump] = _shown(one, a, b, there, on > 0.5)
        found = judged[jump]
        if found.max() > shows:
            shows, worst = float(found.max()), at + int(found.argmax())
        at += after.leaves - jump.enters
    return LoopVerdict(shows=shows, frame=worst, moved=camera(clip, data_range))


def steps(made: Floats32, a: Floats32, b: Floats32) -> Floats32:
    """Compute how much each pixel's steps stand out, (D, h, w): the square of what neither stretch has there,
    in units of what they have round it.
    """
    found = np.zeros(made.shape[:3], np.float32)
    for axis in range(3):
        step, one, other = (
            np.diff(values, axis=axis, append=values.take([-1], axis)) for values in (made, a, b)
        )
        beyond = np.minimum(_norm(step - one), _norm(step - other))
        own = ndimage.uniform_filter(np.maximum(_norm(one), _norm(other)), (1, 5, 5))
        found += np.square(beyond / (own + _JUST))
    return found


def worst_of(values: Floats32, square: int, on: Mask | None = None) -> npt.NDArray[np.float64]:
    """Compute, frame by frame, what the worst of small squares have in the mean: (D,)."""
    square = min(square, *values.shape[1:])
    height, width = (length // square * square for length in values.shape[1:])
    if on is not None:
        values = values * on
    squares = values[:, :height, :width].reshape(
        len(values), height // square, square, width // square, square
    )
    means = squares.mean(axis=(2, 4), dtype=np.float64).reshape(len(values), -1)
    level, top = np.percentile(means, _WORST), np.percentile(means, _WORST, axis=1)
    found: npt.NDArray[np.float64] = top * (level / max(float(top.max()), 1e-12))
    return found


def camera(clip: Volume, data_range: float | None) -> tuple[int, int] | None:
    """Find by how much the whole picture moves, px across and down; None where it stands still."""
    side = max(1, -(-max(clip.shape[1:3]) // _SIDE))
    if min(clip.shape[1:3]) < _SMALLEST:
        return None
    lag = max(1, len(clip) // _PAIRS)
    still: list[float] = []
    together: list[float] = []
    shifts: list[npt.NDArray[np.float64]] = []
    for one, other in _pairs(clip, lag, side, data_range):
        steep = _steepness(one, (0, 1))
        edges = steep > max(_STEEP, float(np.quantile(steep, _EDGES)))
        if edges.any():
            shift = phase_cross_correlation(one, other, upsample_factor=2, normalization=None)  # type: ignore[no-untyped-call]
            shifts.append(shift[0])
            again = np.roll(other, np.round(shift[0]).astype(int).tolist(), axis=(0, 1))
            for found, moment in ((still, other), (together, again)):
                found.append(float((np.abs(moment - one) < steep / 2)[edges].mean()))
    if len(shifts) < 3:
        return None
    stands, shifted = float(np.mean(still)), float(np.mean(together))
    if stands > _HARDLY and (stands > _FEW or shifted < _TIMES * stands):
        return None
    path = np.cumsum([np.zeros(2), *shifts], axis=0)
    far = np.ptp(path, axis=0) / (np.array(clip.shape[1:3]) / side)
    if (np.abs(shifts).max(axis=1) >= 1).mean() < _MOST or far.max() < _FAR:
        return None
    down, right = (side * np.ptp(path, axis=0)).round().astype(int).tolist()
    return right, down


def _pairs(
    clip: Volume, lag: int, side: int, data_range: float | None
) -> Iterator[tuple[Floats32, Floats32]]:
    """Return moments of a clip, gray, reduced and a little blurred, each with a later one."""
    before: Floats32 | None = None
    for first in range(0, len(clip), lag):
        gray = _reduced(clip[first : first + 1], side, data_range)[0].mean(axis=2)
        after: Floats32 = ndimage.gaussian_filter(gray, 1)
        if before is not None:
            yield before, after
        before = after


def _shown(made: Floats32, a: Floats32, b: Floats32, there: Mask, on: Mask) -> npt.NDArray[np.float64]:
    """Compute what shows in each frame of a transition, in units of what is just seen."""
    seen = worst_of(steps(made, a, b), _SQUARE, on) / _SEEN_STEPS
    added = _norm(made - np.where(there[..., np.newaxis], b, a))
    # Where a reduced pixel holds some of either, it differs from both.
    added[ndimage.binary_dilation(there) & ndimage.binary_dilation(~there)] = 0
    contrast = _steepness(a.mean(axis=3), (1, 2))
    around = ndimage.uniform_filter(contrast, (1, _ROUND, _ROUND))
    light = worst_of(added / (_CONTRAST * around + _FAINT), _SQUARE, on) / _SEEN_LIGHT
    return np.maximum(seen, light)


def _reduced(values: Volume, side: int, data_range: float | None) -> Floats32:
    """Return frames as means over squares of pixels, shares of white."""
    shares = as_shares(values, "frames", data_range)
    height, width = (length // side * side for length in shares.shape[1:3])
    squares = shares[:, :height, :width].reshape(
        len(shares), height // side, side, width // side, side, shares.shape[3]
    )
    result: Floats32 = squares.mean(axis=(2, 4), dtype=np.float32)
    return result


def _steepness(gray: Floats32, axes: tuple[int, int]) -> Floats32:
    """Compute the length of the gradient along two axes."""
    slopes = (ndimage.correlate1d(gray, [-0.5, 0, 0.5], axis=axis, mode="nearest") for axis in axes)
    result: Floats32 = np.hypot(*slopes)
    return result


def _norm(values: Floats32) -> Floats32:
    result: Floats32 = np.sqrt(np.square(values).sum(axis=3))
    return result
