"""The engine process: requests in a folder, events on stdout."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import toposeam as ts
from toposeam_cli.engine_seams import simplified


class Request:
    """A folder as the plug-in fills it."""

    def __init__(self, folder):
        self.folder = folder
        folder.mkdir()

    def raster(self, name, pixels, offset=(0, 0), **more):
        pixels = np.asarray(pixels)
        pixels.tofile(self.folder / f"{name}.raw")
        channels = 1 if pixels.ndim == 2 else pixels.shape[2]
        size = {"width": pixels.shape[1], "height": pixels.shape[0], "channels": channels, "dtype": str(pixels.dtype)}
        return {"file": f"{name}.raw", "name": name, "offset": list(offset), **size, **more}

    def ask(self, **request):
        (self.folder / "request.json").write_text(json.dumps({"protocol": 1, "version": ts.__version__, **request}))
        process = self.start()
        output, noise = process.communicate(timeout=120)
        assert b"Traceback" not in noise
        events = [json.loads(line) for line in output.splitlines()]
        assert events[0] == {"event": "hello", "protocol": 1, "version": ts.__version__}
        return process.returncode, events

    def start(self):
        command = [sys.executable, "-m", "toposeam_cli.engine", str(self.folder)]
        read, self.held = os.pipe()
        process = subprocess.Popen(command, stdin=read, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        os.close(read)
        return process

    def pixels(self, raster):
        pixels = np.fromfile(self.folder / raster["file"], raster["dtype"])
        return pixels.reshape(raster["height"], raster["width"], raster["channels"]).squeeze()

    def close(self):
        os.close(self.held)


@pytest.fixture
def request_folder(tmp_path):
    made = Request(tmp_path / "request")
    yield made
    made.close()


@pytest.fixture
def pair():
    """Two RGBA patches, the second 20 px to the right and 5 px below."""
    rng = np.random.default_rng(3)
    return [np.dstack([rng.integers(0, 256, (30, 40, 3)), np.full((30, 40), 255)]).astype(np.uint8) for _ in range(2)]


def result_of(answer):
    code, events = answer
    assert code == 0, events[-1]
    assert events[-1]["event"] == "result"
    return events[-1]["result"]


def message_of(answer):
    code, events = answer
    assert code == 1
    assert events[-1]["event"] == "error"
    return events[-1]["message"]


def test_stitch_is_what_core_finds(request_folder, pair):
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    result = result_of(request_folder.ask(operation="stitch", layers=layers, options={"method": "shortest-path"}))
    expected = ts.stitch(
        [ts.Layer(image=pair[0][..., :3]), ts.Layer(image=pair[1][..., :3], offset=(20, 5))], method="shortest-path"
    )  # fmt: skip
    for raster, mask, place in zip(result["masks"], expected.masks, [np.s_[:30, :40], np.s_[5:, 20:]], strict=True):
        np.testing.assert_array_equal(request_folder.pixels(raster), mask[place] * np.uint8(255))
    exact = np.array(result["seams"][0]["lines"][0]["points"]).reshape(-1, 2)
    np.testing.assert_array_equal(exact, expected.seams[0].paths[0].points)


def test_the_found_lines_applied_again_give_the_same_masks(request_folder, pair):
    layers = [request_folder.raster("a", pair[0], (-7, 3)), request_folder.raster("b", pair[1], (13, 8))]
    first = result_of(request_folder.ask(operation="stitch", layers=layers))
    found = [request_folder.pixels(raster) for raster in first["masks"]]
    for path in request_folder.folder.glob("result-*"):
        path.unlink()
    request_folder.close()
    seams = [{**seam, "touched": True} for seam in first["seams"]]
    shown = [request_folder.raster(f"shown-{name}", np.zeros((30, 40), np.uint8)) for name in "ab"]
    second = result_of(request_folder.ask(operation="restitch", layers=layers, seams=seams, shown=shown))
    for old, raster in zip(found, second["masks"], strict=True):
        np.testing.assert_array_equal(old, request_folder.pixels(raster))


@pytest.mark.parametrize("blend", ts.BLENDS)
def test_masks_and_what_blending_changes_make_the_composite_of_core(request_folder, pair, blend):
    pair[1] = np.maximum(pair[1], 60)
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    options = {"blend": blend, "blend_width": 6, "match_tones": True}
    result = result_of(request_folder.ask(operation="stitch", layers=layers, options=options))
    width = {"blend_width": 6.0} if blend in ("feather", "multiband", "gradient") else {}
    placed = [ts.Layer(image=pair[0][..., :3]), ts.Layer(image=pair[1][..., :3], offset=(20, 5))]
    expected = ts.stitch(placed, blend=blend, match_tones=True, **width)
    canvas = np.zeros((*expected.masks[0].shape, 4), np.uint8)
    for pixels, mask, place in zip(result["pixels"], result["masks"], [np.s_[:30, :40], np.s_[5:, 20:]], strict=True):
        np.copyto(canvas[place], request_folder.pixels(pixels), where=request_folder.pixels(mask)[..., None] > 0)
    assert (result["blended"] is None) == (blend == "none")
    if result["blended"]:
        over = request_folder.pixels(result["blended"])
        x, y = result["blended"]["offset"]
        part = canvas[y : y + over.shape[0], x : x + over.shape[1]]
        np.copyto(part, over, where=over[..., 3:] > 0)
    np.testing.assert_array_equal(canvas[..., :3], expected.image)


def test_progress_rises_to_the_end(request_folder):
    rng = np.random.default_rng(0)
    layers = [request_folder.raster(name, rng.random((200, 300, 4), np.float32), (x, 0)) for name, x in (("a", 0), ("b", 100))]
    _, events = request_folder.ask(operation="stitch", layers=layers)
    shares = [event["share"] for event in events if event["event"] == "progress"]
    assert len(shares) >= 3
    assert shares == sorted(shares)
    assert shares[-1] == 1


def test_a_mask_hides_what_is_black(request_folder, pair):
    mask = np.full((30, 40), 255, np.uint8)
    mask[:, :10] = 0
    layers = [
        request_folder.raster("a", pair[0]),
        request_folder.raster("b", pair[1], (20, 0), mask=request_folder.raster("m", mask)),
    ]
    result = result_of(request_folder.ask(operation="stitch", layers=layers))
    shown = request_folder.pixels(result["masks"][1])
    assert not shown[:, :10].any()
    assert shown[:, 20:].all()


def test_pixels_that_are_not_all_there_are_refused(request_folder, pair):
    raster = request_folder.raster("a", pair[0])
    (request_folder.folder / "a.raw").write_bytes(b"short")
    assert "send it again" in message_of(request_folder.ask(operation="stitch", layers=[raster, raster]))


@pytest.mark.parametrize(
    ("request_", "phrase"),
    [
        ({"operation": "stitch", "version": "0.0.1"}, "the plug-in is of TopoSeam 0.0.1"),
        ({"operation": "stitch", "protocol": 99}, "run “toposeam gimp install”"),
        ({"operation": "fly"}, "the engine has no operation 'fly'"),
        ({"operation": "stitch", "layers": []}, "at least two"),
        ({"operation": "stitch", "layers": [{"file": "../a", "width": 1, "height": 1, "channels": 1, "dtype": "uint8"}]}, "folder"),
        ({"operation": "stitch", "layers": [{"file": "a", "width": 1, "height": 1, "channels": 1, "dtype": "object"}]}, "type object"),
    ],
)
def test_bad_requests_are_one_sentence(request_folder, request_, phrase):
    message = message_of(request_folder.ask(**request_))
    assert phrase in message
    assert "\n" not in message


def test_a_full_disk_is_one_sentence(request_folder, pair):
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    (request_folder.folder / "result-0.raw").symlink_to("/dev/full")
    assert "the system refused (No space left on device); free some space" in message_of(
        request_folder.ask(operation="stitch", layers=layers)
    )


def long_request(request_folder):
    rng = np.random.default_rng(0)
    layers = [request_folder.raster(name, rng.random((900, 900, 4), np.float32), (x, 0)) for name, x in (("a", 0), ("b", 300))]
    body = {"protocol": 1, "version": ts.__version__, "operation": "stitch", "layers": layers, "options": {"method": "thesis"}}
    (request_folder.folder / "request.json").write_text(json.dumps(body))
    process = request_folder.start()
    assert b"hello" in process.stdout.readline()
    return process


def test_it_ends_and_cleans_up_when_the_asker_is_gone(request_folder):
    process = long_request(request_folder)
    os.close(request_folder.held)
    assert process.wait(timeout=30) == 3
    assert not request_folder.folder.exists()
    request_folder.held = os.open(os.devnull, os.O_RDONLY)
    process.stdout.close()
    process.stderr.close()


def test_it_shows_signs_of_life(request_folder):
    process = long_request(request_folder)
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        if b"alive" in process.stdout.readline():
            break
    else:
        pytest.fail("no sign of life")
    process.send_signal(signal.SIGKILL)
    process.communicate()


def test_simplified_lines_stay_close_and_keep_their_ends():
    rng = np.random.default_rng(1)
    steps = rng.integers(-1, 2, 400)
    x = np.cumsum(steps)
    stairs = np.column_stack([np.repeat(x, 2)[1:], np.repeat(np.arange(400), 2)[:-1]]).astype(float)
    few = simplified(stairs, False, 0.75)
    assert len(few) < len(stairs) / 2
    assert (few[[0, -1]] == stairs[[0, -1]]).all()
    for point in stairs:
        start, end = few[:-1], few[1:]
        along = np.clip(((point - start) * (end - start)).sum(1) / ((end - start) ** 2).sum(1), 0, 1)
        assert np.hypot(*(start + along[:, None] * (end - start) - point).T).min() <= 0.75 + 1e-9


def test_a_closed_line_keeps_at_least_three_points():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    assert len(simplified(square, True, 5.0)) >= 3
    ring = np.array([[np.cos(t) * 40, np.sin(t) * 40] for t in np.linspace(0, 2 * np.pi, 300, endpoint=False)])
    few = simplified(ring, True, 0.5)
    assert 10 < len(few) < 60
