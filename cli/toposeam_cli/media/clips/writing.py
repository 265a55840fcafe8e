"""Clips written to files and folders, whole or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.errors import MissingPackageError, OptionError
from toposeam_cli.files.writing import OutputError, all_or_nothing, check_output, replacing
from toposeam_cli.media.clips.clip import Clip
from toposeam_cli.media.clips.sound import RATE, Sound
from toposeam_cli.media.pictures.picture import Picture, write_picture

#: Codec and pixel format of each kind of video.
_VIDEO = {
    ".mp4": ("libx264", "yuv420p", {"crf": "15", "preset": "medium"}),
    ".mov": ("libx264", "yuv420p", {"crf": "15", "preset": "medium"}),
    ".mkv": ("libx264", "yuv420p", {"crf": "15", "preset": "medium"}),
    ".webm": ("libvpx-vp9", "yuv420p", {"crf": "24", "b:v": "0"}),
}
#: Codec of their sound.
_AUDIO = {".mp4": "aac", ".mov": "aac", ".mkv": "aac", ".webm": "libopus"}
ANIMATED = (".gif", ".webp", ".png", ".apng")
SUFFIXES = (*_VIDEO, *ANIMATED)
#: Effort of WebP's encoder, 0 to 6: 4 takes two to four times as long for files 4 to 6 % smaller.
_WEBP_METHOD = 2
#: Videos, which may have sound.
VIDEOS = tuple(_VIDEO)


def check_clip_output(path: Path, force: bool) -> Path:
    """Refuse an output that cannot be written, before any work: a file by its extension, or a folder for
    frames, which has no extension.

    Raises
    ------
    OptionError, MissingPackageError
    """
    if path.suffix:
        check_output(path, force, SUFFIXES)
        if path.suffix.lower() in _VIDEO:
            _codec(path.suffix.lower())
    elif path.exists():
        if not path.is_dir():
            raise OptionError(f"'{path}' is a file; name a folder for the frames, or give an extension")
        if any(path.iterdir()):
            raise OptionError(f"the folder '{path}' is not empty; name another one for the frames")
    elif not path.absolute().parent.is_dir():
        raise OptionError(f"there is no folder '{path.absolute().parent}'; create it or choose another one")
    return path


def write_clip(path: Path, clip: Clip, force: bool = False) -> None:
    """Write a clip in the format of its name.

    Videos have no transparency and sides of even length: an odd last row or column is repeated. GIFs have 256
    colours and times in hundredths of a second. Frames and APNG keep every bit, WebP is written lossless.

    Raises
    ------
    OptionError
        If the file cannot go there; see :func:`check_clip_output`.
    OutputError
        If writing fails; nothing half-written is left.
    """
    check_clip_output(path, force)
    if not path.suffix:
        with folder_for(path), all_or_nothing():
            _write_folder(path, clip)
        return
    write = _write_video if path.suffix.lower() in _VIDEO else _write_animated
    with replacing(path, force) as temporary:
        write(temporary, clip, path.suffix.lower())


@contextmanager
def folder_for(path: Path) -> Iterator[None]:
    """Make the folder of frames for the block; a new one is removed when the block fails."""
    new = not path.suffix and not path.exists()
    if new:
        try:
            path.mkdir()
        except OSError as error:
            raise OutputError(
                f"cannot make the folder '{path}' ({error.strerror}); choose another"
            ) from error
    try:
        yield
    except BaseException:
        if new:
            with suppress(OSError):
                path.rmdir()
        raise


def _write_folder(folder: Path, clip: Clip) -> None:
    digits = max(4, len(str(len(clip.frames) - 1)))
    for index, frame in enumerate(clip.frames):
        wide = frame.ndim == 3 and frame.shape[2] == 4
        picture = Picture(
            pixels=np.ascontiguousarray(frame[..., :3]) if wide else frame,
            alpha=np.ascontiguousarray(frame[..., 3]) if wide else None,
        )
        write_picture(folder / f"{index:0{digits}d}.png", picture)


def _write_animated(path: Path, clip: Clip, suffix: str) -> None:
    from PIL import Image

    pictures = [Image.fromarray(_eight_bits(frame)) for frame in clip.frames]
    shown = 1000 / clip.rate
    # Rounded cumulatively, so that the clip keeps its duration.
    unit = 10 if suffix == ".gif" else 1
    ends = [round(shown * (index + 1) / unit) * unit for index in range(len(pictures))]
    durations = [max(unit, last - first) for first, last in zip([0, *ends[:-1]], ends, strict=True)]
    palette = _palette(pictures) if suffix == ".gif" else None
    if palette is not None:
        pictures = [picture.quantize(palette=palette) for picture in pictures]
    common: dict[str, Any] = {
        "save_all": True,
        "append_images": pictures[1:],
        "duration": durations,
        "loop": 0,
    }
    if suffix == ".gif":
        pictures[0].save(path, "GIF", disposal=2, optimize=False, **common)
    elif suffix == ".webp":
        pictures[0].save(path, "WEBP", lossless=True, quality=60, method=_WEBP_METHOD, **common)
    else:
        pictures[0].save(path, "PNG", **common)


def _palette(pictures: list[Any]) -> Any:
    """Return one palette for a whole clip, so that it does not flicker; None where frames are transparent."""
    from PIL import Image

    if pictures[0].mode == "RGBA":
        return None
    chosen = pictures[:: max(1, len(pictures) // 16)]
    width, height = pictures[0].size
    sheet = Image.new("RGB", (width, height * len(chosen)))
    for index, picture in enumerate(chosen):
        sheet.paste(picture.convert("RGB"), (0, index * height))
    return sheet.quantize(256, method=Image.Quantize.MEDIANCUT)


def _write_video(path: Path, clip: Clip, suffix: str) -> None:
    import av

    codec, layout, options = _codec(suffix)
    kind = {".mp4": "mp4", ".mov": "mov", ".mkv": "matroska", ".webm": "webm"}[suffix]
    # Without "file:" FFmpeg takes a folder called "http:" for an address.
    with av.open(f"file:{path}", "w", format=kind, options={"protocol_whitelist": "file"}) as container:
        stream: Any = container.add_stream(codec, rate=clip.rate, options=options)
        stream.pix_fmt = layout
        voice = None if clip.heard is None else _Voice(container, suffix, clip.heard)
        for index, deep in enumerate(clip.frames):
            frame = _eight_bits(deep)
            height, width = frame.shape[:2]
            if index == 0:
                stream.width, stream.height = width + width % 2, height + height % 2
            if frame.ndim == 3 and frame.shape[2] == 4 and not (frame[..., 3] == 255).all():
                raise OptionError(
                    f"{suffix} videos have no transparency, and the clip has; write .webp, .png or a folder"
                )
            rgb = np.repeat(frame[..., None], 3, axis=2) if frame.ndim == 2 else frame[..., :3]
            rgb = np.pad(rgb, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
            container.mux(
                stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(rgb), format="rgb24"))
            )
            if voice is not None:
                voice.write(round((index + 1) / clip.rate * RATE))
        container.mux(stream.encode())
        if voice is not None:
            voice.write(None)


class _Voice:
    """The sound of a video that is written along with its frames."""

    def __init__(self, container: Any, suffix: str, sound: Sound) -> None:
        self._container, self._samples, self._at = container, sound.samples, 0
        self._layout = "mono" if len(sound.samples) == 1 else "stereo"
        self._stream = container.add_stream(_AUDIO[suffix], rate=RATE, layout=self._layout)

    def write(self, end: int | None) -> None:
        """Write the samples up to a number; all that are left, and the end, without one."""
        import av

        part = np.ascontiguousarray(self._samples[:, self._at : end])
        if part.shape[1]:
            frame = av.AudioFrame.from_ndarray(part, format="fltp", layout=self._layout)
            frame.sample_rate, frame.pts, frame.time_base = RATE, self._at, Fraction(1, RATE)
            self._container.mux(self._stream.encode(frame))
            self._at += part.shape[1]
        if end is None:
            self._container.mux(self._stream.encode())


def _codec(suffix: str) -> tuple[str, str, dict[str, str]]:
    try:
        import av
    except ImportError as error:
        raise MissingPackageError(
            f"writing {suffix} needs PyAV; install it with: pip install av, or write .gif, "
            ".webp, .png or a folder of frames"
        ) from error
    codec, layout, options = _VIDEO[suffix]
    if codec not in av.codecs_available:
        raise MissingPackageError(
            f"this PyAV cannot encode {suffix} (no {codec}); write .gif, .webp, .png or a folder of frames"
        )
    return codec, layout, options


def _eight_bits(frames: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    return frames if frames.dtype == np.uint8 else np.rint(frames / 257).astype(np.uint8)
