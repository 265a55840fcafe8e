"""``toposeam loop``: clips in every format in and out, and what is refused."""

import itertools
import json
import shutil
import socketserver
import sys
import threading
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from toposeam_cli.media.clips.cut import Cut, Duration
from toposeam_cli.media.clips.reading import read_clip
from toposeam_cli.media.clips.sound import looped_sound
from toposeam_cli.media.pictures.picture import read_picture


def frames(count=24, size=(32, 40)):
    """Smooth noise that drifts, (T, H, W, 3) uint8."""
    rng = np.random.default_rng(0)
    texture = ndimage.gaussian_filter(rng.standard_normal((size[0], size[1] + 2 * count, 3)), (2, 2, 0))
    texture = (255 * (texture - texture.min()) / np.ptp(texture)).astype(np.uint8)
    return np.stack([texture[:, 2 * t : 2 * t + size[1]] for t in range(count)])


def animated(path, clip, duration=40, **options):
    first, *rest = [Image.fromarray(frame) for frame in clip]
    first.save(path, save_all=True, append_images=rest, duration=duration, loop=0, **options)
    return path


def shown(path):
    with Image.open(path) as picture:
        durations = []
        pictures = []
        for index in range(picture.n_frames):
            picture.seek(index)
            pictures.append(np.asarray(picture.convert("RGB")))
            durations.append(picture.info["duration"])
        return np.stack(pictures), durations


@pytest.fixture
def clip(tmp_path):
    return animated(tmp_path / "clip.webp", frames(), lossless=True)


@pytest.fixture
def video(tmp_path):
    av = pytest.importorskip("av")

    def make(name="clip.mp4", clip=None, times=None, sound=False):
        path = tmp_path / name
        with av.open(str(path), "w") as container:
            stream = container.add_stream("libx264", rate=25, options={"crf": "1"})
            stream.width, stream.height, stream.pix_fmt = 40, 32, "yuv420p"
            voice = container.add_stream("aac", rate=44100) if sound else None
            for index, pixels in enumerate(frames() if clip is None else clip):
                frame = av.VideoFrame.from_ndarray(pixels, format="rgb24")
                if times is not None:
                    frame.pts, frame.time_base = times[index], Fraction(1, 25)
                container.mux(stream.encode(frame))
            container.mux(stream.encode())
            if voice is not None:
                silence = np.zeros((1, 1024), np.float32)
                quiet = av.AudioFrame.from_ndarray(silence, format="fltp", layout="mono")
                quiet.sample_rate = 44100
                container.mux(voice.encode(quiet))
                container.mux(voice.encode())
        return path

    return make


def test_a_webp_becomes_a_loop_of_its_own_frames(toposeam, clip, tmp_path):
    ran = toposeam(
        *("loop", clip, "-o", tmp_path / "loop.webp", "--length", "12", "--transition", "5", "--no-level")
    )
    assert ran.code == 0, ran
    assert "12 frames (0.48 s)" in ran.out
    made, durations = shown(tmp_path / "loop.webp")
    assert made.shape == (12, 32, 40, 3)
    assert set(durations) == {40}
    given = frames()
    for pixels in made:  # each pixel is that of some frame: nothing is blended
        assert (pixels[None] == given).all(axis=3).any(axis=0).all()


def test_a_part_of_a_clip_is_read_at_a_smaller_size(toposeam, clip, tmp_path):
    cut = ("--from", "0.16s", "--to", "20", "--scale", "0.5", "--max-megapixels", "0.006", "--json")
    ran = toposeam("loop", clip, "-o", tmp_path / "part", *cut)
    assert ran.code == 0, ran
    said = json.loads(ran.out)
    made = [read_picture(file).pixels for file in sorted((tmp_path / "part").iterdir())]
    assert said["frames"] == len(made) <= 16
    assert made[0].shape == (16, 20, 3)
    assert set(said) >= {"level", "shows", "look_at_frame", "camera_moved", "jumps", "seconds"}
    ran = toposeam("loop", clip, "-o", tmp_path / "none.gif", "--from", "3s")
    assert ran.code == 1
    assert "no frames between --from and --to" in ran.err
    ran = toposeam("loop", clip, "-o", tmp_path / "none.gif", "--max-megapixels", "0.006")
    assert "read less of it (--from, --to, --scale)" in ran.err


def test_a_part_of_a_video_and_of_a_folder_is_read(toposeam, video, tmp_path):
    part = read_clip(video(), None, 10**6, Cut(first=Duration(4, False), last=Duration(0.5, True)))
    assert part.frames.shape[0] == 9  # frames 4 to 12, at 25 a second
    whole = read_clip(tmp_path / "clip.mp4", None, 10**6)
    np.testing.assert_array_equal(part.frames, whole.frames[4:13])
    folder = tmp_path / "deep"
    folder.mkdir()
    for index, frame in enumerate(frames(10)[..., 0].astype(np.uint16) * 257):
        Image.fromarray(frame).save(folder / f"{index}.png")
    part = read_clip(folder, None, 10**6, Cut(first=Duration(3, False), scale=0.25))
    assert part.frames.shape == (7, 8, 10)
    assert part.frames.dtype == np.uint16


def test_a_moving_camera_is_said(toposeam, tmp_path):
    moving = animated(tmp_path / "pan.webp", frames(40, size=(32, 40)), lossless=True)
    ran = toposeam("loop", moving, "-o", tmp_path / "pan.gif")
    assert ran.code == 0, ran
    assert "the whole picture moves" in ran.err
    assert "--stabilise takes that out" in ran.err


@pytest.mark.medium
@pytest.mark.medium
def test_a_trembling_camera_is_taken_out(toposeam, tmp_path):
    rng = np.random.default_rng(0)
    y, x = np.indices((80, 100))
    ground = np.repeat(rng.integers(0, 200, (10, 13)), 10, 0).repeat(10, 1)
    (tmp_path / "frames").mkdir()
    for t in range(24):
        picture = np.where(
            (y - 50) ** 2 + (x - 60) ** 2 < 200, 120 + 90 * np.cos(t * np.pi / 4), ground[:80, :100]
        )
        down, right = rng.integers(0, 4, 2)
        Image.fromarray(picture[down : down + 70, right : right + 90].astype(np.uint8)).save(
            tmp_path / f"frames/{t:02}.png"
        )
    ran = toposeam("loop", tmp_path / "frames", "-o", tmp_path / "out", "--stabilise")
    assert ran.code == 0, ran
    assert "the camera moves" in ran.err
    assert "is taken out" in ran.err
    with Image.open(min((tmp_path / "out").iterdir())) as picture:
        assert "{} × {} px are left".format(*picture.size) in ran.err


def test_apng_and_folders_keep_every_bit(toposeam, clip, tmp_path):
    for output in ("loop.png", "loop"):
        assert toposeam("loop", clip, "-o", tmp_path / output, "--length", "12").code == 0
    files = sorted((tmp_path / "loop").iterdir())
    assert [file.name for file in files] == [f"{index:04d}.png" for index in range(12)]
    made, _ = shown(tmp_path / "loop.png")
    for file, pixels in zip(files, made, strict=True):
        np.testing.assert_array_equal(read_picture(file).pixels, pixels)
    again = toposeam("loop", tmp_path / "loop", "-o", tmp_path / "again.png", "--transition", "3")
    assert again.code == 0, again


def test_gifs_keep_their_length_in_hundredths(toposeam, clip, tmp_path):
    options = ["--fps", "30", "--length", "12"]
    assert toposeam("loop", clip, "-o", tmp_path / "loop.gif", *options).code == 0
    made, durations = shown(tmp_path / "loop.gif")
    assert 8 <= len(made) <= 12  # equal ones are shown longer
    assert sum(durations) == 400


def test_deep_frames_stay_deep(toposeam, tmp_path):
    folder = tmp_path / "deep"
    folder.mkdir()
    for index, frame in enumerate(frames(16)[..., 0].astype(np.uint16) * 257 + 3):
        Image.fromarray(frame).save(folder / f"{index + 1}.png")  # 10 comes after 9
    assert (
        toposeam(
            "loop", folder, "-o", tmp_path / "out", "--length", "8", "--transition", "4", "--no-level"
        ).code
        == 0
    )
    made = [read_picture(file).pixels for file in sorted((tmp_path / "out").iterdir())]
    assert made[0].dtype == np.uint16
    assert all((frame % 257 == 3).all() for frame in made)
    steps = [int(np.abs(one.astype(int) - other).mean()) for one, other in itertools.pairwise(made)]
    assert max(steps) < 3 * np.median(steps)  # in order


def test_videos_in_and_out(toposeam, video, tmp_path):
    ran = toposeam(
        "loop", video(), "-o", tmp_path / "loop.mp4", "--length", "12", "--mesh", tmp_path / "s.ply"
    )
    assert ran.code == 0, ran
    assert (tmp_path / "s.ply").read_bytes().startswith(b"ply")
    assert toposeam("loop", tmp_path / "loop.mp4", "-o", tmp_path / "a.webm", "--transition", "3").code == 0
    assert (tmp_path / "a.webm").stat().st_size > 500


def test_odd_sides_are_filled_up_for_videos(toposeam, video, clip, tmp_path):
    av = pytest.importorskip("av")
    odd = animated(tmp_path / "odd.webp", frames(16, (31, 39)), lossless=True)
    assert toposeam("loop", odd, "-o", tmp_path / "odd.mp4", "--length", "8", "--transition", "4").code == 0
    with av.open(str(tmp_path / "odd.mp4")) as made:
        stream = made.streams.video[0]
        assert (stream.width, stream.height) == (40, 32)
        assert sum(1 for _ in made.decode(stream)) == 8


def test_sound_is_left_out_with_a_sentence(toposeam, video, tmp_path):
    ran = toposeam("loop", video(sound=True), "-o", tmp_path / "loop.gif", "--length", "12")
    assert ran.code == 0, ran
    assert "has sound, which is left out" in ran.err


def test_seconds_ranges_stills_and_growth(toposeam, clip, tmp_path):
    mask = np.zeros((32, 40), np.uint8)
    mask[:, :20] = 255
    Image.fromarray(mask).save(tmp_path / "still.png")
    options = ["--length", "0.3s-0.4s", "--still", tmp_path / "still.png", "--level", "--cost", "colour"]
    assert toposeam("loop", clip, "-o", tmp_path / "still.webp", *options).code == 0
    made, _ = shown(tmp_path / "still.webp")
    assert 8 <= len(made) <= 10
    assert (made[:, :, :20] == made[:1, :, :20]).all()
    assert toposeam("loop", clip, "-o", tmp_path / "long.webp", "--grow", "2s").code == 0
    assert len(shown(tmp_path / "long.webp")[0]) >= 50


def test_uneven_frames_need_a_rate(toposeam, tmp_path):
    uneven = animated(tmp_path / "u.webp", frames(), [40] * 12 + [120] * 12, lossless=True)
    toposeam("loop", uneven, "-o", tmp_path / "o.webp").fails("say with --fps")
    assert not (tmp_path / "o.webp").exists()
    assert toposeam("loop", uneven, "-o", tmp_path / "o.webp", "--fps", "25").code == 0


def test_uneven_videos_need_a_rate(toposeam, video, tmp_path):
    path = video(times=[*range(12), *range(12, 60, 4)])
    toposeam("loop", path, "-o", tmp_path / "o.webp").fails("say with --fps")
    assert toposeam("loop", path, "-o", tmp_path / "o.webp", "--fps", "25").code == 0


def test_short_and_single(toposeam, clip, tmp_path):
    out = tmp_path / "o.webp"
    one = tmp_path / "one.png"
    Image.fromarray(frames()[0]).save(one)
    toposeam("loop", one, "-o", out).fails("holds one frame")
    toposeam("loop", clip, "-o", out, "--length", "10s").fails("do not fit")
    three = animated(tmp_path / "three.webp", frames(3), lossless=True)
    toposeam("loop", three, "-o", out).fails("a loop needs at least 4")
    toposeam("loop", clip, "-o", out, "--length", "soon").fails("write frames or seconds", 2)
    assert not out.exists()


def test_frames_of_unlike_size(toposeam, tmp_path):
    folder = tmp_path / "mixed"
    folder.mkdir()
    for index, frame in enumerate(frames(6)):
        Image.fromarray(frame[: 32 - (index == 4)]).save(folder / f"{index}.png")
    toposeam("loop", folder, "-o", tmp_path / "o.webp").fails("make all frames of one size")
    (tmp_path / "empty").mkdir()
    toposeam("loop", tmp_path / "empty", "-o", tmp_path / "o.webp").fails("holds no frames")


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_truncated_files(toposeam, video, clip, tmp_path, share):
    whole = [clip, animated(tmp_path / "c.gif", frames()), animated(tmp_path / "c.png", frames()), video()]
    for path in whole:
        content = path.read_bytes()
        cut = tmp_path / f"cut{path.suffix}"
        cut.write_bytes(content[: int(share * len(content))])
        ran = toposeam("loop", cut, "-o", tmp_path / "o.webp", "--length", "12", "--transition", "4")
        assert ran.code == 1, (path, ran)
        ran.is_one_sentence()
        assert not (tmp_path / "o.webp").exists()


def test_no_clip_at_all(toposeam, tmp_path):
    (tmp_path / "text.mp4").write_text("not a video")
    pytest.importorskip("av")
    toposeam("loop", tmp_path / "text.mp4", "-o", tmp_path / "o.webp").fails("cannot be read as a video")
    toposeam("loop", tmp_path / "none.mp4", "-o", tmp_path / "o.webp").fails("there is no file")


def test_without_the_extra(toposeam, video, clip, tmp_path, monkeypatch):
    path = video()
    monkeypatch.setitem(sys.modules, "av", None)
    toposeam("loop", path, "-o", tmp_path / "o.webp").fails("pip install av")
    toposeam("loop", clip, "-o", tmp_path / "o.mp4").fails("pip install av")


def test_outputs_that_cannot_be(toposeam, clip, tmp_path):
    toposeam("loop", clip, "-o", tmp_path / "o.avi").fails("use one of")
    toposeam("loop", clip, "-o", clip).fails("--force")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "x").touch()
    toposeam("loop", clip, "-o", tmp_path / "full").fails("not empty")
    toposeam("loop", clip, "-o", tmp_path / "no" / "frames").fails("there is no folder")
    toposeam("loop", clip, "-o", tmp_path / "o.webp", "--max-megapixels", "0.01").fails("--max-megapixels")
    toposeam("loop", clip, "-o", tmp_path / "o.webp", "--still", clip.with_name("s.png")).fails("s.png")
    assert not list(tmp_path.glob(".toposeam*"))


def test_two_clips_that_overlap_in_time_are_joined(toposeam, tmp_path):
    whole = frames()
    a = animated(tmp_path / "a.webp", whole[:16], lossless=True)
    b = animated(tmp_path / "b.webp", whole[8:, 4:, 6:], lossless=True)
    ran = toposeam("stitch", a, b, "--offset", "8,6,4", "-o", tmp_path / "both.png")
    assert ran.code == 0, ran
    assert "24 frames of 40 × 32 px" in ran.out
    made, _ = shown(tmp_path / "both.png")
    np.testing.assert_array_equal(made[:16], whole[:16])
    np.testing.assert_array_equal(made[16:, 4:, 6:], whole[16:, 4:, 6:])


def test_clips_that_cannot_be_joined(toposeam, clip, tmp_path):
    out = ["-o", tmp_path / "o.webp"]
    slow = animated(tmp_path / "slow.webp", frames(), 80, lossless=True)
    toposeam("stitch", clip, slow, "--offset", "8,0,0", *out).fails("convert one of them")
    toposeam("stitch", clip, clip, "--offset", "30,0,0", *out).fails("check the offset: frames, x and y")
    toposeam("stitch", clip, "--offset", "8,0,0", *out).fails("joins two clips")
    toposeam("stitch", clip, clip, "--offset", "8,0,0", "--align", *out).fails("--align is for pictures")
    toposeam("compare", clip, clip, "--offset", "8,0,0").fails("is for two clips")
    still = tmp_path / "still.png"
    Image.fromarray(frames()[0]).save(still)
    toposeam("stitch", still, clip, "--offset", "8,0,0", *out).fails("two pictures take X,Y", 2)
    assert not (tmp_path / "o.webp").exists()


def test_the_last_video_frame_lasts_as_long_as_the_others(video):
    path = video(clip=frames(10))
    doubled = read_clip(path, Fraction(50), 10**9)
    assert (len(doubled.frames), doubled.rate) == (20, 50)
    assert len(read_clip(path, None, 10**9).frames) == 10


def test_a_video_in_a_code_that_nobody_knows(toposeam, video):
    clip = video()
    content = clip.read_bytes()
    for tag in (b"avc1", b"mp4v", b"avcC", b"esds"):
        content = content.replace(tag, b"zzzz")
    clip.write_bytes(content)
    toposeam("loop", clip, "-o", clip.with_name("o.gif")).fails("does not know")


def test_a_rate_or_a_length_that_makes_too_many_frames(toposeam, tmp_path):
    slow = animated(tmp_path / "slow.gif", frames(4), 600_000)
    out = ["-o", tmp_path / "o.gif"]
    toposeam("loop", slow, "--fps", "1000", *out).fails("frames a second has 2")
    toposeam("loop", slow, "--fps", "1e-300", *out).fails("--fps", 2)
    toposeam("loop", slow, "--grow", "9000000", *out).fails("the grown clip has 9000000 frames")


@pytest.fixture
def listener():
    """Port of a server on this machine that sends everybody away, and the list of who came."""
    came = []

    class Door(socketserver.BaseRequestHandler):
        def handle(self):
            came.append(self.client_address)

    with socketserver.TCPServer(("127.0.0.1", 0), Door) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        yield server.server_address[1], came
        server.shutdown()


def test_names_of_clips_open_no_connection(toposeam, video, tmp_path, monkeypatch, listener):
    monkeypatch.chdir(tmp_path)
    video("clip.mp4")
    port, came = listener
    away = Path(f"http:/127.0.0.1:{port}")
    away.mkdir(parents=True)
    for name in (f"tcp:127.0.0.1:{port}.mp4", f"{away}/x.mp4", f"{away}/loop.mp4"):
        shutil.copy("clip.mp4", name)
        ran = toposeam("loop", name, "-o", away / "made.mp4", "--length", "12", "--force")
        assert not came, name
        assert ran.code == 0, ran
    assert (away / "made.mp4").stat().st_size > 500
    joined = toposeam("stitch", f"tcp:127.0.0.1:{port}.mp4", "clip.mp4", "--offset", "12,0,0", "-o", "j.webp")
    assert not came
    assert joined.code == 0, joined


def test_clips_with_a_time_in_their_name_are_read(toposeam, video, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    video("clip.mp4")
    for name in ("2026-11-25T12:30:05.mp4", "file:x.mp4", "pipe:0.mp4", "concat:a|b.mp4", "-i.mp4", "%d.mp4"):
        shutil.copy("clip.mp4", name)
        ran = toposeam("loop", "-o", tmp_path / "o.mp4", "--length", "12", "--force", "--", name)
        assert ran.code == 0, (name, ran)


def test_cuts_are_said(toposeam, tmp_path):
    shots = np.concatenate([frames(24) // 8, 220 + frames(16) // 8])
    cut = animated(tmp_path / "cut.webp", shots, lossless=True)
    ran = toposeam("loop", cut, "-o", tmp_path / "loop.webp", "--transition", "5")
    assert ran.code == 0, ran
    assert "has cuts; the loop stays in the shot of frames 0 to 23" in ran.err


@pytest.mark.parametrize("suffix", ["mp4", "webm"])
def test_sound_is_kept_and_faded_where_the_loop_jumps(toposeam, video, tmp_path, suffix):
    av = pytest.importorskip("av")
    path = tmp_path / "heard.mkv"
    t = np.arange(44100 * 2, dtype=np.float32) / 44100
    with av.open(str(video())) as given, av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25, options={"crf": "1"})
        stream.width, stream.height, stream.pix_fmt = 40, 32, "yuv420p"
        voice = container.add_stream("flac", rate=44100, layout="mono")
        for frame in given.decode(video=0):
            container.mux(stream.encode(frame.reformat(format="yuv420p")))
        container.mux(stream.encode())
        tone = np.int16(20000 * np.sin(2 * np.pi * 440 * t))[np.newaxis]
        frame = av.AudioFrame.from_ndarray(tone, format="s16", layout="mono")
        frame.sample_rate, frame.pts, frame.time_base = 44100, 0, Fraction(1, 44100)
        container.mux(voice.encode(frame))
        container.mux(voice.encode())
    output = tmp_path / f"loop.{suffix}"
    ran = toposeam("loop", path, "-o", output, "--length", "12", "--transition", "4")
    assert ran.code == 0, ran
    assert "left out" not in ran.err
    with av.open(str(output)) as made:
        assert len(made.streams.audio) == 1
        heard = np.concatenate([frame.to_ndarray()[0] for frame in made.decode(audio=0)])
    assert len(heard) == pytest.approx(0.48 * 48000, abs=2100)
    loud = heard[2000:20000]
    spectrum = np.abs(np.fft.rfft(loud * np.hanning(len(loud))))
    assert np.argmax(spectrum) * 48000 / len(loud) == pytest.approx(440, abs=5)
    assert 0.3 < np.abs(loud).max() < 1.0


def test_sound_fits_at_rates_that_are_no_whole_numbers(video):
    path = video(sound=True)
    rate = Fraction(30000, 1001)
    for leaves in range(6, 16):
        heard = looped_sound(path, Fraction(0), rate, [(leaves, 1)], 3)
        assert abs(heard.samples.shape[1] - (leaves - 1) / rate * 48000) <= 1
