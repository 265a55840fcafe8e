"""Clips read from files and folders."""

from __future__ import annotations

import re
import struct
import warnings
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.errors import ImageError, MissingPackageError
from toposeam_cli.media.clips.clip import DEFAULT_RATE, Clip, check_pixels, even_times, evenly
from toposeam_cli.media.clips.cut import Cut
from toposeam_cli.media.clips.video import OPENED, VideoFrames, unreadable
from toposeam_cli.media.pictures.picture import MAX_PIXELS, read_picture

#: Pictures that may hold several frames, read by Pillow.
ANIMATED = (".gif", ".webp", ".png", ".apng")
#: Extensions of the frames in a folder.
FRAMES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".webp")
_Frame = npt.NDArray[np.uint8]
_WHOLE = Cut()
#: Most pixels that are loaded of a small file by default, and for each byte of others.
_MOST_OF_SMALL, _MOST_FOR_A_BYTE = 100_000_000, 100


class OneFrameError(ImageError):
    """A picture with one frame, where a clip is needed."""


def most_loaded(path: Path, asked: int | None) -> int:
    """Return how many pixels of a clip may be loaded: those asked for, else fewer of a small file, since a
    few bytes hold many frames that are alike.
    """
    if asked:
        return asked
    files = path.iterdir() if path.is_dir() else [path]
    size = sum(file.stat().st_size for file in files if file.is_file())
    return min(MAX_PIXELS, max(_MOST_OF_SMALL, _MOST_FOR_A_BYTE * size))


def read_clip(path: Path, rate: Fraction | None, max_pixels: int, cut: Cut = _WHOLE) -> Clip:
    """Read a video, an animated picture, or a folder of frames into memory; see :func:`open_clip`."""
    clip = open_clip(path, rate, max_pixels, max_pixels, cut)
    return replace(clip, frames=clip.frames[:])


def open_clip(path: Path, rate: Fraction | None, max_pixels: int, max_loaded: int, cut: Cut = _WHOLE) -> Clip:
    """Open a video, or read an animated picture or a folder of frames.

    Parameters
    ----------
    path : Path
    rate : Fraction, optional
        Frames per second. Of clips at another or an uneven rate the frame shown at each time is taken.
    max_pixels : int
        Frames times width times height above which a video is refused.
    max_loaded : int
        The same for animated pictures and folders, which are loaded.
    cut : Cut
        The part that is read.

    Raises
    ------
    OneFrameError
        For a picture that does not move.
    ImageError
        If there is no such file, or it is no clip, damaged, cut short or too large, or if its frames differ
        in size or come at an uneven rate.
    MissingPackageError
        For videos, without PyAV.
    """
    if path.is_dir():
        return _read_folder(path, rate, max_loaded, cut)
    if not path.exists():
        raise ImageError(f"there is no file '{path}'; check the name")
    if path.suffix.lower() in ANIMATED:
        return _read_animated(path, rate, max_loaded, cut)
    return _open_video(path, rate, max_pixels, cut)


def _read_folder(folder: Path, rate: Fraction | None, max_pixels: int, cut: Cut) -> Clip:
    files = sorted(
        (
            file
            for file in folder.iterdir()
            if file.suffix.lower() in FRAMES and not file.name.startswith(".")
        ),
        key=_in_order,
    )
    if not files:
        raise ImageError(f"the folder '{folder}' holds no frames; put {', '.join(FRAMES)} files there")
    frames: list[Any] = []
    each = rate or DEFAULT_RATE
    files = [file for index, file in enumerate(files) if cut.wants(index, index / each)]
    cut.check(len(files), f"the folder '{folder}'")
    for file in files:
        picture = read_picture(file, max_pixels // len(files) or 1)
        pixels = picture.pixels
        if pixels.dtype not in (np.uint8, np.uint16):
            raise ImageError(f"{file} has floating point pixels; save the frames with 8 or 16 bits")
        if picture.alpha is not None:
            rgb = np.repeat(pixels[..., None], 3, axis=2) if pixels.ndim == 2 else pixels
            pixels = np.concatenate([rgb, picture.alpha[..., None]], axis=2)
        frames.append(cut.scaled(pixels))
        pixels, first = frames[-1], frames[0]
        if pixels.shape != first.shape or pixels.dtype != first.dtype:
            raise ImageError(
                f"{file.name} is {_shown(pixels)}, and {files[0].name} is {_shown(first)}; make all frames "
                "of one size, depth and number of channels"
            )
    return Clip(frames=np.stack(frames), rate=rate or DEFAULT_RATE)


def _in_order(file: Path) -> list[Any]:
    """Return a key that sorts 2.png before 10.png."""
    return [(1, int(word), "") if word.isdigit() else (0, 0, word) for word in re.split(r"(\d+)", file.name)]


def _shown(pixels: npt.NDArray[Any]) -> str:
    channels = pixels.shape[2] if pixels.ndim == 3 else 1
    return f"{pixels.shape[1]} × {pixels.shape[0]} px with {channels} × {8 * pixels.dtype.itemsize} bits"


def _read_animated(path: Path, rate: Fraction | None, max_pixels: int, cut: Cut) -> Clip:
    from PIL import Image, ImageSequence, UnidentifiedImageError

    frames: list[_Frame] = []
    starts: list[Fraction] = []
    at = Fraction(0)
    try:
        with warnings.catch_warnings(action="ignore"), Image.open(path) as picture:
            count = getattr(picture, "n_frames", 1)
            info = Fraction(1000, round(float(picture.info.get("duration", 0) or 100)) or 100)
            check_pixels(
                str(path), cut.count(count, info), cut.shape(picture.height, picture.width), max_pixels
            )
            if count < 2:
                raise OneFrameError(f"{path} holds one frame; a clip needs several")
            wide = picture.mode in ("RGBA", "LA", "PA") or "transparency" in picture.info
            for index, frame in enumerate(ImageSequence.Iterator(picture)):
                pixels = np.asarray(frame.convert("RGBA" if wide else "RGB"))
                if cut.ended(index, at):
                    break
                if cut.wants(index, at):
                    starts.append(at)
                    frames.append(cut.scaled(pixels))
                    check_pixels(str(path), len(frames), frames[0].shape, max_pixels)
                # Pillow knows a frame's duration only after loading it.
                shown = Fraction(round(1000 * float(frame.info.get("duration", 0) or 100)), 1_000_000)
                at += shown
    except Image.DecompressionBombError as error:
        raise ImageError(
            f"{path} has more pixels than any animation that is read; make it smaller first"
        ) from error
    except UnidentifiedImageError as error:
        raise ImageError(f"{path} is no picture that can be read; save it again") from error
    except (OSError, SyntaxError, EOFError, ValueError, IndexError, struct.error) as error:
        if isinstance(error, ImageError):
            raise
        raise ImageError(f"{path} is damaged or cut short ({error}); copy or save it again") from error
    cut.check(len(frames), str(path))
    if len(frames) < 2:
        raise OneFrameError(f"{path} holds one frame; a clip needs several")
    if wide and all((frame[..., 3] == 255).all() for frame in frames):
        frames = [np.ascontiguousarray(frame[..., :3]) for frame in frames]
    stacked, even = evenly(frames, starts, shown, rate, str(path), max_pixels)
    return Clip(frames=stacked, rate=even)


def _open_video(path: Path, rate: Fraction | None, max_pixels: int, cut: Cut) -> Clip:
    try:
        import av
    except ImportError as error:
        raise MissingPackageError(
            f"reading {path} needs PyAV; install it with: pip install av, or give a GIF, "
            "WebP, APNG or a folder of frames"
        ) from error
    times: list[int] = []
    try:
        with av.open(f"file:{path}", options=OPENED) as container:
            if not container.streams.video:
                raise ImageError(f"{path} holds no pictures; give a video")
            stream = container.streams.video[0]
            if stream.codec_context is None:
                raise ImageError(f"{path} is coded in a way that FFmpeg does not know; convert it to H.264")
            unit, expected = stream.time_base or Fraction(1, 90_000), stream.frames
            last = 1 / stream.average_rate if stream.average_rate else Fraction(1, 25)
            if rate is None and last == unit:  # AVI: a frame that is missing is the one before, shown again
                rate = stream.average_rate
            size = cut.shape(stream.height, stream.width)
            check_pixels(str(path), max(cut.count(expected, stream.average_rate), 1), size, max_pixels)
            packets = [packet for packet in container.demux(stream) if packet.size]
            times = sorted(
                packet.pts for packet in packets if packet.pts is not None and not packet.is_discard
            )
            sound = bool(container.streams.audio)
    except (av.FFmpegError, OSError) as error:
        if isinstance(error, ImageError):
            raise
        raise unreadable(path, error) from error
    if not times:
        raise ImageError(f"{path} holds no frames; convert it again")
    if len(packets) < 0.9 * expected and times[-1] - times[0] + last / unit < 0.9 * expected * last / unit:
        raise ImageError(
            f"{path} is cut short: {len(packets)} of {expected} frames can be read; copy it again"
        )
    starts = [at * unit for at in times]
    wanted = [index for index, at in enumerate(starts) if cut.wants(index, at - starts[0])]
    cut.check(len(wanted), str(path))
    taken, even = even_times([starts[index] for index in wanted], last, rate, str(path))
    check_pixels(str(path), len(taken), size, max_pixels)
    frames = VideoFrames(path, [times[wanted[index]] for index in taken], cut)
    return Clip(frames=frames, rate=even, sound=sound, begin=starts[wanted[0]])
