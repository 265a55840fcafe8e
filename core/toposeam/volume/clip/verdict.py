"""Visibility of the jumps of a loop, and the motion of the camera.

Four things are seen of a change from one stretch to another, the first three computed for every place and
frame of the transition:

*Steps* between neighbours in time and space that neither of the two stretches has. The excess of each is
divided by the stretches' own steps round it, as motion and texture hide much, and squared.

*Strange patches*, of which the clip shows nowhere the like: :mod:`toposeam.volume.clip.coherence`.

*Added light* of levelled loops, relative to the contrast round it: a form that lies faintly over another one
has no steps, but is visible.

*Things that appear or vanish*: :mod:`toposeam.volume.clip.permanence`.

What is seen has an extent and a duration. Each of the first three is the greatest value that some connected
region reaches everywhere whose area times duration is at least a fiftieth of a frame: a head for six frames
counts, a speck does not, however large the rest of the picture may be. The verdict is the largest of the
four.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from skimage.registration import phase_cross_correlation

from toposeam.arrays import Floats32, Mask
from toposeam.volume.clip.coherence import UNSEEN, strangeness
from toposeam.volume.clip.frames import reduced_shares
from toposeam.volume.clip.permanence import missing
from toposeam.volume.clip.survey import Survey, without_slow_light

#: Longer side, px at most, of the reduced frames that are judged, and side of the squares of steps and light.
_MAX_SIDE, _SQUARE = 256, 4
#: Added light that even surroundings hide, as a share of white.
_HIDDEN_LIGHT = 0.1
#: Values of steps, strange patches, added light and missing area that are just visible, the verdict's units.
_VISIBLE_STEPS, _VISIBLE_STRANGE, _VISIBLE_LIGHT, _VISIBLE_MISSING = 5.0, 1.35, 1.75, 1.5
#: Least region that is seen: area × duration, as a share of a frame.
_LEAST_REGION = 0.02
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
    >>> str(LoopVerdict(shows=0.4, frame=3)), str(LoopVerdict(shows=2.5, frame=12, where=(40, 30)))
    ('will not be seen', 'look at frame 12 at 40,30')
    """

    #: Visibility of the region that shows most, in units of what is just visible.
    shows: float
    #: Number of the loop's frame in which it is largest, and its middle there, (x, y) in px.
    frame: int
    where: tuple[int, int] | None = None
    #: Range, px across and down, over which the whole picture moves in the clip, as by a camera; or None.
    moved: tuple[int, int] | None = None

    @property
    def unseen(self) -> bool:
        """True if the jumps will probably not be noticed."""
        return self.shows <= 1

    def __str__(self) -> str:
        if self.unseen:
            return "will not be seen"
        return f"look at frame {self.frame}" + ("" if self.where is None else " at {},{}".format(*self.where))

    def summary(self) -> dict[str, Any]:
        """Return the verdict as values for JSON."""
        return {
            "shows": round(self.shows, 3),
            "look_at_frame": None if self.unseen else self.frame,
            "look_at": None if self.unseen or self.where is None else list(self.where),
            "camera_moved": None if self.moved is None else list(self.moved),
        }


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Transition:
    """A transition of a loop on reduced frames, as shares of white."""

    #: (D + 2, h, w, C): the frame before the transition, its D frames and the one after it.
    made: Floats32
    #: (D, h, w, C): the stretch that is left and the one that is entered; and where the latter shows.
    left: Floats32
    entered: Floats32
    labels: Mask
    #: (h, w): False on pixels that stand still.
    moving: Mask
    #: Numbers of the survey's frames with which the stretches begin.
    leaves: int
    enters: int


def judged(transition: Transition, survey: Survey) -> tuple[float, int, tuple[float, float]]:
    """Judge a transition.

    Returns
    -------
    shows : float
        Its visibility, in units of what is just visible.
    frame : int
        Number of the transition's frame in which it is largest.
    where : (float, float)
        Row and column of its middle there, as shares of the frame's height and width.
    """
    side = min(max(1, -(-max(transition.moving.shape) // _MAX_SIDE)), *transition.moving.shape)
    made, a, b = (
        reduced_shares(part, side, None) for part in (transition.made, transition.left, transition.entered)
    )
    there, on = (
        reduced_shares(part[..., np.newaxis].astype(np.float32), side, None)[..., 0] > 0.5
        for part in (transition.labels, transition.moving[np.newaxis])
    )
    now = made[1:-1]
    steps = _squares(step_visibility(now, a, b) * on)
    added = _norm(now - np.where(there[..., np.newaxis], b, a))
    # A reduced pixel that mixes both stretches differs from each.
    added[ndimage.binary_dilation(there) & ndimage.binary_dilation(~there)] = 0
    contrast = ndimage.uniform_filter(_steepness(a.mean(axis=3), (1, 2)), (1, _CONTRAST_SIDE, _CONTRAST_SIDE))
    light = _squares(added / (_CONTRAST_WEIGHT * contrast + _HIDDEN_LIGHT) * on)
    small = 1 if transition.moving.shape == survey.gray.shape[1:] else survey.middle_side
    gray = reduced_shares(transition.made, small, None).mean(axis=3)
    strange = strangeness(without_slow_light(gray), survey.gray, transition.leaves, transition.enters)
    if not on.all():
        still = transition.moving[np.newaxis, ..., np.newaxis].astype(np.float32)
        strange = strange * (reduced_shares(still, small, None)[..., 0] > 0.5)
    found = [
        _greatest(values, unit)
        for values, unit in (
            (steps, _VISIBLE_STEPS),
            (strange, _VISIBLE_STRANGE),
            (light, _VISIBLE_LIGHT),
        )
    ]
    if transition.moving.shape == survey.low.shape[:2]:  # on smaller frames small things are not seen
        shown, moves = (
            reduced_shares(part, survey.moment_side, None)
            for part in (transition.made, transition.moving[np.newaxis, ..., np.newaxis].astype(np.float32))
        )
        area, at, middle = missing(shown, survey.moments, survey.lag, moves[0, ..., 0] > 0.5)
        found.append((area / _VISIBLE_MISSING, max(at - 1, 0), middle))
    shows, frame, where = max(found)
    return shows, min(frame, len(a) - 1), where


def _greatest(values: Floats32, unit: float) -> tuple[float, int, tuple[float, float]]:
    """Find the greatest value that a connected region of the least size reaches everywhere, and its place."""
    least = max(2.0, _LEAST_REGION * values[0].size) if len(values) > 1 else 1.0
    levels = np.unique(values)
    low, high = 0, len(levels) - 1
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if _largest(values >= levels[middle])[0] >= least else (low, middle - 1)
    region = _largest(values >= levels[low])[1]
    frame = int((values * region).sum(axis=(1, 2)).argmax())
    rows, columns = np.nonzero(region[frame])
    where = ((rows.mean() + 0.5) / values.shape[1], (columns.mean() + 0.5) / values.shape[2])
    return float(levels[low]) / unit, frame, where


def _largest(on: Mask) -> tuple[int, Mask]:
    """Return the size of the largest connected region, and the region."""
    numbers, _ = ndimage.label(on, np.ones((3, 3, 3)))
    sizes = np.bincount(numbers.ravel())
    sizes[0] = 0
    most = int(sizes.argmax())
    return int(sizes[most]), numbers == most


def _squares(values: Floats32) -> Floats32:
    """Average (D, h, w) values over squares."""
    square = min(_SQUARE, *values.shape[1:])
    height, width = (length // square * square for length in values.shape[1:])
    parts = values[:, :height, :width].reshape(len(values), height // square, square, width // square, square)
    means: Floats32 = parts.mean(axis=(2, 4), dtype=np.float32)
    return means


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
        found += np.square(beyond / (own + UNSEEN))
    return found


def camera_motion(survey: Survey, size: tuple[int, int]) -> tuple[int, int] | None:
    """Measure the range over which the whole picture moves, px across and down; None if it stands still.

    Parameters
    ----------
    survey : Survey
    size : (int, int)
        Height and width of the clip's frames, px.
    """
    if min(size) < _MIN_CAMERA_SIDE:
        return None
    still: list[float] = []
    together: list[float] = []
    shifts: list[npt.NDArray[np.float64]] = []
    moments = survey.moments[:: max(1, len(survey.moments) // _PAIRS)].mean(axis=3, dtype=np.float32) / 255
    blurred = [ndimage.gaussian_filter(moment, 1) for moment in moments]
    for one, other in itertools.pairwise(blurred):
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
    side = survey.side * survey.moment_side
    far = np.ptp(path, axis=0) / (np.array(size) / side)
    if (np.abs(shifts).max(axis=1) >= 1).mean() < _MIN_SHIFTED or far.max() < _MIN_MOTION:
        return None
    down, right = (side * np.ptp(path, axis=0)).round().astype(int).tolist()
    return right, down


def _steepness(gray: Floats32, axes: tuple[int, int]) -> Floats32:
    """Compute the length of the gradient along two axes."""
    slopes = (ndimage.correlate1d(gray, [-0.5, 0, 0.5], axis=axis, mode="nearest") for axis in axes)
    result: Floats32 = np.hypot(*slopes)
    return result


def _norm(values: Floats32) -> Floats32:
    result: Floats32 = np.sqrt(np.square(values).sum(axis=3))
    return result
