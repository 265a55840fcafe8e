"""Visibility of the jumps of a loop, and the motion of the camera.

Between neighbours in time and space a loop has steps that neither of the two overlapping stretches has. The
excess of each step is divided by the stretches' own steps round it, as motion and texture hide much, and
squared. The verdict is the 99th percentile of the means over small squares. In levelled loops the added light
counts as well, relative to the contrast round it: a form that lies faintly over another one has no steps, but
is visible.
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

#: Longer side, px at most, of the reduced frames that are judged.
_MAX_SIDE = 256
#: Steps, and added light, that even surroundings hide, as shares of white: added to the denominators.
_HIDDEN_STEP, _HIDDEN_LIGHT = 0.02, 0.1
#: Side of the squares, in reduced px, and the percentile of their means that is the verdict.
_SQUARE, _WORST_PERCENTILE = 8, 99
#: Values of steps and of added light that are just visible; the verdict is in these units.
_VISIBLE_STEPS, _VISIBLE_LIGHT = 2.0, 1.75
#: Side, in reduced px, of the window over which contrast is averaged, and its weight against added light.
_CONTRAST_SIDE, _CONTRAST_WEIGHT = 9, 4.0
#: Number of pairs of moments, about, by which a motion of the camera is tested.
_PAIRS = 16
#: Share of edges that stand still, up to which the camera surely moves, and up to which it may.
_FEWEST_STILL, _FEW_STILL = 0.14, 0.25
#: In the latter case, least ratio of the edges that fit after a shift of the whole frame to those without.
_MIN_SHIFT_GAIN = 1.5
#: Least share of pairs that are shifted by 1 px or more, and least motion in all, as a share of the frame.
_MIN_SHIFTED, _MIN_MOTION = 0.8, 0.05
#: Shorter side, px, of the smallest frames in which a motion of the camera can be measured.
_MIN_CAMERA_SIDE = 16
#: Quantile of the steepness above which pixels are edges, and its least value, as a share of white per px. An
#: edge stands still if it changes by less than half its steepness.
_EDGE_QUANTILE, _MIN_STEEPNESS = 0.7, 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopVerdict:
    """Visibility of the jumps of a loop.

    Examples
    --------
    >>> str(LoopVerdict(shows=0.4, frame=3)), str(LoopVerdict(shows=2.5, frame=12))
    ('will not be seen', 'look at frame 12')
    """

    #: Visibility of the worst hundredth, in units of what is just visible.
    shows: float
    #: Number of the loop's frame with the largest visibility.
    frame: int
    #: Range, px across and down, over which the whole picture moves in the clip, as by a camera; or None.
    moved: tuple[int, int] | None = None

    @property
    def unseen(self) -> bool:
        """True if the jumps will probably not be noticed."""
        return self.shows <= 1

    def __str__(self) -> str:
        return "will not be seen" if self.unseen else f"look at frame {self.frame}"

    def summary(self) -> dict[str, Any]:
        """Return the verdict as values for JSON."""
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
        The jumps in order; the first one's transition begins with the loop.
    labels : mapping from Jump to (D, H, W) bool arrays
        True where the entered stretch shows, within each transition.
    moving : (H, W) bool array
        False on pixels that stand still.
    data_range : float or None
    """
    side = max(1, -(-max(clip.shape[1:3]) // _MAX_SIDE))
    shows, worst, at = 0.0, 0, 0
    judged: dict[Jump, npt.NDArray[np.float64]] = {}
    for jump, after in zip(jumps, [*jumps[1:], jumps[0]], strict=True):
        depth = len(labels[jump])
        if jump not in judged:
            stretches = (made[at:], clip[jump.leaves :], clip[jump.enters :])
            there = _reduced(labels[jump][..., np.newaxis].astype(np.float32), side, 1.0)[..., 0] > 0.5
            one, a, b = (_reduced(values[:depth], side, data_range) for values in stretches)
            on = _reduced(moving[np.newaxis, ..., np.newaxis].astype(np.float32), side, 1.0)[0, ..., 0]
            judged[jump] = _frame_visibility(one, a, b, there, on > 0.5)
        found = judged[jump]
        if found.max() > shows:
            shows, worst = float(found.max()), at + int(found.argmax())
        at += after.leaves - jump.enters
    return LoopVerdict(shows=shows, frame=worst, moved=camera_motion(clip, data_range))


def step_visibility(made: Floats32, a: Floats32, b: Floats32) -> Floats32:
    """Compute the visibility of each pixel's steps, (D, h, w).

    It is the sum over the axes of the squared excess over the stretches' own steps, relative to those nearby.
    """
    found = np.zeros(made.shape[:3], np.float32)
    for axis in range(3):
        step, one, other = (
            np.diff(values, axis=axis, append=values.take([-1], axis)) for values in (made, a, b)
        )
        beyond = np.minimum(_norm(step - one), _norm(step - other))
        own = ndimage.uniform_filter(np.maximum(_norm(one), _norm(other)), (1, 5, 5))
        found += np.square(beyond / (own + _HIDDEN_STEP))
    return found


def worst_squares(values: Floats32, square: int, on: Mask | None = None) -> npt.NDArray[np.float64]:
    """Compute the value of the worst squares in each frame, (D,), scaled to the 99th percentile of all."""
    square = min(square, *values.shape[1:])
    height, width = (length // square * square for length in values.shape[1:])
    if on is not None:
        values = values * on
    squares = values[:, :height, :width].reshape(
        len(values), height // square, square, width // square, square
    )
    means = squares.mean(axis=(2, 4), dtype=np.float64).reshape(len(values), -1)
    level, top = np.percentile(means, _WORST_PERCENTILE), np.percentile(means, _WORST_PERCENTILE, axis=1)
    found: npt.NDArray[np.float64] = top * (level / max(float(top.max()), 1e-12))
    return found


def camera_motion(clip: Volume, data_range: float | None) -> tuple[int, int] | None:
    """Measure the range over which the whole picture moves, px across and down; None if it stands still."""
    side = max(1, -(-max(clip.shape[1:3]) // _MAX_SIDE))
    if min(clip.shape[1:3]) < _MIN_CAMERA_SIDE:
        return None
    lag = max(1, len(clip) // _PAIRS)
    still: list[float] = []
    together: list[float] = []
    shifts: list[npt.NDArray[np.float64]] = []
    for one, other in _pairs(clip, lag, side, data_range):
        steep = _steepness(one, (0, 1))
        edges = steep > max(_MIN_STEEPNESS, float(np.quantile(steep, _EDGE_QUANTILE)))
        if edges.any():
            shift = phase_cross_correlation(one, other, upsample_factor=2, normalization=None)  # type: ignore[no-untyped-call]
            shifts.append(shift[0])
            again = np.roll(other, np.round(shift[0]).astype(int).tolist(), axis=(0, 1))
            for found, moment in ((still, other), (together, again)):
                found.append(float((np.abs(moment - one) < steep / 2)[edges].mean()))
    if len(shifts) < 3:
        return None
    stands, shifted = float(np.mean(still)), float(np.mean(together))
    if stands > _FEWEST_STILL and (stands > _FEW_STILL or shifted < _MIN_SHIFT_GAIN * stands):
        return None
    path = np.cumsum([np.zeros(2), *shifts], axis=0)
    far = np.ptp(path, axis=0) / (np.array(clip.shape[1:3]) / side)
    if (np.abs(shifts).max(axis=1) >= 1).mean() < _MIN_SHIFTED or far.max() < _MIN_MOTION:
        return None
    down, right = (side * np.ptp(path, axis=0)).round().astype(int).tolist()
    return right, down


def _pairs(
    clip: Volume, lag: int, side: int, data_range: float | None
) -> Iterator[tuple[Floats32, Floats32]]:
    """Yield pairs of moments `lag` frames apart, as gray, reduced and slightly blurred frames."""
    before: Floats32 | None = None
    for first in range(0, len(clip), lag):
        gray = _reduced(clip[first : first + 1], side, data_range)[0].mean(axis=2)
        after: Floats32 = ndimage.gaussian_filter(gray, 1)
        if before is not None:
            yield before, after
        before = after


def _frame_visibility(
    made: Floats32, a: Floats32, b: Floats32, there: Mask, on: Mask
) -> npt.NDArray[np.float64]:
    """Compute the visibility of each frame of a transition, in units of what is just visible."""
    seen = worst_squares(step_visibility(made, a, b), _SQUARE, on) / _VISIBLE_STEPS
    added = _norm(made - np.where(there[..., np.newaxis], b, a))
    # A reduced pixel that mixes both stretches differs from each.
    added[ndimage.binary_dilation(there) & ndimage.binary_dilation(~there)] = 0
    contrast = _steepness(a.mean(axis=3), (1, 2))
    around = ndimage.uniform_filter(contrast, (1, _CONTRAST_SIDE, _CONTRAST_SIDE))
    light = worst_squares(added / (_CONTRAST_WEIGHT * around + _HIDDEN_LIGHT), _SQUARE, on) / _VISIBLE_LIGHT
    return np.maximum(seen, light)


def _reduced(values: Volume, side: int, data_range: float | None) -> Floats32:
    """Reduce frames by means over squares of pixels, as shares of white."""
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
