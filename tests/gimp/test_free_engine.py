"""Of the half of the plug-in that needs no GIMP: a request's folder, the engine process with light stubs in
its place, and previews.
"""

import errno
import os
import queue
import select
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

import toposeam as ts
import toposeam_gimp
from toposeam_engine.serving import PROTOCOL
from toposeam_gimp.dialogs import rehearsal
from toposeam_gimp.engine import folder, launching, turns
from toposeam_gimp.engine import process as engine
from toposeam_gimp.engine.call import Call, GoneError
from toposeam_gimp.entries.table import PROCEDURES

GREETING = f'{{"event": "hello", "protocol": {PROTOCOL}, "version": "{ts.__version__}"}}'


@pytest.fixture(autouse=True)
def own_temporary_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(folder.tempfile, "gettempdir", lambda: str(tmp_path))
    return tmp_path


def test_a_request_folder_is_private_and_goes_with_the_block(own_temporary_folder):
    made = folder.RequestFolder()
    assert made.path.stat().st_mode & 0o077 == 0
    made.__exit__(KeyError, KeyError(), None)
    assert not list(own_temporary_folder.iterdir())


def test_crashed_folders_go_and_living_ones_stay(own_temporary_folder):
    for name in ("crashed", "alive", "notes"):
        (own_temporary_folder / f"toposeam-request-{name}").mkdir()
        (own_temporary_folder / f"toposeam-request-{name}" / "alive").touch()
        if name != "notes":
            (own_temporary_folder / f"toposeam-request-{name}" / folder.MARKER).touch()
    other = own_temporary_folder / "someone-elses"
    other.mkdir()
    long_ago = time.time() - folder.STALE_S - 60
    for name in ("crashed", "notes"):
        os.utime(own_temporary_folder / f"toposeam-request-{name}" / "alive", (long_ago, long_ago))
    folder.sweep(own_temporary_folder)
    assert sorted(path.name for path in own_temporary_folder.iterdir()) == [
        "someone-elses",
        "toposeam-request-alive",
        "toposeam-request-notes",  # which the plug-in did not make
    ]


def test_too_little_space_is_told_before_anything_is_written(own_temporary_folder):
    with pytest.raises(
        folder.FolderError,
        match=r"There is no space left in the temporary folder .* MiB are needed\. Free some",
    ):
        folder.RequestFolder(needed=2**60)
    assert not list(own_temporary_folder.iterdir())


def test_a_full_disk_is_recognised():
    assert folder.is_full(OSError(errno.ENOSPC, "full"))
    assert not folder.is_full(OSError(errno.EACCES, "no"))


def ask(script, silence_s=30.0, progress=lambda share: None):
    with folder.RequestFolder() as made:
        return engine.ask(
            made,
            {"operation": "stitch"},
            progress,
            command=[sys.executable, "-c", script],
            silence_s=silence_s,
        )


def say(*lines):
    return "import sys, time, os\n" + "".join(f"print({line!r}, flush=True)\n" for line in lines)


def test_the_engine_is_told_the_nonce_that_lies_in_the_folder():
    with folder.RequestFolder() as made, folder.RequestFolder() as other:
        assert made.nonce != other.nonce
        assert (made.path / folder.MARKER).read_text() == made.nonce
        script = f"import sys\nprint({GREETING!r}, flush=True)\n" + (
            'print(\'{"event": "result", "result": {"said": "\' + sys.stdin.readline().strip() + \'"}}\')'
        )
        result = engine.ask(made, {}, lambda share: None, command=[sys.executable, "-c", script])
    assert result == {"said": made.nonce}


def test_progress_and_result_come_through():
    shares = []
    script = say(
        GREETING,
        '{"event": "progress", "share": 0.5}',
        "noise",
        '{"event": "alive"}',
        '{"event": "result", "result": {"masks": []}}',
    )
    assert ask(script, progress=shares.append) == {"masks": []}
    assert shares == [0.5, 0.5]  # a sign of life, too, lets the asker look whether the image is still there


@pytest.mark.parametrize(
    ("script", "phrase"),
    [
        (
            say(GREETING, '{"event": "error", "message": "the layers do not overlap; move them"}'),
            "the layers do not overlap; move them",
        ),
        (
            say('{"event": "hello", "protocol": 99, "version": "9"}'),
            "the installed TopoSeam is 9; run “toposeam gimp install”",
        ),
        (say(GREETING) + "os._exit(5)", "ended unexpectedly (code 5)"),
        (say(GREETING) + "os.kill(os.getpid(), 9)", "killed, perhaps because memory ran out"),
        ("import sys; sys.exit('no module toposeam')", "does not start. Its last words: no module toposeam"),
    ],
)
def test_what_becomes_of_the_engine_is_told(script, phrase):
    with pytest.raises(engine.EngineError) as raised:
        ask(script)
    assert phrase in str(raised.value)


def test_an_engine_that_hangs_is_stopped():
    with pytest.raises(engine.EngineError, match="has not moved for 1 s and was stopped"):
        ask(say(GREETING) + "time.sleep(60)", silence_s=1.0)


def test_a_program_that_is_not_there():
    with folder.RequestFolder() as made, pytest.raises(engine.EngineError, match="does not start"):
        engine.ask(made, {}, lambda share: None, command=["/nowhere/python"])


def test_the_environment_is_cleaned():
    dirty = {
        "PATH": "/bin",
        "LD_PRELOAD": "x",
        "LD_LIBRARY_PATH": "x",
        "PYTHONHOME": "x",
        "PYTHONPATH": "x",
        "GI_TYPELIB_PATH": "x",
    }
    clean = launching.clean_environment(dirty)
    assert clean["PATH"] == "/bin"
    assert not set(clean) & (set(dirty) - {"PATH"})
    assert clean["OPENBLAS_NUM_THREADS"] == "1"


def test_which_python(tmp_path, monkeypatch):
    record = tmp_path / "engine.json"
    monkeypatch.setattr(engine, "settings_file", lambda: record)
    with pytest.raises(engine.EngineError, match="toposeam gimp install"):
        engine.find_python({}, tmp_path)
    pipx = tmp_path / ".local/share/pipx/venvs/toposeam/bin"
    pipx.mkdir(parents=True)
    (pipx / "python").touch()
    if sys.platform != "win32":
        assert engine.find_python({}, tmp_path) == str(pipx / "python")
    record.write_text('{"python": "/gone/python"}')
    with pytest.raises(engine.EngineError, match="is gone"):
        engine.find_python({}, tmp_path)
    record.write_text(f'{{"python": "{Path(sys.executable).as_posix()}"}}')
    assert engine.find_python({}, tmp_path) == Path(sys.executable).as_posix()
    with pytest.raises(engine.EngineError, match="TOPOSEAM_PYTHON"):
        engine.find_python({"TOPOSEAM_PYTHON": "/nowhere"}, tmp_path)


@pytest.mark.medium
def test_warm_engines_make_previews_and_the_newest_is_shown(tmp_path, monkeypatch):
    monkeypatch.setenv("TOPOSEAM_PYTHON", sys.executable)
    pixels = tmp_path / "pixels"
    pixels.mkdir()
    (pixels / "a.raw").write_bytes(bytes([60, 90, 30, 255] * 1600))
    raster = {"file": "a.raw", "width": 40, "height": 40, "channels": 4, "dtype": "uint8", "name": "a"}
    scene = {"of": "stitch", "scale": 0.5, "layers": [{**raster, "at": [x, 0]} for x in (0, 20)]}
    found = queue.Queue()
    shown = rehearsal.Rehearsal(found.put)
    try:
        shown.warm_up()
        for blend in ("multiband", "feather", "none"):
            shown.show(scene, {"blend": blend, "blend_width": 20.0}, pixels)
        picture = found.get(timeout=60)
        assert (*picture[:3], len(picture.content), picture.frames) == (60, 40, 4, 9600, 1)
        assert found.empty()
        shown.show({**scene, "layers": scene["layers"][:1]}, {}, pixels)
        assert "at least two" in found.get(timeout=60)
    finally:
        shown.close()
    deadline = time.monotonic() + 10
    while list(tmp_path.glob("toposeam-request-*")) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not list(tmp_path.glob("toposeam-request-*"))


def test_an_engine_ends_before_what_it_has_started():
    running = engine.Engine(command=["sh", "-c", "sleep 120 & echo $!; wait"])
    started = int(running.read_line(60))
    running.end()
    os.kill(started, signal.SIGKILL)  # it is still there
    assert running.read_line(60) is None


@pytest.mark.medium
def test_the_engine_is_kept_for_previews_and_ends_on_changes(tmp_path, monkeypatch):
    monkeypatch.setenv("TOPOSEAM_PYTHON", sys.executable)
    raster = {"file": "a.raw", "width": 200, "height": 200, "channels": 4, "dtype": "uint8", "name": "a"}
    scene = {"of": "stitch", "scale": 0.5, "layers": [{**raster, "at": [x, 0]} for x in (0, 100)]}
    (tmp_path / "a.raw").write_bytes(bytes([60, 90, 30, 255] * 40_000))
    asked, found = [], queue.Queue()
    ask = engine.ask

    def watched(*given, waiting, **more):
        asked.append(waiting)
        return ask(*given, waiting=waiting, **more)

    monkeypatch.setattr(engine, "ask", watched)
    shown = rehearsal.Rehearsal(found.put, "stitch")
    try:
        for _ in range(3):
            shown.show(scene, {"blend": "none"}, tmp_path)
            assert found.get(timeout=60).width == 300
        assert len(set(asked)) == 1
        shown.show(scene, {"method": "thesis"}, tmp_path)  # takes more than a second
        shown.show(scene, {"blend": "none"}, tmp_path)
        assert found.get(timeout=60).width == 300
        assert found.empty()
        assert not asked[0].lives
        assert len(set(asked)) == 2
        assert sum(one.lives for one in set(asked)) == 1
    finally:
        shown.close()
    assert not any(one.lives for one in asked)


def test_a_closed_image_stops_the_engine():
    image = SimpleNamespace(is_valid=lambda: False)
    call = Call(
        image=image, drawables=[], options={}, entry=PROCEDURES["plug-in-toposeam-stitch"], interactive=True
    )
    script = say(GREETING, '{"event": "alive"}') + "\nimport time\ntime.sleep(60)"
    with pytest.raises(GoneError, match="The image was closed"):
        ask(script, progress=call.progress)


@pytest.fixture
def session(tmp_path, monkeypatch):
    """The folder of a session, which others cannot enter."""
    folder = tmp_path / "session"
    folder.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    return folder


def test_entries_change_images_one_after_another(session):
    code = """
from toposeam_gimp.engine import turns
with turns.turn():
    print("mine", flush=True)
"""
    with turns.turn():
        other = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, env=with_plug_in())
        readable, _writable, _failed = select.select([other.stdout], [], [], 0.5)
        assert not readable
    assert other.communicate(timeout=60)[0] == b"mine\n"


def test_an_entry_that_hangs_does_not_stop_the_others(session):
    ran = []
    with turns.turn(), turns.turn(patience_s=0.1):
        ran.append(True)
    assert ran


@pytest.mark.parametrize("what", ["open to others", "a link", "relative", "gone"])
def test_turns_lie_where_nobody_else_can_take_them(session, tmp_path, monkeypatch, what):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    if what == "open to others":
        session.chmod(0o755)
    elif what == "a link":
        (tmp_path / "link").symlink_to(session)
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "link"))
    else:
        monkeypatch.setenv("XDG_RUNTIME_DIR", "session" if what == "relative" else str(tmp_path / "gone"))
    monkeypatch.chdir(tmp_path)
    with turns.turn():
        pass
    own = tmp_path / "cache" / "toposeam" / "gimp"
    assert (own / "toposeam-turn").stat().st_mode & 0o177 == 0
    assert own.stat().st_mode & 0o077 == 0
    assert not list(session.iterdir())


def test_turns_follow_no_link(session, tmp_path):
    (session / "toposeam-turn").symlink_to(tmp_path / "made")
    with turns.turn():
        pass
    assert not (tmp_path / "made").exists()


def with_plug_in():
    return {**os.environ, "PYTHONPATH": str(Path(toposeam_gimp.__file__).parents[1])}
