"""``toposeam gimp`` and what it needs beside its own files: GIMP programs, and a Python for the engine."""

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from gimp_home import plug_in, run

import toposeam as ts
from toposeam.errors import OptionError
from toposeam_cli.commands import gimp as gimp_command
from toposeam_cli.gimp import environment
from toposeam_gimp.engine.launching import ISOLATED

CHECKOUT = Path(__file__).parents[3]


def fake_gimp(home, name, says="TOPOSEAM True", tail=""):
    """A program that prints something, in place of a console GIMP."""
    folder = home / "bin"
    folder.mkdir(exist_ok=True)
    program = folder / name
    program.write_text(f'#!/bin/sh\necho "{says}"\n{tail}\n')
    program.chmod(0o755)
    return program


def test_a_gimp_that_was_never_started_gets_its_profile(home):
    fake_gimp(home, "gimp-console-3.4")
    (home / ".config" / "GIMP" / "3.0").rmdir()
    output = run("install")
    assert (plug_in(home, "3.4") / "toposeam_gimp.py").is_file()
    assert (plug_in(home, "3.2") / "toposeam_gimp.py").is_file()
    assert not (home / ".config" / "GIMP" / "3.0").exists()
    assert "GIMP 3.4 was never started" in output
    assert "settings of 3.2" in output


@pytest.mark.medium
def test_doctor_asks_each_gimp_with_its_own_profile(home):
    fake_gimp(home, "gimp-console-3.0")
    fake_gimp(home, "gimp-console-3.2", says="TOPOSEAM False", tail="echo 'ImportError: no'")
    fake_gimp(home, "gimp-console-2.10")
    run("install")
    output = run("doctor", code=1)
    assert "ok       GIMP 3.0 loads the plug-in" in output
    assert "PROBLEM  GIMP 3.2 does not load the plug-in: ImportError: no" in output
    assert "GIMP 2.10 is installed too" in output
    assert "ok       GIMP 3.0 loads the plug-in" in run("doctor", "--gimp-version", "3.0")


def test_doctor_reports_a_gimp_that_does_not_read_the_profile(home):
    fake_gimp(home, "gimp-console-3.0")
    run("install", "--gimp-version", "3.2")
    output = run("doctor", "--gimp-version", "3.2", code=1)
    assert "the GIMP on this machine is 3.0, which does not read this profile" in output


@pytest.mark.medium
def test_doctor_lets_the_profile_of_an_earlier_gimp_be(home):
    fake_gimp(home, "gimp-console-3.2")
    (home / ".config" / "GIMP" / "3.0").mkdir(exist_ok=True)
    run("install")
    output = run("doctor")
    assert "ok       GIMP 3.0 was not found; the GIMP on this machine is 3.2" in output
    assert "it has one of its own, so this one does no harm" in output
    assert "ok       GIMP 3.2 loads the plug-in" in output


def test_doctor_looks_where_the_profile_tells_gimp_to_look(home):
    profile = home / ".config" / "GIMP" / "3.0"
    (profile / "gimprc").write_text('(plug-in-path "${gimp_dir}/mine:/opt/plug-ins")\n')
    seen = home / "seen"
    fake_gimp(home, "gimp-console-3.0", tail=f'/bin/cp "$GIMP3_DIRECTORY/gimprc" "{seen}"')
    run("install", "--gimp-version", "3.0")
    run("doctor", "--gimp-version", "3.0")
    assert seen.read_text() == f'(plug-in-path "{profile}/mine:/opt/plug-ins")\n'


@pytest.mark.parametrize(
    ("script", "phrase"),
    [
        ("exit 1", "has no TopoSeam (it says nothing)"),
        ("echo 'No module named toposeam' >&2; exit 1", "has no TopoSeam (No module named toposeam)"),
        ("echo 0.0.1 True", "has TopoSeam 0.0.1, and this is"),
    ],
)
def test_a_python_that_cannot_do_the_work_is_refused(home, script, phrase):
    python = fake_gimp(home, "python-elsewhere", tail=script)
    python.write_text(f"#!/bin/sh\n{script}\n")
    assert phrase in run("install", "--python", python, code=1)
    assert not plug_in(home, "3.0").exists()


def test_what_the_engine_lacks_is_noted(home):
    python = fake_gimp(home, "python-elsewhere")
    python.write_text(f"#!/bin/sh\necho {ts.__version__} False\n")
    run("install", "--python", python)
    assert json.loads((plug_in(home, "3.0") / "engine.json").read_text())["without"] == ["graph-cut"]


@pytest.mark.parametrize(
    ("python", "temporary"),
    [
        ("/home/me/.cache/uv/archive-v0/Xy/bin/python", True),
        ("C:/Users/me/AppData/Local/uv/cache/archive-v0/Xy/Scripts/python.exe", True),
        ("/home/me/.cache/uv/environments-v2/abc/bin/python", True),
        ("/home/me/.local/pipx/.cache/abc/bin/python", True),
        ("/home/me/.cache/pipx/abc/bin/python", True),
        ("/Users/me/Library/Caches/pipx/abc/bin/python", True),
        ("C:/Users/me/AppData/Local/pipx/pipx/Cache/abc/Scripts/python.exe", True),
        ("/home/me/.local/share/pipx/venvs/toposeam/bin/python", False),
        ("/usr/bin/python3", False),
    ],
)
def test_environments_that_will_be_gone_are_known(python, temporary):
    assert environment.is_temporary(Path(python)) is temporary


def test_a_temporary_environment_is_told(home, monkeypatch):
    monkeypatch.setattr(gimp_command, "is_temporary", lambda python: True)
    assert "toposeam gimp install --venv" in run("install")


def test_an_own_environment_is_made_from_the_same_requirement(home, tmp_path, monkeypatch):
    called = []

    def call(command, **_options):
        called.append(command)
        return subprocess.CompletedProcess(command, 0, f"{ts.__version__} True", "")

    monkeypatch.setattr(environment, "run", call)
    run("install", "--venv", tmp_path / "own")
    python = str(tmp_path / "own" / "bin" / "python")
    assert called[0] == [sys.executable, *ISOLATED, "-m", "venv", str(tmp_path / "own")]
    assert called[1][:7] == [python, *ISOLATED, "-m", "pip", "install"]
    assert called[1][-1] == environment.requirement()
    assert json.loads((plug_in(home, "3.0") / "engine.json").read_text())["python"] == python


def test_an_environment_is_never_filled_from_an_index(home, tmp_path, monkeypatch):
    """Of a TopoSeam that does not say where it is from, a package of its name would be a stranger's."""
    called = []
    monkeypatch.setattr(environment, "run", lambda *given, **_: called.append(given))
    monkeypatch.setattr(
        environment, "distribution", lambda name: SimpleNamespace(read_text=lambda file: None)
    )
    with pytest.raises(OptionError, match="make an environment from a checkout"):
        environment.make_environment(tmp_path / "own")
    assert not called


def test_an_environment_that_cannot_be_made_is_one_sentence(home, tmp_path, monkeypatch):
    def refuse(command, **_options):
        return subprocess.CompletedProcess(command, 1, "", "ensurepip is not available")

    monkeypatch.setattr(environment, "run", refuse)
    output = run("install", "--venv", tmp_path / "own", code=1)
    assert "could not be made (ensurepip is not available); apt install python3-venv" in output
    assert not plug_in(home, "3.0").exists()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "letter.txt").touch()
    assert "holds something else" in run("install", "--venv", tmp_path / "full", code=1)
    (tmp_path / "file").touch()
    assert "is a file; name a folder" in run("install", "--venv", tmp_path / "file", code=1)
    assert "give one of them" in run("install", "--venv", tmp_path / "x", "--python", sys.executable, code=1)
