"""Videos read by slices: in any order, the frames are those of one pass."""

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
