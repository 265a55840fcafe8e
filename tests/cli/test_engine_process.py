"""The engine as a process: requests in a folder, events on stdout, its end."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from engine_requests import message_of

import toposeam as ts
from toposeam_engine.serving import MARKER, PROTOCOL


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
    assert process.wait(timeout=300) == 3
    assert not request_folder.folder.exists()
    request_folder.held = os.open(os.devnull, os.O_RDONLY)
    process.stdout.close()
    process.stderr.close()


def engine(folder, stdin):
    return subprocess.run(
        [sys.executable, "-m", "toposeam_engine", str(folder)], input=stdin, capture_output=True, timeout=300
    )


@pytest.mark.parametrize(
    "stdin", [b"", b"\n", b"7e57\n", b"wrong\n" * 1000], ids=["none", "empty", "7e57", "long"]
)
def test_a_folder_without_a_request_is_refused_and_unchanged(tmp_path, stdin):
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


@pytest.mark.medium
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


@pytest.mark.medium
def test_a_warm_engine_is_told_one_folder_after_another(tmp_path, request_folder, pair):
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    request = {"of": "stitch", "scale": 0.5, "layers": layers}
    placed = [ts.Layer(pair[0][..., :3]), ts.Layer(pair[1][..., :3], at=(20, 5))]
    with warm() as process:
        for width in (8.0, 12.0):
            options = {"blend": "feather", "blend_width": width}
            answer = tell(process, request_folder, **request, options=options)
            shown = request_folder.pixels(answer["result"]["picture"])
            expected = ts.stitch(placed, blend="feather", blend_width=width / 2)
            np.testing.assert_array_equal(shown[..., :3], ts.seam.draw_seams(expected.image, expected.seams))
        refused = tell(process, request_folder, **request, options={"blend": "glue"})
        assert "blend" in refused["message"]
        (tmp_path / "another").mkdir()
        process.stdin.write(f"{tmp_path / 'another'}\nwrong\n".encode())
        process.stdin.flush()
        assert b"left untouched" in process.stdout.readline()
        answer = tell(process, request_folder, **request, options={"blend": "none"})
        assert answer["event"] == "result"
        process.stdin.close()
        assert process.wait(timeout=300) == 0
    assert request_folder.folder.is_dir()
    assert (tmp_path / "another").is_dir()


@pytest.mark.medium
def test_a_warm_engine_ends_with_its_asker(request_folder):
    rng = np.random.default_rng(0)
    layers = [
        request_folder.raster(name, rng.random((900, 900, 4), np.float32), (x, 0))
        for name, x in (("a", 0), ("b", 300))
    ]
    options = {"method": "thesis"}
    body = {"protocol": PROTOCOL, "version": ts.__version__, "operation": "stitch", "options": options}
    (request_folder.folder / "request.json").write_text(json.dumps({**body, "layers": layers}))
    with warm() as process:
        process.stdin.write(f"{request_folder.folder}\n7e57\n".encode())
        process.stdin.flush()
        while b"progress" not in process.stdout.readline():
            pass
        process.stdin.close()
        assert process.wait(timeout=300) == 3
    assert not request_folder.folder.exists()


def test_a_warm_engine_that_is_not_needed_goes():
    with warm() as process:
        output, _ = process.communicate(timeout=300)
    assert process.returncode == 0
    assert b"result" not in output


@pytest.mark.medium
@pytest.mark.parametrize(
    "of", ["stitch", "patch", "synthesize", "make_tileable", "fill", "motif", "repeat", "loop"]
)
def test_an_engine_can_prepare_for_every_preview(of):
    with warm(of) as process:
        output, noise = process.communicate(timeout=600)
    assert process.returncode == 0, output
    assert not noise
    assert b"error" not in output


def test_what_is_refused_is_one_sentence_and_an_exit_code(request_folder):
    assert "no operation 'fly'" in message_of(request_folder.ask_process(operation="fly"))
