"""Clips in parts: frames are read when they are needed, so that a clip may be larger than memory."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Volume
from toposeam.images import full_scale
from toposeam.volume.problem.arrays import as_shares, as_volume

#: Values of frames that are read together, about.
_PART_VALUES = 1 << 24


@dataclass(frozen=True, slots=True, eq=False)
class ClipFrames:
    """Frames of a clip, or of a part of it, that are read by slices."""

    #: Anything with ``shape``, ``dtype`` and slices along its first axis.
    array: Any
    #: Number of the first frame, and number of frames.
    first: int
    count: int

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Frames, height, width, channels."""
        shape: Any = self.array.shape
        return self.count, shape[1], shape[2], shape[3] if len(shape) == 4 else 1

    @property
    def dtype(self) -> np.dtype[Any]:
        """Type of the values."""
        kind: np.dtype[Any] = np.dtype(self.array.dtype)
        return kind

    def part(self, first: int, last: int) -> Volume:
        """Read frames `first` to ``last - 1`` as an (N, H, W, C) array."""
        return as_volume(self.array[self.first + first : self.first + last], "frames")

    def parts(self, first: int, last: int) -> Iterator[Volume]:
        """Read frames in turn, a few at a time."""
        for start, stop in self.ranges(first, last):
            yield self.part(start, stop)

    def ranges(self, first: int, last: int) -> Iterator[tuple[int, int]]:
        """Divide frames into parts that are read together."""
        step = max(1, _PART_VALUES // math.prod(self.shape[1:]))
        for start in range(first, last, step):
            yield start, min(start + step, last)


def as_clip(frames: Any) -> tuple[ClipFrames, bool]:
    """Return a clip, and whether its frames have no channel axis.

    Parameters
    ----------
    frames : (T, H, W) or (T, H, W, C) array_like
        Arrays that are not NumPy's, but have a shape, a dtype and slices (of dask, zarr, or a reader of
        videos), are read part by part.

    Raises
    ------
    ImageError
        For arrays that are no clip.
    """
    shape: Any = getattr(frames, "shape", ())
    lazy = not isinstance(frames, np.ndarray) and isinstance(getattr(frames, "dtype", None), np.dtype)
    if not (lazy and hasattr(frames, "__getitem__") and len(shape) in (3, 4) and 0 not in shape):
        whole = as_volume(frames, "frames")
        frames = whole[..., 0] if np.ndim(frames) == 3 else whole
        shape = frames.shape
    return ClipFrames(frames, 0, shape[0]), len(shape) == 3


def reduced_shares(frames: Volume, side: int, data_range: float | None) -> Floats32:
    """Reduce frames by means over squares of `side` px, as shares of white; rests are left out."""
    if side == 1:
        return as_shares(frames, "frames", data_range)
    height, width = (length // side * side for length in frames.shape[1:3])
    whole = frames.dtype.kind == "u" and frames.dtype.itemsize <= 2 and data_range is None
    white = float(full_scale(frames.dtype)) if whole else 1.0
    part: Volume = (frames if whole else as_shares(frames, "frames", data_range))[:, :height, :width]
    rows: npt.NDArray[Any] = part[:, ::side].astype(np.uint32 if whole else np.float32)
    for place in range(1, side):
        rows += part[:, place::side]
    sums = rows[:, :, ::side].astype(np.float32)
    for place in range(1, side):
        sums += rows[:, :, place::side]
    sums /= np.float32(white * side * side)
    return sums


def enlarged(values: Floats32, side: int, shape: tuple[int, int]) -> Floats32:
    """Enlarge (h, w, …) values of squares to (H, W, …), linearly between the squares' middles."""
    if side == 1:
        return values
    for axis, length in enumerate(shape):
        at = (np.arange(length, dtype=np.float32) + 0.5) / side - 0.5
        low = np.clip(np.floor(at).astype(int), 0, values.shape[axis] - 1)
        high = np.minimum(low + 1, values.shape[axis] - 1)
        share = np.clip(at - low, 0, 1).reshape(-1, *[1] * (values.ndim - axis - 1))
        values = values.take(low, axis) * (1 - share) + values.take(high, axis) * share
    return values
