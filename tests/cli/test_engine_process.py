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


@pytest.mark.medium
def test_a_warm_engine_is_told_its_folder(request_folder, pair):
    layers = [request_folder.raster("a", pair[0]), request_folder.raster("b", pair[1], (20, 5))]
    request = {"operation": "preview", "of": "stitch", "scale": 0.5, "layers": layers}
    options = {"blend": "feather", "blend_width": 8.0}
    body = {"protocol": PROTOCOL, "version": ts.__version__, **request, "options": options}
    (request_folder.folder / "request.json").write_text(json.dumps(body))
    nonce = (request_folder.folder / "toposeam-request").read_text()
    request_folder.held = os.open(os.devnull, os.O_RDONLY)
    command = [sys.executable, "-m", "toposeam_engine", "-"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        process.stdin.write(f"{request_folder.folder}\n{nonce}\n".encode())
        process.stdin.flush()
        result = [json.loads(line) for line in process.stdout][-1]["result"]
    shown = request_folder.pixels(result["picture"])
    placed = [ts.Layer(pair[0][..., :3]), ts.Layer(pair[1][..., :3], at=(20, 5))]
    expected = ts.stitch(placed, blend="feather", blend_width=4.0)
    np.testing.assert_array_equal(shown[..., :3], ts.draw_seams(expected.image, expected.seams))


def test_a_warm_engine_that_is_not_needed_goes():
    process = subprocess.Popen(
        [sys.executable, "-m", "toposeam_engine", "-"], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 1
    assert b"result" not in output


def test_what_is_refused_is_one_sentence_and_an_exit_code(request_folder):
    assert "no operation 'fly'" in message_of(request_folder.ask_process(operation="fly"))
