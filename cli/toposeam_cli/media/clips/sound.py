"""The sound of a loop: what was heard with its frames, cross-faded where they jump."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam_cli.media.clips.video import OPENED, unreadable

#: Samples per second at which sound is read and written.
RATE = 48_000


@dataclass(frozen=True, slots=True, eq=False)
class Sound:
    """Sound in memory, at 48 kHz."""

    #: (channels, N) float32: one channel, or two.
    samples: npt.NDArray[np.float32]


def looped_sound(
    path: Path, begin: Fraction, rate: Fraction, jumps: Sequence[tuple[int, int]], transition: int
) -> Sound | None:
    """Read the sound of a loop; None if none is heard with its frames.

    Parameters
    ----------
    path : Path
        The video.
    begin : Fraction
        Time of the clip's first frame in it, s.
    rate : Fraction
        Frames per second.
    jumps : sequence of (int, int)
        The frames that each jump leaves and enters, in order; the first one's transition begins the loop.
    transition : int
        Number of frames of a transition.

    Raises
    ------
    ImageError
        Where the video is damaged.
    """
    numbers = [number for jump in jumps for number in jump]
    first = min(numbers)
    heard = _read(path, begin + first / rate, begin + (max(numbers) + transition) / rate)
    if heard is None:
        return None

    def at(frame: int) -> int:
        return round((frame - first) / rate * RATE)

    fade = np.linspace(0, np.pi / 2, at(first + transition), dtype=np.float32)
    parts = []
    for (leaves, enters), (after, _) in zip(jumps, [*jumps[1:], jumps[0]], strict=True):
        left, entered = (heard[:, at(number) :][:, : len(fade)] for number in (leaves, enters))
        parts.append(left * np.cos(fade) + entered * np.sin(fade))
        parts.append(heard[:, at(enters) + len(fade) : at(after)])
    return Sound(np.concatenate(parts, axis=1))


def _read(path: Path, first: Fraction, last: Fraction) -> npt.NDArray[np.float32] | None:
    """Read the samples between two times, s; silence where there are none."""
    import av

    count = round((last - first) * RATE) + 1  # the beginnings of stretches are rounded, too
    samples: npt.NDArray[np.float32] | None = None
    try:
        with av.open(f"file:{path}", options=OPENED) as container:
            stream = container.streams.audio[0]
            if stream.codec_context is None:
                return None
            channels = min(2, stream.channels)
            resampler = av.AudioResampler("fltp", "mono" if channels == 1 else "stereo", RATE)
            container.seek(max(0, int((first - 1) * av.time_base)))
            place: int | None = None
            for frame in _decoded(container, stream):
                if frame is None:
                    place = None
                    continue
                if place is None:
                    place = round((Fraction(frame.pts or 0) * (frame.time_base or 1) - first) * RATE)
                for even in resampler.resample(frame):
                    part = even.to_ndarray()
                    low, high = max(place, 0), min(place + part.shape[1], count)
                    if low < high:
                        if samples is None:
                            samples = np.zeros((channels, count), np.float32)
                        samples[:, low:high] = part[:, low - place : high - place]
                    place += part.shape[1]
                if place >= count:
                    break
    except (av.FFmpegError, OSError) as error:
        raise unreadable(path, error) from error
    return samples


def _decoded(container: Any, stream: Any) -> Iterator[Any]:
    """Decode sound; yield None for a damaged packet, as the first one of sound that was cut often is."""
    import av

    for packet in container.demux(stream):
        try:
            frames = packet.decode()
        except av.InvalidDataError:
            frames = [None]
        yield from frames
