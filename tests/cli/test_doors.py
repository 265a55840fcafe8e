"""Nothing of the folder that one stands in is run, whatever its files are called and whatever PATH says."""

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import toposeam
import toposeam_cli
import toposeam_gimp
from toposeam_gimp import __version__

SAMPLES = Path(__file__).parents[2] / "samples"
HOMES = [str(Path(each.__file__).parents[1]) for each in (toposeam, toposeam_cli, toposeam_gimp)]
#: Modules that a Python might look for: its own, those of pip and of sites, and what TopoSeam is made of.
MODULES = {
    *(name for name in sys.stdlib_module_names if not name.startswith("_")),
    *("pip", "wheel", "setuptools", "sitecustomize", "usercustomize", "toposeam", "toposeam_cli"),
    *("toposeam_engine", "toposeam_gimp", "numpy", "scipy", "click", "PIL", "pyvips", "distributed", "dask"),
}
PROGRAMS = (
    *("python", "python3", *(f"python3.{minor}" for minor in range(11, 16)), "py", "pip", "git", "flatpak"),
    *("gimp", "gimp-3.0", "gimp-console-3.0", "gimp-console-3.2", "bash", "sh", "env", "uname", "ldconfig"),
    *(
        "gcc",
        "cc",
        "ld",
        "objdump",
        "less",
        "more",
        "xdg-open",
        "browser",
        "ffmpeg",
        "vips",
        "lscpu",
        "nproc",
    ),
)


@pytest.fixture
def trap(tmp_path):
    """A folder full of such files, each of which leaves its name."""
    folder, left = tmp_path / "unpacked", tmp_path / "left"
    left.mkdir()
    (folder / "bin").mkdir(parents=True)
    for name in MODULES:
        text = f"open({str(left / name)!r}, 'w').close()\nraise SystemExit(0)\n"
        (folder / f"{name}.py").write_text(text)
    for name in PROGRAMS:
        for place in (folder, folder / "bin"):
            (place / name).write_text(f"#!/bin/sh\n: > '{left / name}'\nexit 0\n")
            (place / name).chmod(0o755)
    (folder / "pip.conf").write_text("[global]\nindex-url = http://127.0.0.1:9/\n")
    return folder


def go(folder, *command, code=None, **more):
    """Run a command there, with a PATH that looks there, too: the names of what ran in spite of that."""
    home = folder.parent / "home"
    home.mkdir(exist_ok=True)
    path = os.pathsep.join([".", "", "bin", os.environ["PATH"], "."])
    given = {"PIP_NO_INDEX": "1", "PIP_CONFIG_FILE": os.devnull, "HOME": str(home), **more}
    environment = {**os.environ, "PATH": path, "PYTHONPATH": os.pathsep.join(HOMES), **given}
    environment.pop("PYTHONSAFEPATH", None)  # commands that ran in this process may have set it
    ended = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    if code is not None:
        assert ended.returncode == code, ended.stdout + ended.stderr
    return sorted(path.name for path in (folder.parent / "left").iterdir()), ended.stdout + ended.stderr


def toposeam_there(folder, *words, **more):
    """The command as a script in an environment starts it: Python puts no working directory first."""
    start = "import toposeam_cli.__main__ as m; m.start()"
    return go(folder, sys.executable, "-P", "-c", start, *words, **more)


@pytest.mark.parametrize("command", [("-m", "venv", "v"), ("-c", "import pip")])
def test_the_trap_works(trap, command):
    ran, _said = go(trap, sys.executable, *command)
    assert ran


def test_a_program_of_that_folder_would_run(trap):
    ran, _said = go(trap, "git")
    assert ran == ["git"]


@pytest.mark.slow
@pytest.mark.parametrize("how", [("-j", "2"), ("--dask", "local", "-j", "2")])
def test_workers(trap, how):
    jobs = [
        f'[[stitch]]\npictures = ["{SAMPLES}/grass_a.png", "{SAMPLES}/grass_b.png"]\noverlap = 30\n'
        f'output = "{number}.png"\n'
        for number in range(2)
    ]
    (trap / "jobs.toml").write_text("".join(jobs))
    ran, _said = toposeam_there(trap, "batch", "jobs.toml", *how, code=0)
    assert not ran


def test_completion(trap):
    ran, said = toposeam_there(trap, "completion", "bash", code=0)
    assert not ran
    assert "_TOPOSEAM_COMPLETE" in said


@pytest.mark.medium
def test_a_doctor_of_gimp(trap):
    ran, said = toposeam_there(trap, "gimp", "install", "--dir", "plugs", code=0)
    assert not ran, said
    ran, said = toposeam_there(trap, "gimp", "doctor", "--dir", "plugs")
    assert not ran
    assert f"the engine {sys.executable}" in said or "the engine works" in said
    assert "GIMP 3.0 is installed: gimp" not in said


@pytest.mark.slow
def test_an_environment_for_gimp(trap):
    ran, said = toposeam_there(trap, "gimp", "install", "--dir", "plugs", "--venv", "own")
    assert not ran
    assert (trap / "own" / "pyvenv.cfg").is_file(), said


def wheel(folder):
    """TopoSeam as far as the plug-in asks for it."""
    about = f"toposeam-{__version__}.dist-info"
    file = folder / f"toposeam-{__version__}-py3-none-any.whl"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("toposeam/__init__.py", f"__version__ = {__version__!r}")
        archive.writestr("toposeam_engine/__init__.py", "")
        archive.writestr(
            f"{about}/METADATA", f"Metadata-Version: 2.1\nName: toposeam\nVersion: {__version__}\n"
        )
        archive.writestr(f"{about}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{about}/RECORD", "")
    return file


@pytest.mark.slow
def test_an_engine_made_in_gimp(trap, tmp_path):
    """With the names of Python that the plug-in tries, of which none may be one in the folder."""
    record = tmp_path / "engine.json"
    code = (
        "import sys\nfrom pathlib import Path\n"
        "from toposeam_gimp.engine import process, setting_up\n"
        f"setting_up.settings_file = process.settings_file = lambda: Path({str(record)!r})\n"
        f"setting_up.SettingUp().make(Path({str(tmp_path / 'engine')!r}), Path({str(wheel(tmp_path))!r}))\n"
    )
    ran, said = go(trap, sys.executable, "-P", "-c", code, code=0)
    assert not ran, said
    python = json.loads(record.read_text())["python"]
    assert python.startswith(str(tmp_path / "engine"))


@pytest.mark.parametrize("named", [True, False])
def test_the_engine(trap, tmp_path, named):
    record = {"python": sys.executable if not named else "python"}
    (tmp_path / "engine.json").write_text(json.dumps(record))
    code = (
        "from pathlib import Path\nfrom toposeam_gimp.engine import process\n"
        f"process.settings_file = lambda: Path({str(tmp_path / 'engine.json')!r})\n"
        "running = process.Engine()\nrunning.read_line(60)\nrunning.end()\n"
    )
    more = {"TOPOSEAM_PYTHON": "python3"} if named else {}
    ran, said = go(trap, sys.executable, "-P", "-c", code, code=0, **more)
    assert not ran, said


@pytest.mark.parametrize("python", ["bin/python3", "./python3"])
def test_no_relative_program_is_the_engine(trap, python):
    code = "from toposeam_gimp.engine import process\nprocess.Engine()\n"
    ran, said = go(trap, sys.executable, "-P", "-c", code, TOPOSEAM_PYTHON=python)
    assert not ran
    assert "that is not a program" in said


def test_programs_begin_in_an_empty_folder_of_their_user(trap, tmp_path):
    code = (
        "from toposeam_gimp.engine.launching import run\n"
        "import sys\n"
        "look = 'import os; print(oct(os.stat(\".\").st_mode & 0o777), os.listdir(), os.getcwd())'\n"
        "print(run([sys.executable, '-I', '-c', look]).stdout)\n"
    )
    _ran, said = go(trap, sys.executable, "-P", "-c", code, code=0, TMPDIR=str(tmp_path))
    assert said.split()[:2] == ["0o700", "[]"]
    assert not list(tmp_path.glob("toposeam-started-*"))
