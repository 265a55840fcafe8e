"""What is written for systems that the tests do not run on, taken on this one by its other branches."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import toposeam_cli.files.temporary as temporary_files
from toposeam_cli.files.temporary import remove_stale
from toposeam_cli.files.writing import all_or_nothing, atomic_write, replacing
from toposeam_cli.gimp import environment, programs
from toposeam_gimp.engine import process as engine

SAMPLES = Path(__file__).parents[3] / "samples"

#: The program in a Python that lacks what Windows lacks; what it imports may not need it either.
WITHOUT_UNIX = """
import os, signal, sys
for name in ("pthread_sigmask", "SIGHUP", "SIGKILL"):
    delattr(signal, name)
for name in ("getuid", "geteuid", "fork"):
    delattr(os, name)
sys.modules["fcntl"] = None
sys.argv[0] = "toposeam"
from toposeam_cli.__main__ import start
start()
"""


@pytest.fixture
def like_windows(monkeypatch):
    """No fcntl, no user numbers."""
    monkeypatch.setattr(temporary_files, "fcntl", None)
    monkeypatch.delattr(os, "getuid")


def test_without_fcntl_files_are_written_whole_or_not_at_all(tmp_path, like_windows):
    atomic_write(tmp_path / "a", "first")

    def fail_after_one():
        with all_or_nothing():
            atomic_write(tmp_path / "b", "second")
            raise FileExistsError

    def fail_halfway():
        with replacing(tmp_path / "a", force=True) as temporary:
            temporary.write_text("half")
            raise ZeroDivisionError

    for fail, error in ((fail_after_one, FileExistsError), (fail_halfway, ZeroDivisionError)):
        with pytest.raises(error):
            fail()
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": "first"}
    atomic_write(tmp_path / "a", "new", force=True)
    assert (tmp_path / "a").read_text() == "new"


def test_without_fcntl_what_a_killed_command_left_goes(tmp_path, like_windows):
    (tmp_path / f".toposeam-{'a' * 16}.part").write_text("half")
    (tmp_path / "other.part").write_text("not ours")
    remove_stale(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["other.part"]


def test_the_engine_is_looked_for_where_windows_has_programs(tmp_path, monkeypatch):
    monkeypatch.setattr(engine.sys, "platform", "win32")
    places = list(engine._usual_places(tmp_path))
    assert places
    assert all(place.parts[-2:] == ("Scripts", "python.exe") for place in places)


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        "stitch SAMPLES/grass_a.png SAMPLES/grass_b.png --overlap 40 -o out.png",
        "batch SAMPLES/grass_a*.png SAMPLES/grass_b*.png --overlap 40 -q -o out.png -j 2",
        "tile SAMPLES/gravel.png -q -o out.png",
        "motif --size 32 --iterations 3 -o out.png",
    ],
    ids=lambda words: words.split()[0],
)
def test_commands_run_without_what_only_unix_has(tmp_path, words):
    words = [word.replace("SAMPLES", str(SAMPLES)) for word in words.split()]
    ran = subprocess.run(
        [sys.executable, "-c", WITHOUT_UNIX, *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (ran.returncode, ran.stderr) == (0, "")
    assert (tmp_path / "out.png").stat().st_size > 0
    assert not list(tmp_path.glob(".toposeam-*"))


@pytest.mark.parametrize(
    ("platform", "expected"),
    [
        ("win32", "local/TopoSeam/venv"),
        ("darwin", "Library/Application Support/TopoSeam/venv"),
        ("linux", "data/toposeam/venv"),
    ],
)
def test_the_gimp_environment_is_in_each_system_s_data_folder(tmp_path, monkeypatch, platform, expected):
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "local"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    assert environment.usual_folder() == tmp_path / expected


@pytest.mark.parametrize(
    ("platform", "expected"),
    [("win32", "AppData/Local/TopoSeam/venv"), ("linux", ".local/share/toposeam/venv")],
)
def test_the_gimp_environment_has_a_folder_without_variables(tmp_path, monkeypatch, platform, expected):
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    assert environment.usual_folder() == tmp_path / expected


@pytest.mark.parametrize(("platform", "python"), [("win32", "Scripts/python.exe"), ("darwin", "bin/python")])
def test_the_python_of_a_new_environment_has_the_system_s_name(tmp_path, monkeypatch, platform, python):
    ran = []
    monkeypatch.setattr(sys, "platform", platform)
    ended = subprocess.CompletedProcess([], 0)
    monkeypatch.setattr(environment, "run", lambda command, **_: ran.append(command) or ended)
    assert environment.make_environment(tmp_path / "venv") == tmp_path / "venv" / python
    assert ran[1][0] == str(tmp_path / "venv" / python)


@pytest.mark.parametrize(
    ("platform", "place"),
    [("win32", "programs/GIMP 3/bin"), ("darwin", "/Applications/GIMP.app/Contents/MacOS")],
)
def test_gimp_is_looked_for_where_it_is_installed_besides_path(tmp_path, monkeypatch, platform, place):
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setenv("PROGRAMFILES", str(tmp_path / "programs"))
    assert tmp_path / place in list(programs._folders())
