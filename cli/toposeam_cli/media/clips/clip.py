"""A clip in memory: frames at an even rate."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.errors import ImageError
from toposeam_cli.media.clips.sound import Sound

#: Rate of clips that do not state it, which are folders of frames, frames per second.
DEFAULT_RATE = Fraction(25)
#: Tolerance of times at an even rate, as a share of a frame's duration: formats round to 1 or 10 ms.
_UNEVEN = 0.5

#: Greatest number of frames that a rate may make of a clip.
_MOST_FRAMES = 10_000_000

Frames = npt.NDArray[np.unsignedinteger]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Clip:
    """Frames at an even rate."""

    #: (T, H, W) gray or (T, H, W, C) RGB or RGBA, uint8 or uint16; in memory, or read by slices.
    frames: Any
    #: Frames per second.
    rate: Fraction
    #: Whether the file has sound, and time of the first frame in it, s.
    sound: bool = False
    begin: Fraction = Fraction(0)
    #: Sound to write with it.
    heard: Sound | None = None

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return float(len(self.frames) / self.rate)


def evenly(
    frames: list[npt.NDArray[np.uint8]],
    starts: list[Fraction],
    last: Fraction,
    rate: Fraction | None,
    name: str,
    max_pixels: int,
) -> tuple[Frames, Fraction]:
    """Return frames at an even rate.

    Parameters
    ----------
    frames : list of arrays
    starts : list of Fraction
        Times at which the frames are shown, s, increasing.
    last : Fraction
        Duration of the last frame, s.
    rate : Fraction, optional
        Frames per second to take, each the one shown at its time; without it the frames must be even.
    name : str
        Name of the file, for error texts.
    max_pixels : int
        Limit for all frames that are taken, in pixels.

    Raises
    ------
    ImageError
        When frames differ in size, when their times are uneven and no rate is given, or when a rate takes too
        many frames.
    """
    shapes = {frame.shape[1::-1] for frame in frames}
    if len(shapes) > 1:
        sizes = " and ".join(f"{width} × {height}" for width, height in sorted(shapes))
        raise ImageError(f"the frames of {name} are {sizes} px; make them all of one size")
    taken, even = even_times(starts, last, rate, name)
    check_pixels(f"{name} at {float(even):g} frames a second", len(taken), frames[0].shape, max_pixels)
    return np.stack([frames[index] for index in taken]), even


def even_times(
    starts: list[Fraction], last: Fraction, rate: Fraction | None, name: str
) -> tuple[Sequence[int], Fraction]:
    """Return the numbers of the frames that are shown at even times, and their rate; see :func:`evenly`.

    Raises
    ------
    ImageError
    """
    count = len(starts)
    if rate is not None:
        taken = max(1, int((starts[-1] + last - starts[0]) * rate))
        if taken > _MOST_FRAMES:
            raise ImageError(
                f"{name} at {float(rate):g} frames a second has {taken} frames; read fewer a second (--fps)"
            )
        return [bisect.bisect_right(starts, starts[0] + at / rate) - 1 for at in range(taken)], rate
    step = (starts[-1] - starts[0]) / (count - 1) if count > 1 else last
    if step <= 0:
        raise ImageError(f"the frames of {name} have no times; say with --fps how many a second are meant")
    for index, at in enumerate(starts):
        if abs(at - starts[0] - index * step) > _UNEVEN * step:
            raise ImageError(
                f"the frame rate of {name} varies (about {float(1 / step):.3g} a second); say with --fps at "
                "how many frames a second to read it"
            )
    return range(count), (1 / step).limit_denominator(1001)


def check_pixels(name: str, count: int, shape: tuple[int, ...], max_pixels: int) -> None:
    """Refuse frames with too many pixels together.

    Raises
    ------
    ImageError
    """
    height, width = shape[:2]
    if count * width * height > max_pixels:
        raise ImageError(
            f"{name} has {count} frames of {width} × {height} px, {count * width * height / 1e6:.0f} "
            "megapixels; read less of it (--from, --to, --scale), or allow more with --max-megapixels"
        )
