"""GI-free: the one place that starts programs, for the plug-in and for ``toposeam gimp``.

Files that come from somebody else may lie in the working directory, some of them with names of programs or of
modules of Python. So programs are named by their full path, never found in the working directory nor by a
relative entry of PATH; they begin in an empty folder of this user, without variables that are for another
program; and Python takes no module from the working directory or from its variables.
"""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

#: Options of Python for modules of its own installation only.
ISOLATED = ("-I", "-X", "utf8")
#: The same for a Python that finds TopoSeam, perhaps among the packages of this user.
WITH_USERS_PACKAGES = ("-E", "-P", "-X", "utf8")

#: Variables for GIMP's own libraries, which another program must not see; and all that begin with PYTHON.
_FOREIGN = (
    "LD_PRELOAD",
    "LD_LIBRARY_PATH",
    "DYLD_LIBRARY_PATH",
    "DYLD_INSERT_LIBRARIES",
    "GI_TYPELIB_PATH",
    "GTK_PATH",
    "GDK_PIXBUF_MODULE_FILE",
    "VIRTUAL_ENV",
    "__PYVENV_LAUNCHER__",
)
_PREFIX = "toposeam-started-"
#: Age at which an empty folder counts as left behind by a crash, s.
_STALE_S = 24 * 3600.0


def absolute_entries(path: str) -> list[str]:
    """Return the entries of a PATH that are absolute; an empty one means the working directory."""
    return [entry for entry in path.split(os.pathsep) if Path(entry).is_absolute()]


def protect(environment: MutableMapping[str, str]) -> None:
    """Change the environment of this process so that what libraries start takes nothing from the working
    directory.
    """
    environment["PATH"] = os.pathsep.join(absolute_entries(environment.get("PATH", os.defpath)))
    environment["PYTHONSAFEPATH"] = "1"  # multiprocessing starts `python -c`
    environment["NoDefaultCurrentDirectoryInExePath"] = "1"  # Windows


def find_program(name: str) -> str | None:
    """Return the full path of a program: `name` if it is one, else the first on PATH; None without one."""
    if Path(name).is_absolute():
        return shutil.which(name)
    if os.path.dirname(name):  # noqa: PTH120 - a path, but a relative one
        return None
    file = f"{name}.exe" if sys.platform == "win32" and not name.lower().endswith(".exe") else name
    places = (Path(entry) / file for entry in absolute_entries(os.environ.get("PATH", os.defpath)))
    return next((str(place) for place in places if place.is_file() and os.access(place, os.X_OK)), None)


def clean_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment without the variables of GIMP's launchers for their own Python and libraries,
    without relative entries of PATH, and with one BLAS thread.
    """
    clean = {
        name: value
        for name, value in environment.items()
        if name not in _FOREIGN and not name.startswith("PYTHON")
    }
    clean["PATH"] = os.pathsep.join(absolute_entries(environment.get("PATH", os.defpath)))
    return {**clean, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONUTF8": "1"}


@contextmanager
def started(
    command: Sequence[str],
    *,
    environment: Mapping[str, str] | None = None,
    stdin: int = subprocess.DEVNULL,
    stdout: int = subprocess.PIPE,
    stderr: int | IO[bytes] = subprocess.PIPE,
) -> Iterator[subprocess.Popen[bytes]]:
    """Start a program without a shell; it is ended with the block.

    Parameters
    ----------
    command : sequence of str
        Program and arguments; full paths, as the program begins in an empty folder.
    environment : mapping, optional
        By default the cleaned one of this process.
    stdin, stdout, stderr
        As for :class:`subprocess.Popen`.

    Raises
    ------
    OSError
        When there is no such program, or it does not start.
    """
    program = _program(command[0])
    _sweep()
    folder = tempfile.mkdtemp(prefix=_PREFIX)
    try:
        process: subprocess.Popen[bytes] = subprocess.Popen(  # noqa: S603 - a full path, and no shell
            [program, *command[1:]],
            cwd=folder,
            env=clean_environment(os.environ) if environment is None else dict(environment),
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            stdin=stdin,
            stdout=stdout,
            stderr=stderr,
        )
        try:
            yield process
        finally:
            if process.poll() is None:
                process.kill()
            process.wait()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _program(name: str) -> str:
    """Return the full path of a program; raises FileNotFoundError where there is none."""
    program = find_program(name)
    if program is None:
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), name)
    return program


def leave_running(command: Sequence[str]) -> None:
    """Start a program that outlives this process, in the root folder; what it prints is dropped.

    Raises
    ------
    OSError
        When there is no such program, or it does not start.
    """
    program = _program(command[0])
    nothing = subprocess.DEVNULL
    process = subprocess.Popen(  # noqa: S603 - a full path, and no shell
        [program, *command[1:]],
        cwd=os.sep,
        env=clean_environment(os.environ),
        stdin=nothing,
        stdout=nothing,
        stderr=nothing,
        start_new_session=True,
    )
    process.returncode = 0  # nobody waits for it


def run(
    command: Sequence[str], *, environment: Mapping[str, str] | None = None, timeout_s: float | None = None
) -> subprocess.CompletedProcess[str]:
    """Run a program to its end; return its exit code and what it prints.

    Raises
    ------
    OSError
        As :func:`started` does.
    subprocess.TimeoutExpired
    """
    with started(command, environment=environment) as process:
        out, noise = process.communicate(timeout=timeout_s)
    told = (each.decode("utf-8", errors="replace") for each in (out, noise))
    return subprocess.CompletedProcess(list(command), process.returncode, *told)


def _sweep() -> None:
    """Remove folders that crashes have left; those of others and those that hold something stay."""
    for folder in Path(tempfile.gettempdir()).glob(_PREFIX + "*"):
        with suppress(OSError):
            if time.time() - folder.lstat().st_mtime > _STALE_S:
                folder.rmdir()
