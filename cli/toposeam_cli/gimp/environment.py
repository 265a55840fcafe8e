"""The Python of the engine for GIMP: a check that it has TopoSeam, and a virtual environment for it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import toposeam as ts
from toposeam.errors import OptionError
from toposeam_cli.files.writing import OutputError
from toposeam_gimp.engine.launching import ISOLATED, WITH_USERS_PACKAGES, run

_ASK = (
    "import importlib.util, toposeam, toposeam_engine;"
    "print(toposeam.__version__, importlib.util.find_spec('maxflow') is not None)"
)
_ASK_S = 60.0
_INSTALL = ("install", "--disable-pip-version-check", "--upgrade")


def check_python(python: Path) -> list[str]:
    """List the methods of the plug-in that the engine of a Python lacks.

    Raises
    ------
    OptionError
        When it is no Python, or has no TopoSeam or another release of it.
    """
    try:
        answer = run([str(python), *WITH_USERS_PACKAGES, "-c", _ASK], timeout_s=_ASK_S)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise OptionError(
            f"{python} does not run ({type(error).__name__}); give the python of an environment that has "
            "toposeam"
        ) from error
    words = answer.stdout.split()
    if answer.returncode != 0 or len(words) != 2:
        said = (answer.stderr.strip().splitlines() or ["it says nothing"])[-1]
        raise OptionError(
            f"{python} has no TopoSeam ({said}); give the python of an environment that has it, or let one "
            "be made: toposeam gimp install --venv"
        )
    if words[0] != ts.__version__:
        raise OptionError(
            f"{python} has TopoSeam {words[0]}, and this is {ts.__version__}; install the same there"
        )
    return [] if words[1] == "True" else ["graph-cut"]


def is_temporary(python: Path) -> bool:
    """Test whether an environment is temporary: uvx and pipx run throw theirs away."""
    text = python.as_posix()
    places = (tempfile.gettempdir(), os.environ.get("TMPDIR", ""))
    return (
        re.search(r"/uv/(cache/)?(archive|builds|environments)-v\d", text) is not None
        or re.search(r"/(\.cache/pipx|Library/Caches/pipx|pipx/(\.cache|Cache))/", text) is not None
        or any(place and text.startswith(Path(place).as_posix() + "/") for place in places)
    )


def usual_folder() -> Path:
    """Return the default folder of an environment for GIMP."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "TopoSeam" / "venv"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "TopoSeam" / "venv"
    return Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share") / "toposeam" / "venv"


def make_environment(folder: Path) -> Path:
    """Make a virtual environment with the TopoSeam that is running; return its Python.

    Raises
    ------
    OptionError
        When the folder holds something else.
    OutputError
        When it cannot be made; the text ends with the last line of the failed command.
    """
    if folder.exists() and not folder.is_dir():
        raise OptionError(f"{folder} is a file; name a folder, as --venv FOLDER")
    if folder.exists() and not (folder / "pyvenv.cfg").is_file() and any(folder.iterdir()):
        raise OptionError(f"{folder} holds something else; name an empty folder, as --venv FOLDER")
    python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    steps = (
        (
            [sys.executable, *ISOLATED, "-m", "venv", str(folder)],
            "apt install python3-venv on Debian and Ubuntu",
        ),
        (
            [str(python), *ISOLATED, "-m", "pip", *_INSTALL, requirement()],
            "see whether the network can be reached",
        ),
    )
    for command, hint in steps:
        try:
            ended = run(command)
        except OSError as error:
            raise OutputError(f"{command[0]} does not run ({error.strerror}); {hint}") from error
        if ended.returncode != 0:
            said = ((ended.stderr or ended.stdout).strip().splitlines() or ["no reason given"])[-1]
            raise OutputError(f"an environment in {folder} could not be made ({said}); {hint}")
    return python


def requirement() -> str:
    """Return pip's requirement for this very TopoSeam: the checkout or archive from which it was installed.
    No package index has it, so a package of that name there would be a stranger's.

    Raises
    ------
    OptionError
        When that place is not known.
    """
    try:
        answer = distribution("toposeam").read_text("direct_url.json")
    except PackageNotFoundError:
        answer = None
    if answer:
        return f"toposeam[cli] @ {json.loads(answer)['url']}"
    raise OptionError(
        "this TopoSeam does not say where it was installed from; make an environment from a checkout "
        "(python -m venv FOLDER, and FOLDER/bin/pip install CHECKOUT[cli]), and name its Python with --python"
    )
