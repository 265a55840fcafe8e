"""`toposeam gimp install` and `doctor` with a real GIMP."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from running import CHECKOUT, Gimp, find_gimp, needs_gimp

needs_gimp()

#: "3.0", "3.2", …
VERSION = find_gimp().rpartition("-")[2]


@pytest.fixture
def home(tmp_path):
    for version in ("3.0", VERSION):  # what an older GIMP has left behind is no trouble
        (tmp_path / ".config" / "GIMP" / version).mkdir(parents=True, exist_ok=True)
    return tmp_path


def toposeam(home, *arguments):
    environment = {**os.environ, "HOME": str(home), "XDG_CONFIG_HOME": "", "GIMP3_DIRECTORY": ""}
    command = [sys.executable, "-m", "toposeam_cli", "gimp", *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_doctor_is_content_after_install(home):
    assert toposeam(home, "install").returncode == 0
    ran = toposeam(home, "doctor")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    for phrase in ("is installed: ", "the engine works", "loads the plug-in: it is in Filters"):
        assert phrase in ran.stdout


def test_doctor_says_what_keeps_gimp_from_loading_it(home):
    toposeam(home, "install")
    (home / ".config" / "GIMP" / VERSION / "plug-ins" / "toposeam_gimp" / "plugin.py").write_text(
        "import nothing_of_that_name\n"
    )
    ran = toposeam(home, "doctor")
    assert ran.returncode == 1
    assert (
        " does not load the plug-in: ModuleNotFoundError: No module named 'nothing_of_that_name'"
        in ran.stdout
    )
    assert "toposeam gimp install" in ran.stdout


def test_an_installed_plug_in_finds_its_engine_by_itself(home, tmp_path, samples):
    toposeam(home, "install")
    folder = tmp_path / "gimp"
    folder.mkdir()
    gimp = Gimp(
        folder, environment={"TOPOSEAM_PYTHON": ""}, plug_ins=home / ".config" / "GIMP" / VERSION / "plug-ins"
    )
    try:
        loaded = gimp.load(
            files=[str(samples / f"grass_{name}.png") for name in "ab"], offsets=[[0, 0], [120, 0]]
        )
        assert gimp.stitch(loaded)["status"] == "success"
    finally:
        gimp.close()


def test_the_readme_s_three_commands_install_a_working_menu(tmp_path):
    text = (CHECKOUT / "README.md").read_text(encoding="utf-8")
    block = text[text.index("## In GIMP") :].split("```")[1]
    commands = block.strip().splitlines()[1:]
    assert len(commands) == 3
    path = os.pathsep.join(
        part for part in os.environ["PATH"].split(os.pathsep) if part != str(Path(sys.executable).parent)
    )
    environment = {**os.environ, "HOME": str(tmp_path), "XDG_CONFIG_HOME": "", "PATH": path}
    for name in ("GIMP3_DIRECTORY", "TOPOSEAM_PYTHON"):
        environment.pop(name, None)
    doctor = commands[-1].split()[0] + " gimp doctor"
    for command in (*commands, doctor):
        ran = subprocess.run(
            ["sh", "-c", command], cwd=CHECKOUT, env=environment, capture_output=True, text=True, check=False
        )
        assert ran.returncode == 0, f"{command}: {ran.stdout}{ran.stderr}"
    assert "loads the plug-in: it is in Filters" in ran.stdout
