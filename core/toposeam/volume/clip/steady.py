"""A camera that trembles: its shift and turn are measured, and taken out of the frames when these are read.

The steep places of one frame, the template, are looked for in every other frame by Gauss-Newton steps on
blurred frames, from much blur to little (Lucas and Kanade 1981; Baker and Matthews, "Lucas-Kanade 20 years
on", IJCV 2004: inverse steps). Weights fall with the square of what does not fit, so that what moves in the
picture counts little. Frames are turned by three shears (Paeth 1986), each a shift of every row or column by
cubic convolution, and cropped to what all of them show.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats, Floats32, Mask, Volume
from toposeam.errors import ImageError
from toposeam.images import in_dtype
from toposeam.volume.clip.frames import ClipFrames, reduced_shares
from toposeam.volume.clip.survey import cuts_of
from toposeam.volume.problem.arrays import as_volume

#: Longer side, px at most, of the frames on which motion is measured, and their bytes in all.
_MAX_SIDE, _MOST_BYTES = 320, 3e8
#: Standard deviations of the blurs, px, from coarse to fine, and Gauss-Newton steps with each.
_BLURS, _STEPS = (6.0, 3.0, 1.2), (8, 6, 8)
#: Share of places that are steep enough, and the largest number that is used.
_STEEP, _MOST_PLACES = 0.3, 12_000
#: Parts into which each side is divided, to choose steep places; share of them that is reliable.
_PARTS, _RELIABLE = 8, 0.5
#: Least scale of differences, as a share of white, that count as unlike.
_LEAST_SCALE = 0.01
#: Range of a corner's motion, px of the frames that are measured, below which the camera stands still.
_STILL = 1.0
#: Least share of the frame that all frames show.
_LEAST_LEFT = 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SteadyFrames:
    """Frames of a clip without the motion of the camera, read by slices."""

    array: Any
    #: (T, 3): shift down and right, px, and turn, radians, from the steady picture to each frame.
    motion: Floats
    #: Point about which frames turn, (y, x); what all frames show: first row, last row + 1, columns alike.
    middle: tuple[float, float]
    crop: tuple[int, int, int, int]

    @property
    def shape(self) -> tuple[int, ...]:
        """Frames, height, width, and channels if there are."""
        top, bottom, left, right = self.crop
        return len(self.motion), bottom - top, right - left, *self.array.shape[3:]

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the values."""
        kind: np.dtype[Any] = np.dtype(self.array.dtype)
        return kind

    @property
    def ranges(self) -> tuple[float, float, float]:
        """Ranges of the motion that was taken out: px across and down, and degrees."""
        down, right, turn = np.ptp(self.motion, axis=0).tolist()
        return right, down, math.degrees(turn)

    def cropped(self, mask: Mask) -> Mask:
        """Crop an (H, W) mask as frames are."""
        top, bottom, left, right = self.crop
        return mask[top:bottom, left:right]

    def __getitem__(self, part: slice) -> Volume:
        """Read frames."""
        top, bottom, left, right = self.crop
        whole = as_volume(self.array[part], "frames")
        made = [
            moved(frame, down, across, turn, self.middle)[top:bottom, left:right]
            for frame, (down, across, turn) in zip(whole, self.motion[part].tolist(), strict=True)
        ]
        result = in_dtype(np.stack(made), whole.dtype)
        return result if len(self.array.shape) == 4 else result[..., 0]


def steadied(
    clip: ClipFrames, data_range: float | None, progress: Callable[[float], None] | None = None
) -> SteadyFrames | None:
    """Take the motion of the camera out of a clip's longest shot; None where it stands still.

    Parameters
    ----------
    clip : ClipFrames
    data_range : float or None
    progress : callable, optional
        Called with the share of the work done, in [0, 1].

    Raises
    ------
    ImageError
        When the camera moves so far that little stays in sight.
    """
    count, height, width = clip.shape[:3]
    most = min(_MAX_SIDE, math.sqrt(_MOST_BYTES / count * max(height, width) / min(height, width)))
    side = min(max(1, math.ceil(max(height, width) / most)), height, width)
    gray = np.concatenate(
        [
            np.rint(255 * np.clip(reduced_shares(part, side, data_range).mean(axis=3), 0, 1)).astype(np.uint8)
            for part in clip.parts(0, count)
        ]
    )
    if min(gray.shape[1:]) < 2:  # px; has no slope across
        return None
    thin = max(1, max(gray.shape[1:]) // 40)
    first, last = max(
        cuts_of(reduced_shares(gray[..., np.newaxis], thin, None)), key=lambda shot: shot[1] - shot[0]
    )
    found = camera_path(gray[first:last], progress)
    found[:, :2] *= side
    ranges = np.ptp(found, axis=0)
    if ranges[:2].max() + ranges[2] * math.hypot(height, width) / 2 < _STILL * side:
        return None
    motion = np.zeros((count, 3))
    motion[first:last] = found
    middle = tuple(side * length / 2 - 0.5 for length in gray.shape[1:])
    crop = _common((height, width), found, (middle[0], middle[1]))
    top, bottom, left, right = crop
    share = max(bottom - top, 0) * max(right - left, 0) / (height * width)
    if share < _LEAST_LEFT or min(bottom - top, right - left) < 2:
        raise ImageError(
            "the camera moves by {right:.0f} px across and {down:.0f} px down, so that only {share:.0%} of "
            "the picture stays in sight; take a part of the clip in which it moves less",
            kind="far",
            right=float(ranges[1]),
            down=float(ranges[0]),
            share=share,
        )
    return SteadyFrames(array=clip.array, motion=motion, middle=(middle[0], middle[1]), crop=crop)


def camera_path(gray: npt.NDArray[np.uint8], progress: Callable[[float], None] | None = None) -> Floats:
    """Measure shift and turn of every frame against the middle one.

    Returns
    -------
    (T, 3) float64 array
        Shift down and right, px, and turn, radians, from places in the middle frame to each frame.
    """
    origin = len(gray) // 2
    levels = [_places(frame) for frame in _blurred(gray[origin])]
    result = np.zeros((len(gray), 3))
    misfit = np.zeros(len(levels[-1].shown))
    done = 0
    for order in (range(origin + 1, len(gray)), range(origin - 1, -1, -1)):
        guess = np.zeros(3)
        for index in order:
            for level, frame, steps in zip(levels, _blurred(gray[index]), _STEPS, strict=True):
                guess, apart = _aligned(level, frame, guess, steps)
            result[index] = guess
            misfit += np.minimum(apart / levels[-1].steepness, 3)
            done += 1
            if progress is not None:
                progress(0.7 * done / len(gray))
    # What moves in the picture fits badly in most frames: without it once more.
    still = levels[-1].some(misfit <= np.quantile(misfit, _RELIABLE))
    for index, frame in enumerate(gray):
        result[index], _ = _aligned(still, _blurred(frame)[-1], result[index], _STEPS[-1])
        if progress is not None:
            progress(0.7 + 0.3 * (index + 1) / len(gray))
    return result


def _blurred(frame: npt.NDArray[np.uint8]) -> list[Floats32]:
    """Return a frame with each blur, without slow light."""
    shares = frame.astype(np.float32) / np.float32(255)
    slow = ndimage.gaussian_filter(shares, 4 * _BLURS[0])
    return [ndimage.gaussian_filter(shares, blur) - slow for blur in _BLURS]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Places:
    """Steep places of the template."""

    #: (2, N): rows and columns from the frame's middle.
    at: Floats
    #: (N,): the template there; and (3, N): its change with a shift down, to the right, and with a turn.
    shown: Floats32
    changes: Floats

    @property
    def steepness(self) -> Floats:
        """Change over a pixel, (N,)."""
        steep: Floats = np.hypot(self.changes[0], self.changes[1])
        return steep

    def some(self, kept: Mask) -> _Places:
        """Keep some of them."""
        return _Places(at=self.at[:, kept], shown=self.shown[kept], changes=self.changes[:, kept])


def _places(template: Floats32) -> _Places:
    """Choose the steepest places of each part of a frame: what moves may be steeper than all that stands."""
    slopes: Floats32 = np.stack([np.gradient(template, axis=axis) for axis in (0, 1)])
    steep = np.hypot(*slopes)
    height, width = steep.shape
    chosen = np.zeros(steep.shape, bool)
    edge = max(1, min(height, width) // 20)
    for rows in np.array_split(np.arange(edge, height - edge), _PARTS):
        for columns in np.array_split(np.arange(edge, width - edge), _PARTS):
            part = np.ix_(rows, columns)
            if steep[part].size:
                chosen[part] = steep[part] >= np.quantile(steep[part], 1 - _STEEP)
    where = np.flatnonzero(chosen & (steep > 1e-4))
    where = where[:: max(1, len(where) // _MOST_PLACES)]
    at = np.stack(np.unravel_index(where, steep.shape))
    down, right = slopes.reshape(2, -1)[:, where].astype(np.float64)
    apart = at - (np.array([[height], [width]]) - 1) / 2
    turned = down * apart[1] - right * apart[0]
    return _Places(at=apart, shown=template.ravel()[where], changes=np.stack([down, right, turned]))


def _aligned(places: _Places, frame: Floats32, motion: Floats, steps: int) -> tuple[Floats, Floats]:
    """Improve a motion; also return by how much each place differs in the end."""
    changes = places.changes
    apart = _sampled(frame, places.at, motion) - places.shown
    for _ in range(steps):
        scale = max(1.5 * float(np.median(np.abs(apart))) if apart.size else 0.0, _LEAST_SCALE)
        weights = 1 / np.square(1 + np.square(apart / scale))
        system = (weights * changes) @ changes.T + 1e-9 * np.eye(3)
        step = np.linalg.solve(system, changes @ (weights * apart))
        cosine, sine = math.cos(motion[2]), math.sin(motion[2])
        motion = motion - np.concatenate([np.array([[cosine, sine], [-sine, cosine]]) @ step[:2], step[2:]])
        apart = _sampled(frame, places.at, motion) - places.shown
    return motion, np.abs(apart).astype(np.float64)


def _sampled(frame: Floats32, at: Floats, motion: Floats) -> Floats32:
    """Return a frame's values where a motion leads places."""
    down, right, turn = motion
    rows = math.cos(turn) * at[0] + math.sin(turn) * at[1] + down + (frame.shape[0] - 1) / 2
    columns = -math.sin(turn) * at[0] + math.cos(turn) * at[1] + right + (frame.shape[1] - 1) / 2
    values: Floats32 = ndimage.map_coordinates(frame, [rows, columns], order=1, mode="nearest")
    return values


def _common(size: tuple[int, int], motion: Floats, middle: tuple[float, float]) -> tuple[int, int, int, int]:
    """Return what all frames show of the steady picture: rows and columns."""
    height, width = size
    ends = np.array([[y, x] for y in (0, height - 1) for x in (0, width - 1)], float)
    rows, columns = [], []
    for down, right, turn in motion:
        y, x = (ends - middle - (down, right)).T
        rows.append(math.cos(turn) * y - math.sin(turn) * x + middle[0])
        columns.append(math.sin(turn) * y + math.cos(turn) * x + middle[1])
    y, x = np.array(rows), np.array(columns)
    return (
        max(0, math.ceil(y[:, :2].max())),
        min(height, math.floor(y[:, 2:].min()) + 1),
        max(0, math.ceil(x[:, ::2].max())),
        min(width, math.floor(x[:, 1::2].min()) + 1),
    )


def moved(frame: Volume, down: float, right: float, turn: float, middle: tuple[float, float]) -> Floats32:
    """Sample an (H, W, C) frame where a motion leads the pixels of the steady picture.

    Examples
    --------
    >>> ramp = np.arange(64.0).reshape(8, 8, 1)
    >>> float(moved(ramp, 1.0, 0.5, 0.0, (3.5, 3.5))[3, 3, 0]), float(ramp[4, 3, 0] + 0.5)
    (35.5, 35.5)
    """
    height, width = frame.shape[:2]
    lean, rise = math.tan(turn / 2), -math.sin(turn)
    margin = 3 + math.ceil(abs(lean) * height / 2 + abs(rise) * width / 2)
    around = ((margin, margin), (margin, margin), (0, 0))
    values = np.pad(frame.astype(np.float32), around, mode="edge")
    y = np.arange(height + 2 * margin) - margin - middle[0]
    x = np.arange(width + 2 * margin) - margin - middle[1]
    values = _rows_shifted(values, lean * y + right - lean * down)
    across = np.ascontiguousarray(values.transpose(1, 0, 2))
    values = np.ascontiguousarray(_rows_shifted(across, rise * x + down).transpose(1, 0, 2))
    return _rows_shifted(values, lean * y)[margin:-margin, margin:-margin]


def _rows_shifted(values: Floats32, shifts: Floats) -> Floats32:
    """Sample each row at places that are shifted, by cubic convolution; ends go on as they are."""
    whole = np.floor(shifts).astype(int)
    share = (shifts - whole).astype(np.float32)
    weights = np.stack(
        [
            (-share + 2 * share**2 - share**3) / 2,
            (2 - 5 * share**2 + 3 * share**3) / 2,
            (share + 4 * share**2 - 3 * share**3) / 2,
            (share**3 - share**2) / 2,
        ]
    )
    if not whole.any() and not share.any():
        return values
    length, reach = values.shape[1], int(np.abs(whole).max()) + 2
    padded = np.pad(values, ((0, 0), (reach, reach), (0, 0)), mode="edge")
    result = np.empty_like(values)
    for row, (begin, (before, here, after, beyond)) in enumerate(
        zip(whole + reach - 1, weights.T, strict=True)
    ):
        line = padded[row, begin : begin + length + 3]
        result[row] = before * line[:-3] + here * line[1:-2] + after * line[2:-1] + beyond * line[3:]
    return result
