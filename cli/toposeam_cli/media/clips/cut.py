"""A cut of a clip: the part that is read, perhaps at a smaller size."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.errors import ImageError


@dataclass(frozen=True, slots=True)
class Duration:
    """A duration in frames or in seconds."""

    value: float
    seconds: bool

    def frames(self, rate: Fraction) -> int:
        """Compute the number of frames at a rate."""
        return round(self.value * rate) if self.seconds else int(self.value)

    def reached(self, frame: int, second: Fraction) -> bool:
        """Test whether a frame, which is shown from `second` on, comes at this duration or later."""
        return second >= Fraction(self.value).limit_denominator(1000) if self.seconds else frame >= self.value


@dataclass(frozen=True, slots=True, kw_only=True)
class Cut:
    """The part of a clip that is read; by default all of it.

    Examples
    --------
    >>> cut = Cut(first=Duration(2, False), last=Duration(0.2, True))
    >>> [cut.wants(frame, Fraction(frame, 25)) for frame in range(7)]
    [False, False, True, True, True, False, False]
    """

    #: Its first frame, and the first one after it.
    first: Duration | None = None
    last: Duration | None = None
    #: Factor of its sides, in (0, 1].
    scale: float = 1.0

    def wants(self, frame: int, second: Fraction) -> bool:
        """Test whether a frame is read that is shown from `second` on."""
        begun = self.first is None or self.first.reached(frame, second)
        return begun and not self.ended(frame, second)

    def ended(self, frame: int, second: Fraction) -> bool:
        """Test whether neither this frame nor any later one is read."""
        return self.last is not None and self.last.reached(frame, second)

    def count(self, frames: int, rate: Fraction | None) -> int:
        """Estimate the number of frames that are read of a clip."""
        if rate is None or rate <= 0:
            return frames
        begin = 0 if self.first is None else self.first.frames(rate)
        end = frames if self.last is None else min(self.last.frames(rate), frames)
        return max(end - begin, 0)

    def shape(self, height: int, width: int) -> tuple[int, int]:
        """Compute the height and width of the frames that are read."""
        if self.scale == 1:
            return height, width
        return max(round(height * self.scale), 1), max(round(width * self.scale), 1)

    def scaled(self, pixels: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return an (H, W) or (H, W, C) frame at its new size."""
        if self.scale == 1:
            return pixels
        from PIL import Image

        height, width = self.shape(*pixels.shape[:2])
        planes = [
            np.asarray(Image.fromarray(plane).resize((width, height), Image.Resampling.LANCZOS))
            for plane in np.moveaxis(np.atleast_3d(pixels).astype(np.float32), 2, 0)
        ]
        top = np.iinfo(pixels.dtype).max
        whole: npt.NDArray[Any] = np.rint(np.clip(np.stack(planes, axis=2), 0, top)).astype(pixels.dtype)
        return whole if pixels.ndim == 3 else whole[..., 0]

    def check(self, frames: int, name: str) -> None:
        """Refuse a part in which there are no frames.

        Raises
        ------
        ImageError
        """
        if not frames:
            raise ImageError(f"{name} has no frames between --from and --to; give a part that it has")
