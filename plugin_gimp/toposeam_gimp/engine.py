"""GI-free: the engine process that does the numerics.

It is the Python of an installed TopoSeam, named in ``engine.json`` beside this file by ``toposeam gimp
install``. The request and all pixels lie in a private folder; JSON lines come back on its stdout. It dies
with us: its stdin is a pipe that breaks when we end.
"""

from __future__ import annotations

import json
import os
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from toposeam_gimp import __version__
from toposeam_gimp.folder import RequestFolder
from toposeam_gimp.sentences import in_gimps_words
from toposeam_gimp.texts import _

PROTOCOL = 2
#: The engine speaks every two seconds; this long a silence means that it hangs.
SILENCE_S = 300.0

#: What GIMP's own libraries need and another Python must not see.
_FOREIGN = (
    "LD_PRELOAD",
    "LD_LIBRARY_PATH",
    "DYLD_LIBRARY_PATH",
    "DYLD_INSERT_LIBRARIES",
    "PYTHONHOME",
    "PYTHONPATH",
    "PYTHONSTARTUP",
    "PYTHONEXECUTABLE",
    "PYTHONPLATLIBDIR",
    "GI_TYPELIB_PATH",
    "GTK_PATH",
    "GDK_PIXBUF_MODULE_FILE",
    "VIRTUAL_ENV",
    "__PYVENV_LAUNCHER__",
)

_INSTALL = _("Run “toposeam gimp install” in a terminal, as the README of TopoSeam says, then try again.")


class EngineError(Exception):
    """The engine could not do it; the text says what to do."""


def settings_file() -> Path:
    """Where ``toposeam gimp install`` writes which Python to use."""
    return Path(__file__).with_name("engine.json")


def missing_methods() -> list[str]:
    """Methods that the installed engine lacks, as far as the installer noted it."""
    try:
        return list(json.loads(settings_file().read_text(encoding="utf-8"))["without"])
    except (OSError, ValueError, KeyError, TypeError):
        return []


def find_python(environment: Mapping[str, str] | None = None, home: Path | None = None) -> str:
    """The Python that has TopoSeam: as told by TOPOSEAM_PYTHON, by the installer, or where pipx and uv put
    it.

    Raises
    ------
    EngineError
        When there is none.
    """
    environment = os.environ if environment is None else environment
    told = environment.get("TOPOSEAM_PYTHON")
    if told:
        if shutil.which(told) is None:
            text = _("TOPOSEAM_PYTHON is {python}, but that is not a program; correct it or unset it.")
            raise EngineError(text.format(python=told))
        return told
    try:
        recorded = str(json.loads(settings_file().read_text(encoding="utf-8"))["python"])
    except (OSError, ValueError, KeyError, TypeError):
        recorded = ""
    if recorded:
        if shutil.which(recorded) is None:
            gone = _("TopoSeam's engine {python} is gone.").format(python=recorded)
            raise EngineError(f"{gone} {_INSTALL}")
        return recorded
    for place in _usual_places(Path.home() if home is None else home):
        if place.exists():
            return str(place)
    raise EngineError(_("TopoSeam's engine is not installed for GIMP.") + f" {_INSTALL}")


def _usual_places(home: Path) -> Iterator[Path]:
    python = Path("Scripts/python.exe") if sys.platform == "win32" else Path("bin/python")
    for tools in (
        ".local/share/pipx/venvs",
        ".local/pipx/venvs",
        "pipx/venvs",
        ".local/share/uv/tools",
        "AppData/Roaming/uv/tools",
    ):
        yield home / tools / "toposeam" / python


def clean_environment(environment: Mapping[str, str]) -> dict[str, str]:
    """The environment without what GIMP's launchers put there for their own Python and libraries; one BLAS
    thread.
    """
    clean = {name: value for name, value in environment.items() if name not in _FOREIGN}
    return {**clean, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONUTF8": "1"}


def ask(
    folder: RequestFolder,
    request: Mapping[str, Any],
    progress: Callable[[float], None],
    *,
    command: Iterable[str] | None = None,
    silence_s: float = SILENCE_S,
    waiting: subprocess.Popen[bytes] | None = None,
) -> dict[str, Any]:
    """Let the engine work on a request whose pixels are in the folder already.

    Parameters
    ----------
    folder : RequestFolder
    request : mapping
        ``operation``, ``options``, and what the operation wants; protocol and version are added here.
    progress : callable
        Called with the share of the work done, in [0, 1].
    command : iterable of str, optional
        What to run instead of the engine; the folder is appended.
    silence_s : float
        Give up after so many seconds without a sign of life.
    waiting : process, optional
        An engine that was started before and waits; it ends with the request.

    Returns
    -------
    dict
        The result.

    Raises
    ------
    EngineError
        The engine's own sentence, or what became of the engine.
    """
    text = json.dumps({"protocol": PROTOCOL, "version": __version__, **request})
    (folder.path / "request.json").write_text(text, encoding="utf-8")
    log = folder.path / "engine.log"
    if waiting is None:
        with log.open("wb") as noise:
            process = start(str(folder.path), noise, command)
    else:
        process = waiting
    try:
        _introduce(process, [folder.nonce] if waiting is None else [str(folder.path), folder.nonce])
        return _listen(process, folder, progress, silence_s, log)
    finally:
        end(process)


def start(
    place: str = "-", noise: IO[bytes] | int = subprocess.DEVNULL, command: Iterable[str] | None = None
) -> subprocess.Popen[bytes]:
    """An engine for a request's folder; without one it loads its libraries and waits to be told.

    Raises
    ------
    EngineError
        When there is none, or it cannot be started.
    """
    python = [find_python(), "-P", "-m", "toposeam_engine"] if command is None else list(command)
    try:
        return subprocess.Popen(  # noqa: S603 - the program the installer recorded, and no shell
            [*python, place],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=noise,
            cwd=tempfile.gettempdir(),
            env=clean_environment(os.environ),
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )
    except OSError as error:
        text = _("TopoSeam's engine {python} does not start ({reason}).")
        said = text.format(python=python[0], reason=error.strerror)
        raise EngineError(f"{said} {_INSTALL}") from error


def end(process: subprocess.Popen[bytes]) -> None:
    """End an engine, whatever it does."""
    if process.poll() is None:
        process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()


def _introduce(process: subprocess.Popen[bytes], lines: Iterable[str]) -> None:
    """Tell the engine the nonce of the folder, so that it takes no other for a request's; and the folder, if
    it does not know it yet.
    """
    with suppress(OSError):  # it is gone already; what became of it is told below
        if process.stdin is not None:
            process.stdin.write("".join(f"{line}\n" for line in lines).encode())
            process.stdin.flush()


def _listen(
    process: subprocess.Popen[bytes],
    folder: RequestFolder,
    progress: Callable[[float], None],
    silence_s: float,
    log: Path,
) -> dict[str, Any]:
    lines: queue.Queue[bytes | None] = queue.Queue()
    threading.Thread(target=_read, args=(process, lines), daemon=True).start()
    greeted = False
    while True:
        try:
            line = lines.get(timeout=silence_s)
        except queue.Empty:
            raise EngineError(
                _(
                    "TopoSeam's engine has not moved for {seconds} s and was stopped; nothing was changed. "
                    "Try again."
                ).format(seconds=round(silence_s))
            ) from None
        if line is None:
            raise EngineError(_obituary(process, log, greeted))
        folder.touch()
        try:
            event = json.loads(line)
            kind = event["event"]
        except (ValueError, KeyError, TypeError):
            continue
        if kind == "hello":
            greeted = True
            if (event.get("protocol"), event.get("version")) != (PROTOCOL, __version__):
                raise EngineError(
                    _(
                        "The plug-in is of TopoSeam {own} and the installed TopoSeam is {other}; run "
                        "“toposeam gimp install” and start GIMP again."
                    ).format(own=__version__, other=event.get("version"))
                )
        elif kind == "progress":
            progress(float(event["share"]))
        elif kind == "error":
            raise EngineError(in_gimps_words(str(event["message"])))
        elif kind == "result":
            result: dict[str, Any] = event["result"]
            return result


def _read(process: subprocess.Popen[bytes], lines: queue.Queue[bytes | None]) -> None:
    if process.stdout is not None:
        for line in process.stdout:
            lines.put(line)
    lines.put(None)


def _obituary(process: subprocess.Popen[bytes], log: Path, greeted: bool) -> str:
    """What to tell the user about an engine that ended without a word."""
    code = process.wait()
    said = [
        line.strip()
        for line in (log.read_text(encoding="utf-8", errors="replace") if log.exists() else "").splitlines()
        if line.strip()
    ][-1:]
    last = " " + _("Its last words: {words}").format(words=said[0][:300]) if said else ""
    if not greeted:
        return _("TopoSeam's engine does not start.") + f"{last} {_INSTALL}"
    if code in (-9, 137):
        return _(
            "TopoSeam's engine was killed, perhaps because memory ran out; nothing was changed. Close other "
            "pictures and try again."
        )
    ended = _("TopoSeam's engine ended unexpectedly (code {code}); nothing was changed.")
    return ended.format(code=code) + last
