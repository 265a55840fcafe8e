"""The engine process: requests in a folder, events on stdout."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam_engine.serving import MARKER, PROTOCOL


class Request:
    """A folder as the plug-in fills it."""

    def __init__(self, folder):
        self.folder = folder
        folder.mkdir()
        (folder / MARKER).write_text("7e57")

    def raster(self, name, pixels, offset=(0, 0), **more):
        pixels = np.asarray(pixels)
        pixels.tofile(self.folder / f"{name}.raw")
        channels = 1 if pixels.ndim == 2 else pixels.shape[2]
        size = {
            "width": pixels.shape[1],
            "height": pixels.shape[0],
            "channels": channels,
            "dtype": str(pixels.dtype),
        }
        return {"file": f"{name}.raw", "name": name, "at": list(offset), **size, **more}

    def ask(self, **request):
        (self.folder / "request.json").write_text(
            json.dumps({"protocol": PROTOCOL, "version": ts.__version__, **request})
        )
        process = self.start()
        output, noise = process.communicate(timeout=120)
        assert b"Traceback" not in noise
        events = [json.loads(line) for line in output.splitlines()]
        assert events[0] == {"event": "hello", "protocol": PROTOCOL, "version": ts.__version__}
        return process.returncode, events

    def start(self):
        command = [sys.executable, "-m", "toposeam_engine", str(self.folder)]
        read, self.held = os.pipe()
        os.write(self.held, b"7e57\n")
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
    return [
        np.dstack([rng.integers(0, 256, (30, 40, 3)), np.full((30, 40), 255)]).astype(np.uint8)
        for _ in range(2)
    ]


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
    result = result_of(
        request_folder.ask(operation="stitch", layers=layers, options={"method": "shortest-path"})
    )
    expected = ts.stitch(
        [ts.Layer(image=pair[0][..., :3]), ts.Layer(image=pair[1][..., :3], at=(20, 5))],
        method="shortest-path",
    )
    for raster, mask, place in zip(
        result["masks"], expected.masks, [np.s_[:30, :40], np.s_[5:, 20:]], strict=True
    ):
        np.testing.assert_array_equal(request_folder.pixels(raster), mask[place] * np.uint8(255))
    (line,) = result["seams"][0]["lines"]
    np.testing.assert_array_equal(np.array(line["points"]).reshape(-1, 2), expected.seams[0].paths[0].points)
    assert len(line["pieces"]) == len(line["curves"])


@pytest.mark.parametrize("place", [(-15, -9), (12, -6), (18, -27)])
def test_a_selection_that_reaches_over_the_layers_keeps_the_seam_within(request_folder, pair, place):
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    selected = np.full((60, 60), 255, np.uint8)
    selected[:, -3:] = 0
    selection = request_folder.raster("selection", selected, place)
    canvas = np.zeros((35, 60), bool)
    rows, columns = slice(max(place[1], 0), place[1] + 60), slice(max(place[0], 0), place[0] + 57)
    canvas[rows, columns] = True
    layers_of_core = [ts.Layer(pair[0][..., :3]), ts.Layer(pair[1][..., :3], at=(20, 5))]
    expected = ts.stitch(layers_of_core, avoid=~canvas)
    result = result_of(request_folder.ask(operation="stitch", layers=layers, selection=selection))
    for raster, mask, part in zip(
        result["masks"], expected.masks, [np.s_[:30, :40], np.s_[5:, 20:]], strict=True
    ):
        np.testing.assert_array_equal(request_folder.pixels(raster) > 0, mask[part])


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
    placed = [ts.Layer(image=pair[0][..., :3]), ts.Layer(image=pair[1][..., :3], at=(20, 5))]
    expected = ts.stitch(placed, blend=blend, match_tones=True, **width)
    canvas = np.zeros((*expected.masks[0].shape, 4), np.uint8)
    for pixels, mask, place in zip(
        result["pixels"], result["masks"], [np.s_[:30, :40], np.s_[5:, 20:]], strict=True
    ):
        np.copyto(
            canvas[place], request_folder.pixels(pixels), where=request_folder.pixels(mask)[..., None] > 0
        )
    assert (result["blended"] is None) == (blend == "none")
    if result["blended"]:
        over = request_folder.pixels(result["blended"])
        x, y = result["blended"]["at"]
        part = canvas[y : y + over.shape[0], x : x + over.shape[1]]
        np.copyto(part, over, where=over[..., 3:] > 0)
    np.testing.assert_array_equal(canvas[..., :3], expected.image)


def test_progress_rises_to_the_end(request_folder):
    rng = np.random.default_rng(0)
    layers = [
        request_folder.raster(name, rng.random((200, 300, 4), np.float32), (x, 0))
        for name, x in (("a", 0), ("b", 100))
    ]
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
        (
            {
                "operation": "stitch",
                "layers": [{"file": "../a", "width": 1, "height": 1, "channels": 1, "dtype": "uint8"}],
            },
            "folder",
        ),
        (
            {
                "operation": "stitch",
                "layers": [{"file": "a", "width": 1, "height": 1, "channels": 1, "dtype": "object"}],
            },
            "type object",
        ),
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
    layers = [
        request_folder.raster(name, rng.random((900, 900, 4), np.float32), (x, 0))
        for name, x in (("a", 0), ("b", 300))
    ]
    body = {
        "protocol": PROTOCOL,
        "version": ts.__version__,
        "operation": "stitch",
        "layers": layers,
        "options": {"method": "thesis"},
    }
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


def engine(folder, stdin):
    return subprocess.run(
        [sys.executable, "-m", "toposeam_engine", str(folder)], input=stdin, capture_output=True, timeout=60
    )


@pytest.mark.parametrize(
    "stdin", [b"", b"\n", b"7e57\n", b"wrong\n" * 1000], ids=["none", "empty", "7e57", "long"]
)
def test_a_folder_that_is_no_request_is_refused_and_left_untouched(tmp_path, stdin):
    (tmp_path / "photo.jpg").write_bytes(b"precious")
    (tmp_path / "request.json").write_text("{}")
    answer = engine(tmp_path, stdin)
    assert answer.returncode == 1
    assert b"left untouched" in answer.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["photo.jpg", "request.json"]


@pytest.mark.parametrize("marker", [b"", b"another", b"7e57\n"])
@pytest.mark.parametrize("stdin", [b"", b"7e57\n"])
def test_a_request_folder_of_somebody_else_is_left_untouched(tmp_path, marker, stdin):
    (tmp_path / MARKER).write_bytes(marker)
    answer = engine(tmp_path, stdin)
    assert answer.returncode == 1
    assert [path.name for path in tmp_path.iterdir()] == [MARKER]


def test_a_marker_that_is_a_link_is_none(tmp_path):
    (tmp_path / "elsewhere").write_text("7e57")
    (tmp_path / "request").mkdir()
    (tmp_path / "request" / MARKER).symlink_to(tmp_path / "elsewhere")
    assert b"left untouched" in engine(tmp_path / "request", b"7e57\n").stdout
    assert (tmp_path / "request").is_dir()


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


def test_aligned_layers_come_with_their_places(request_folder):
    rng = np.random.default_rng(4)
    whole = np.kron(rng.integers(0, 256, (30, 45, 3)), np.ones((4, 4, 1))).astype(np.uint8)
    parts = [
        np.dstack([part, np.full(part.shape[:2], 255, np.uint8)]) for part in (whole[:, :100], whole[:, 60:])
    ]
    layers = [request_folder.raster("a", parts[0]), request_folder.raster("b", parts[1], (63, -5))]
    result = result_of(request_folder.ask(operation="stitch", layers=layers, options={"places": "near"}))
    assert result["places"] == [[0, 0], [60, 0]]
    shown = [request_folder.pixels(raster) > 0 for raster in result["masks"]]
    assert (shown[0].sum() + shown[1].sum()) == 120 * 180


def test_layers_that_lie_anywhere_are_put_where_they_belong(request_folder):
    rng = np.random.default_rng(4)
    whole = ndimage.gaussian_filter(rng.random((160, 260, 3)), (2, 2, 0))
    whole = (255 * (whole - whole.min()) / np.ptp(whole)).astype(np.uint8)
    whole = np.dstack([whole, np.full(whole.shape[:2], 255, np.uint8)])
    parts = whole[20:, 90:], whole[:, :160]
    layers = [request_folder.raster("a", parts[0], (30, 40)), request_folder.raster("b", parts[1], (500, 7))]
    result = result_of(request_folder.ask(operation="stitch", layers=layers, options={"places": "anywhere"}))
    assert result["places"] == [[90, 40], [0, 20]]  # the first would have lain at 30, the other then at -60
    assert "pixels" not in result  # nothing was turned
    layers[1] = request_folder.raster("c", np.full_like(parts[1], 90), (0, 0))
    refused = request_folder.ask(operation="stitch", layers=layers, options={"places": "anywhere"})
    assert "fits none of the other pictures" in message_of(refused)


def test_a_patch_is_divided_anew_by_its_path(request_folder, pair):
    below = np.dstack([np.zeros((60, 60, 3), np.uint8), np.full((60, 60), 255, np.uint8)])
    layers = [request_folder.raster("below", below), request_folder.raster("patch", pair[0], (10, 15))]
    square = {"points": [12, 17, 30, 17, 30, 40, 12, 40], "closed": True}
    seams = [{"pair": [0, 1], "name": "below : patch", "lines": [square], "touched": True}]
    result = result_of(request_folder.ask(operation="restitch", layers=layers, seams=seams, shown=[]))
    expected = np.zeros((30, 40), bool)
    expected[2:25, 2:20] = True
    np.testing.assert_array_equal(request_folder.pixels(result["masks"][1]) > 0, expected)


def warm(*wanted):
    command = [sys.executable, "-m", "toposeam_engine", "-", *wanted]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def tell(process, request_folder, **request):
    """Ask a warm engine; what it answers in the end."""
    body = {"protocol": PROTOCOL, "version": ts.__version__, "operation": "preview", **request}
    (request_folder.folder / "request.json").write_text(json.dumps(body))
    nonce = (request_folder.folder / MARKER).read_text()
    process.stdin.write(f"{request_folder.folder}\n{nonce}\n".encode())
    process.stdin.flush()
    for line in process.stdout:
        event = json.loads(line)
        if event["event"] in ("result", "error"):
            return event
    raise AssertionError("it ended")


def test_a_warm_engine_is_told_one_folder_after_another(tmp_path, request_folder, pair):
    request_folder.held = os.open(os.devnull, os.O_RDONLY)
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    request = {"of": "stitch", "scale": 0.5, "layers": layers}
    placed = [ts.Layer(pair[0][..., :3]), ts.Layer(pair[1][..., :3], at=(20, 5))]
    with warm() as process:
        for width in (8.0, 12.0):
            options = {"blend": "feather", "blend_width": width}
            answer = tell(process, request_folder, **request, options=options)
            shown = request_folder.pixels(answer["result"]["picture"])
            expected = ts.stitch(placed, blend="feather", blend_width=width / 2)
            np.testing.assert_array_equal(shown[..., :3], ts.draw_seams(expected.image, expected.seams))
        refused = tell(process, request_folder, **request, options={"blend": "glue"})
        assert "blend" in refused["message"]
        (tmp_path / "another").mkdir()
        process.stdin.write(f"{tmp_path / 'another'}\nwrong\n".encode())
        process.stdin.flush()
        assert b"left untouched" in process.stdout.readline()
        answer = tell(process, request_folder, **request, options={"blend": "none"})
        assert answer["event"] == "result"
        process.stdin.close()
        assert process.wait(timeout=60) == 0
    assert request_folder.folder.is_dir()
    assert (tmp_path / "another").is_dir()


def test_a_warm_engine_ends_with_its_asker(request_folder):
    rng = np.random.default_rng(0)
    layers = [
        request_folder.raster(name, rng.random((900, 900, 4), np.float32), (x, 0))
        for name, x in (("a", 0), ("b", 300))
    ]
    options = {"method": "thesis"}
    body = {"protocol": PROTOCOL, "version": ts.__version__, "operation": "stitch", "options": options}
    (request_folder.folder / "request.json").write_text(json.dumps({**body, "layers": layers}))
    request_folder.held = os.open(os.devnull, os.O_RDONLY)
    with warm() as process:
        process.stdin.write(f"{request_folder.folder}\n7e57\n".encode())
        process.stdin.flush()
        while b"progress" not in process.stdout.readline():
            pass
        process.stdin.close()
        assert process.wait(timeout=60) == 3
    assert not request_folder.folder.exists()


def test_a_warm_engine_that_is_not_needed_goes():
    with warm() as process:
        output, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert b"result" not in output


@pytest.mark.parametrize(
    "of", ["stitch", "patch", "synthesize", "make_tileable", "fill", "motif", "repeat", "loop"]
)
def test_an_engine_can_prepare_for_every_preview(of):
    with warm(of) as process:
        output, noise = process.communicate(timeout=120)
    assert process.returncode == 0, output
    assert not noise
    assert b"error" not in output


def test_a_preview_of_an_animation_has_its_frames_one_below_the_other(request_folder):
    clip = np.random.default_rng(0).integers(0, 256, (10, 12, 16, 4)).astype(np.uint8)
    clip[..., 3] = 255
    layers = [request_folder.raster(str(index), frame) for index, frame in enumerate(clip)]
    options = {"length": 6, "transition": 2, "level": False}
    request = {"of": "loop", "scale": 0.5, "layers": layers, "options": options}
    shown = request_folder.pixels(result_of(request_folder.ask(operation="preview", **request))["picture"])
    expected = ts.loop(clip[..., :3], length=6, transition=2).frames
    np.testing.assert_array_equal(shown[..., :3].reshape(6, 12, 16, 3), expected)


@pytest.mark.parametrize(
    ("of", "options", "shape"),
    [
        (
            "synthesize",
            {"width": 120, "height": 100, "patch": 40, "overlap": 0, "tileable": "none", "seed": 1},
            (50, 60),
        ),
        ("make_tileable", {"band": 16, "tileable": "both", "seed": 1}, (120, 160)),
        ("fill", {"from": "around", "patch": 24, "overlap": 0, "band": 0, "seed": 1}, (60, 80)),
    ],
)
def test_previews_of_textures(request_folder, of, options, shape):
    pixels = np.dstack([np.random.default_rng(0).integers(0, 256, (60, 80, 3)), np.full((60, 80), 255)])
    layer = request_folder.raster("layer", pixels.astype(np.uint8))
    selected = np.zeros((60, 80), np.uint8)
    selected[20:32, 30:44] = 255
    selection = request_folder.raster("selection", selected) if of == "fill" else None
    result = result_of(
        request_folder.ask(
            operation="preview", of=of, scale=0.5, layer=layer, selection=selection, options=options
        )
    )
    assert request_folder.pixels(result["picture"]).shape == (*shape, 4)


def test_a_preview_of_a_motif_is_small_and_repeats(request_folder):
    options = {
        "size": 1024,
        "repeat": "p4m",
        "layers": 2,
        "palette": "random",
        "mass": 0.0,
        "penalty": 3.0,
        "iterations": 500,
        "seed": 1,
        "base_strength": 0.7,
    }
    request = {"operation": "preview", "of": "motif", "scale": 1.0, "layer": None, "options": options}
    shown = request_folder.pixels(result_of(request_folder.ask(**request))["picture"])
    assert shown.shape == (192, 192, 4)
    np.testing.assert_array_equal(shown[:96], shown[96:])


def test_a_preview_of_a_large_texture_shows_a_part_of_it(request_folder):
    pixels = np.random.default_rng(0).integers(0, 256, (60, 80, 4)).astype(np.uint8)
    pixels[..., 3] = 255
    layer = request_folder.raster("layer", pixels)
    options = {"width": 1000, "height": 800, "patch": 24, "overlap": 0, "tileable": "none", "seed": 1}
    request = {"of": "synthesize", "scale": 1.0, "extent": 0.1, "layer": layer, "options": options}
    shown = request_folder.pixels(result_of(request_folder.ask(operation="preview", **request))["picture"])
    assert shown.shape == (80, 100, 4)


def test_a_preview_of_a_pattern_is_in_its_colours(request_folder):
    density = np.zeros((20, 30), np.uint8)
    density[:, :10] = 255
    request = {
        "of": "repeat",
        "scale": 1.0,
        "densities": [request_folder.raster("ink", density)],
        "repeat": "translate",
        "inks": ["#204080"],
        "paper": "#ffffff",
        "options": {"rows": 1, "columns": 2, "repeat": "reflect", "palette": "own"},
    }
    shown = request_folder.pixels(result_of(request_folder.ask(operation="preview", **request))["picture"])
    assert shown.shape == (20, 60, 4)
    np.testing.assert_array_equal(
        shown[0, [0, 15, 45, 59], :3], [[32, 64, 128], [255] * 3, [255] * 3, [32, 64, 128]]
    )
    request["options"] = {"rows": 2, "columns": 1, "repeat": "own", "palette": "sea"}
    shown = request_folder.pixels(result_of(request_folder.ask(operation="preview", **request))["picture"])
    assert shown.shape == (40, 30, 4)
    paper, ink = (tuple(int(part[at : at + 2], 16) for at in (1, 3, 5)) for part in ts.PALETTES["sea"][:2])
    assert tuple(shown[0, 20, :3]) == paper
    assert np.abs(shown[0, 0, :3].astype(int) - ink).max() <= 40  # the ink on that paper
