"""Videos read a few frames at a time (PyAV), so that they may be longer and larger than memory."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.errors import ImageError
from toposeam_cli.media.clips.cut import Cut

#: Formats that FFmpeg may read: containers. Playlists (HLS, concat, DASH) would open other files.
_CONTAINERS = (
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg,mpegvideo,flv,asf,ogg,gif,apng,mjpeg,m4v,h264,hevc,"
    "av1,obu,ivf,nut,mxf,dv,rm,wtv,yuv4mpegpipe"
)
#: Options that let FFmpeg open files only. Names need ``file:`` before them, as it takes ``tcp:x.mp4``,
#: ``http:/x.mp4`` or ``12:30.mp4`` for addresses.
OPENED = {"format_whitelist": _CONTAINERS, "protocol_whitelist": "file"}
#: Frames that are rather decoded than leapt over.
_NEAR = 60
#: Frames by which times may be out of order: frames are decoded as they are shown, but in AVI files with
#: frames that refer to later ones (MPEG-4 ASP) FFmpeg guesses their times.
_DISORDER = 4

_Frame = npt.NDArray[np.uint8]


class VideoFrames:
    """Frames of a video, read by slices: (T, H, W, 3) uint8.

    Parameters
    ----------
    path : Path
    times : sequence of int
        Time of each frame in the stream's unit, not decreasing; a frame may come several times.
    cut : Cut
        Says at which size frames are read.
    """

    def __init__(self, path: Path, times: Sequence[int], cut: Cut) -> None:
        self._path, self._times, self._cut = path, list(times), cut
        self._playing: Iterator[tuple[int, Any]] | None = None
        self._last: tuple[int, _Frame] | None = None
        first = self._pixels(self._times[0])
        self.shape: tuple[int, int, int, int] = (len(self._times), first.shape[0], first.shape[1], 3)
        self.dtype: np.dtype[np.uint8] = first.dtype

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._times)

    def __getitem__(self, part: slice) -> _Frame:
        """Read frames.

        Raises
        ------
        ImageError
            Where the video is damaged.
        """
        wanted = self._times[part]
        frames = np.empty((len(wanted), *self.shape[1:]), np.uint8)
        for index, time in enumerate(wanted):
            pixels = self._pixels(time)
            if pixels.shape != self.shape[1:]:
                raise ImageError(
                    f"the frames of {self._path} are {self.shape[2]} × {self.shape[1]} and {pixels.shape[1]} "
                    f"× {pixels.shape[0]} px; make them all of one size"
                )
            frames[index] = pixels
        return frames

    def _pixels(self, time: int) -> _Frame:
        """Return the frame of a time."""
        if self._last is None or self._last[0] != time:
            if not self._is_near(time):
                self._playing = self._from(time)
            frame = self._found(time)
            if frame is None:  # the place that was leapt to lies behind it
                self._playing = self._from(self._times[0])
                frame = self._found(time)
            if frame is None:
                raise ImageError(
                    f"{self._path} is damaged: a frame cannot be read again; copy or convert the video again"
                )
            self._last = time, self._cut.scaled(upright(frame))
        return self._last[1]

    def _is_near(self, time: int) -> bool:
        if self._playing is None or self._last is None or time < self._last[0]:
            return False
        mean = (self._times[-1] - self._times[0]) / max(len(self._times) - 1, 1)
        return time - self._last[0] <= _NEAR * max(mean, 1)

    def _found(self, time: int) -> Any:
        """Go on playing up to a time; return its frame, or None if that does not come."""
        if self._playing is None:
            return None
        for at, frame in self._playing:
            if at >= time:
                return frame if at == time else None
        return None

    def _from(self, time: int) -> Iterator[tuple[int, Any]]:
        """Play from the last key frame before a time."""
        import av

        try:
            with av.open(f"file:{self._path}", options=OPENED) as container:
                stream = container.streams.video[0]
                stream.thread_type = "AUTO"
                if time > self._times[0]:
                    container.seek(time, stream=stream)
                frames: deque[Any] = deque()
                times: list[int] = []
                for frame in container.decode(stream):
                    frames.append(frame)
                    heapq.heappush(times, frame.pts or 0)
                    if len(frames) > _DISORDER:
                        yield heapq.heappop(times), frames.popleft()
                while frames:
                    yield heapq.heappop(times), frames.popleft()
        except (av.FFmpegError, OSError) as error:
            raise unreadable(self._path, error) from error


def unreadable(path: Path, error: Exception) -> ImageError:
    """Return the error for a video that FFmpeg cannot read."""
    return ImageError(
        f"{path} cannot be read as a video ({getattr(error, 'strerror', None) or error}): it is damaged, "
        "cut short, or of another kind; copy or convert it again"
    )


def upright(frame: Any) -> _Frame:
    """Return the pixels of a frame, turned upright by the recorded orientation of the camera."""
    pixels: _Frame = frame.to_ndarray(format="rgb24")
    turns = round((getattr(frame, "rotation", 0) or 0) / 90) % 4
    return np.ascontiguousarray(np.rot90(pixels, turns))
