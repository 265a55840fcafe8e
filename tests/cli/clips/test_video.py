"""Videos read by slices: in any order, the frames are those of one pass."""

from fractions import Fraction

import numpy as np
import pytest

from toposeam.errors import ImageError
from toposeam_cli.media.clips.reading import open_clip

av = pytest.importorskip("av")


@pytest.fixture
def video(tmp_path):
    """A video of 150 frames whose key frames lie 40 frames apart, with frames that look ahead."""
    path = tmp_path / "clip.mp4"
    y, x = np.indices((32, 48))
    with av.open(str(path), "w") as container:
        options = {"crf": "1", "g": "40", "bf": "3"}
        stream = container.add_stream("libx264", rate=25, options=options)
        stream.width, stream.height, stream.pix_fmt = 48, 32, "yuv420p"
        for t in range(150):
            gray = np.uint8(127 + 100 * np.sin((x + 2 * y + 5 * t) / 9))
            frame = av.VideoFrame.from_ndarray(np.repeat(gray[..., None], 3, axis=2), format="rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def test_frames_are_the_same_in_any_order(video):
    frames = open_clip(video, None, 10**9, 0).frames
    with av.open(str(video)) as container:
        whole = np.stack([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)])
    assert frames.shape == whole.shape
    for first, last in ((0, 150), (100, 110), (3, 9), (149, 150), (39, 42), (0, 1), (70, 75), (148, 160)):
        np.testing.assert_array_equal(frames[first:last], whole[first:last], str((first, last)))


def test_damage_further_on_is_told_in_a_sentence(video):
    frames = open_clip(video, None, 10**9, 0).frames
    video.write_bytes(video.read_bytes()[:400])
    with pytest.raises(ImageError, match="copy or convert it again"):
        frames[100:110]


def _write_avi(path, times, options):
    """Write 40 px frames, each as bright as its number says, at given times."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=20, options=options)
        stream.width, stream.height, stream.pix_fmt, stream.bit_rate = 48, 32, "yuv420p", 2_000_000
        for number, time in enumerate(times):
            gray = np.full((32, 48, 3), 40 + 4 * number, np.uint8)
            frame = av.VideoFrame.from_ndarray(gray, format="rgb24")
            frame.pts, frame.time_base = time, Fraction(1, 20)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def _numbers(frames):
    return np.rint((frames[:, 8:24, 8:40].mean(axis=(1, 2, 3)) - 40) / 4).astype(int).tolist()


def test_frames_an_avi_leaves_out_are_shown_again(tmp_path):
    path = tmp_path / "thin.avi"
    _write_avi(path, [0, 4, 5, 9, 10, 11, 17, 19], {"g": "1"})
    clip = open_clip(path, None, 10**9, 0)
    assert clip.rate == 20
    shown = [0, 0, 0, 0, 1, 2, 2, 2, 2, 3, 4, 5, 5, 5, 5, 5, 5, 6, 6, 7]
    assert _numbers(clip.frames[:]) == shown


class _Swapped:
    """A container whose frames come as they are shown, with the times of neighbours exchanged."""

    def __init__(self, container):
        self._container, self.streams = container, container.streams
        self.demux, self.seek = container.demux, container.seek

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._container.close()

    def decode(self, stream):
        frames = self._container.decode(stream)
        for one, other in zip(frames, frames, strict=True):
            one.pts, other.pts = other.pts, one.pts
            yield from (one, other)


def test_frames_whose_times_are_out_of_order_are_found(tmp_path, monkeypatch):
    path = tmp_path / "packed.avi"
    _write_avi(path, range(40), {"g": "40"})
    opened = av.open
    monkeypatch.setattr(av, "open", lambda *given, **named: _Swapped(opened(*given, **named)))
    clip = open_clip(path, None, 10**9, 0)
    assert _numbers(clip.frames[:]) == list(range(40))
    assert _numbers(clip.frames[20:30]) == list(range(20, 30))
