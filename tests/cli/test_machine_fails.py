"""Full disks, closed pipes, missing memory, Ctrl-C: one sentence, and nothing half-written."""

import os
import pty
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from bad_files import IN, arguments, snapshot
from PIL import Image

from toposeam_cli.files import writing as output
from toposeam_cli.media.pictures.picture import Picture, write_picture

pytestmark = pytest.mark.usefixtures("hangups_arrive")


def fail_with(error):
    def fail(*arguments, **options):
        raise error

    return fail


@pytest.mark.parametrize(
    ("error", "phrase"),
    [
        (MemoryError(), "use smaller ones"),
        (np._core._exceptions._ArrayMemoryError((10**6, 10**6), np.dtype(float)), "use smaller ones"),
        (OSError(5, "Input/output error"), "the system refused (Input/output error)"),
    ],
)
def test_a_machine_that_gives_up_is_one_sentence_too(toposeam, inputs, here, monkeypatch, error, phrase):
    monkeypatch.setattr("toposeam.stitch", fail_with(error))
    before = snapshot(here)
    toposeam("stitch", *arguments("{a} {b} " + IN, inputs)).fails(phrase)
    assert snapshot(here) == before


def test_a_mistake_of_ours_asks_for_a_report(toposeam, inputs, here, monkeypatch):
    monkeypatch.setattr("toposeam.stitch", fail_with(ZeroDivisionError("division\nby zero")))
    line = ("stitch", *arguments("{a} {b} " + IN, inputs))
    ran = toposeam(*line)
    assert ran.code == 1
    assert ran.err.startswith(
        "Error: something went wrong inside TopoSeam (ZeroDivisionError: division\\nby zero); set "
        "TOPOSEAM_DEBUG=1"
    )
    assert ran.err.count("\n") == 1


@pytest.mark.medium
def test_debugging_shows_where(started, inputs, here):
    code = (
        "import toposeam\ntoposeam.stitch = lambda *a, **o: 1 / 0\n"
        "from toposeam_cli.app.main import main\nmain()"
    )
    line = arguments("{a} {b} " + IN, inputs)
    done = subprocess.run(
        [sys.executable, "-c", code, "stitch", *line],
        env=os.environ | {"TOPOSEAM_DEBUG": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "Traceback" in done.stderr
    assert "ZeroDivisionError" in done.stderr


def test_a_full_disk_leaves_nothing_behind(toposeam, inputs, here, monkeypatch):
    monkeypatch.setattr(output.os, "fsync", fail_with(OSError(28, "No space left on device")))
    before = snapshot(here)
    line = arguments("{a} {b} --overlap 20 -o there.png --seam there.svg --force", inputs)
    toposeam("stitch", *line).fails("free some space or choose another folder")
    assert snapshot(here) == before


def in_a_small_file_system(started, inputs, options, *line):
    """Run with ``disk``, of 16 kB and holding a file, in a mount name space of its own; the listing of
    ``disk`` afterwards is printed.
    """
    setting_up = (
        'mount -t tmpfs -o size=16k tmpfs disk && echo precious > disk/there.png && mount -o "remount,$0" '
        'disk || exit 99; "$@"; code=$?; ls -A disk; cat disk/there.png; exit $code'
    )
    ran = started(*line, before=("unshare", "--map-root-user", "--mount", "sh", "-c", setting_up, options))
    if ran.code == 99 or "unshare" in ran.err:
        pytest.skip("no file system can be mounted here")
    return ran


@pytest.mark.medium
@pytest.mark.skipif(shutil.which("unshare") is None, reason="no unshare")
@pytest.mark.parametrize(
    ("options", "outputs", "phrase"),
    [
        ("rw", "-o disk/out.tif", "No space left on device"),
        ("rw", "-o disk/there.png --force", "No space left on device"),
        ("rw", "-o disk/there.png --force --seam disk/seam.svg", "No space left on device"),
        ("ro", "-o disk/out.png", "read-only file system"),
        ("ro", "-o disk/there.png --force", "read-only file system"),
    ],
)
def test_a_disk_that_is_full_or_read_only_keeps_what_it_has(
    started, inputs, here, photographs, options, outputs, phrase
):
    (here / "disk").mkdir()
    rng = np.random.default_rng(1)
    write_picture(
        "noise.png", Picture(pixels=rng.integers(0, 256, (90, 90, 3), np.uint8))
    )  # 24 kB, whatever the compression
    ran = in_a_small_file_system(
        started, inputs, options, "stitch", "noise.png", "noise.png", "--overlap", "30", *outputs.split()
    )
    assert ran.out == "there.png\nprecious\n"
    assert ran.code == 1
    assert phrase in ran.err
    assert ran.err.count("\n") == 1


@pytest.mark.medium
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")  # noqa: PTH110
def test_a_report_that_cannot_be_printed(started, inputs, here):
    with open("/dev/full", "wb") as full:  # noqa: PTH123
        ran = started("stitch", *arguments("{a} {b} " + IN, inputs), stdout=full)
    assert ran.code == 1
    assert ran.err == (
        "Error: the system refused (No space left on device); free some space, or check the rights and where "
        "the output goes\n"
    )
    assert (here / "out.png").stat().st_size > 1000


@pytest.mark.medium
def test_a_reader_that_leaves_early_is_no_error_of_ours(process, inputs, here):
    child = process(
        "compare",
        *arguments("{a} {b} --overlap 20 --method dp", inputs),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    child.stdout.close()
    with child:
        assert child.stderr.read() == b""


@pytest.mark.parametrize("moment", ["import", "read", "search", "figure", "write", "rename"])
def test_ctrl_c_at_any_moment_leaves_nothing_half_written(toposeam, inputs, here, monkeypatch, moment):
    target = {
        "import": ("toposeam_cli.app.registry.import_module",),
        "read": ("toposeam_cli.stitching.inputs.read_picture",),
        "search": ("toposeam.stitch",),
        "figure": ("toposeam_cli.figures.history.history_figure",),
        "write": (output.os, "fsync"),
        "rename": (output, "give_name"),
    }[moment]
    monkeypatch.setattr(*target, fail_with(KeyboardInterrupt()))
    before = snapshot(here)
    ran = toposeam(
        "stitch", *arguments("{a} {b} --overlap 20 -o there.png --history history.png --force", inputs)
    )
    assert (ran.code, ran.out, ran.err) == (130, "", "Interrupted; no file was left unfinished.\n")
    assert snapshot(here) == before


@pytest.mark.medium
def test_a_real_ctrl_c_in_the_middle_of_work(process, inputs, here):
    rng = np.random.default_rng(0)
    for name in ("c.tif", "d.tif"):
        write_picture(name, Picture(pixels=rng.integers(0, 256, (1500, 700, 3), np.uint8)))
    before = snapshot(here)
    ours, theirs = pty.openpty()
    with process(
        "stitch", "c.tif", "d.tif", "--overlap", "500", "-o", "there.png", "--force", stderr=theirs
    ) as child:
        os.close(theirs)
        seen = b""
        while b"joining" not in seen:  # the bar is there, so the search has begun
            seen += os.read(ours, 4096)
        child.send_signal(signal.SIGINT)
        while b"unfinished.\r\n" not in seen:
            seen += os.read(ours, 4096)
        assert child.wait(60) == 130
    os.close(ours)
    assert seen.decode().endswith("\x1b[?25h\r\nInterrupted; no file was left unfinished.\r\n")
    assert "Traceback" not in seen.decode()
    assert snapshot(here) == before


@pytest.mark.medium
@pytest.mark.parametrize("received", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_large_picture_is_not_written_to_its_end_after_ctrl_c(process, inputs, here, received):
    rng = np.random.default_rng(0)
    for name in ("c.tif", "d.tif"):
        write_picture(name, Picture(pixels=rng.integers(0, 256, (2000, 1400, 3), np.uint8)))
    before = snapshot(here)
    with process(
        "stitch", "c.tif", "d.tif", "--overlap", "2", "-o", "out.png", stderr=subprocess.PIPE
    ) as child:
        while not list(here.glob(".toposeam-*.part")):
            assert child.poll() is None
            time.sleep(0.01)
        child.send_signal(received)
        said = child.stderr.read().decode()
    assert (child.returncode, said) == (
        128 + received,
        "Interrupted; no file was left unfinished.\n" if received == signal.SIGINT else "",
    )
    assert snapshot(here) == before


@pytest.mark.slow
def test_ctrl_c_and_kill_at_random_moments(process, inputs, here):
    rng = np.random.default_rng(0)
    before = snapshot(here)
    line = arguments("{a} {b} --overlap 20 -o out.png --labels labels.png --history history.png -q", inputs)
    codes = set()
    for turn in range(int(os.environ.get("TOPOSEAM_KILLS", "16"))):
        sent, ends = (
            (signal.SIGINT, (130, "Interrupted; no file was left unfinished.\n")),
            (signal.SIGTERM, (143, "")),
        )[turn % 2]
        child = process("stitch", *line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        with child:
            try:
                child.wait(0.3 + 3 * rng.random())
            except subprocess.TimeoutExpired:
                child.send_signal(sent)
            said = child.stderr.read().decode()
        codes.add(child.returncode)
        # Python itself, while it starts or ends, dies of the signal, or cannot import its runpy; that is not
        # ours.
        starts = said.startswith("Could not import runpy module") and "toposeam" not in said
        if child.returncode != -sent and not starts:
            assert (child.returncode, said) in {(0, ""), ends}
        for name in set(snapshot(here)) - set(before):
            assert not name.endswith(".part")
            with Image.open(name) as image:
                image.load()
            (here / name).unlink()
    assert codes >= {130, 143}
    assert snapshot(here) == before
