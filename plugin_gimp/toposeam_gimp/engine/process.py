"""GI-free: the engine process, which does the numerics, and the exchange of requests and answers with it.

It is the Python of an installed TopoSeam, named in ``engine.json`` beside this file by ``toposeam gimp
install``. The request and all pixels lie in a private folder; JSON lines come back on its stdout. The engine
ends with us: its stdin is a pipe that closes when we end.
"""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import IO, Any

from toposeam_gimp import __version__
from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.engine.keeping import KeptEngine, keep_engine, kept_engine
from toposeam_gimp.engine.launching import WITH_USERS_PACKAGES, find_program, started
from toposeam_gimp.sentences import in_gimps_words
from toposeam_gimp.texts import _

PROTOCOL = 5
#: Silence after which the engine counts as hanging, s; it sends an event every two seconds.
SILENCE_S = 300.0
#: Name of the file for the engine's stderr in a request's folder.
_LOG = "engine.log"

_INSTALL = _("Run “toposeam gimp install” in a terminal, as the README of TopoSeam says, then try again.")


class EngineError(Exception):
    """The engine failed; the text says what to do."""


class NoEngineError(EngineError):
    """There is no engine, or it has ended."""


class _SaidError(EngineError):
    """An error that the engine reported, after which it can be asked again."""


class _EndedError(EngineError):
    """The engine has ended without an answer."""


def settings_file() -> Path:
    """Return the file in which ``toposeam gimp install`` writes the Python to use."""
    return Path(__file__).parents[1] / "engine.json"


def missing_methods() -> list[str]:
    """Return the methods that the installed engine lacks, as the installer recorded them."""
    try:
        return list(json.loads(settings_file().read_text(encoding="utf-8"))["without"])
    except (OSError, ValueError, KeyError, TypeError):
        return []


def find_python(environment: Mapping[str, str] | None = None, home: Path | None = None) -> str:
    """Find the Python that has TopoSeam: the one of TOPOSEAM_PYTHON, the installer's, or pipx's and uv's.

    Raises
    ------
    EngineError
        When there is none.
    """
    environment = os.environ if environment is None else environment
    named = environment.get("TOPOSEAM_PYTHON")
    if named:
        if find_program(named) is None:
            text = _("TOPOSEAM_PYTHON is {python}, but that is not a program; correct it or unset it.")
            raise EngineError(text.format(python=named))
        return named
    try:
        recorded = str(json.loads(settings_file().read_text(encoding="utf-8"))["python"])
    except (OSError, ValueError, KeyError, TypeError):
        recorded = ""
    if recorded:
        if find_program(recorded) is None:
            gone = _("TopoSeam's engine {python} is gone.").format(python=recorded)
            raise NoEngineError(f"{gone} {_INSTALL}")
        return recorded
    for place in _usual_places(Path.home() if home is None else home):
        if place.exists():
            return str(place)
    raise NoEngineError(_("TopoSeam's engine is not installed for GIMP.") + f" {_INSTALL}")


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


def command_of(python: str) -> list[str]:
    """Return the command that starts the engine of a Python; a request's folder is appended."""
    return [python, *WITH_USERS_PACKAGES, "-m", "toposeam_engine"]


def ask(
    folder: RequestFolder,
    request: Mapping[str, Any],
    progress: Callable[[float], None],
    *,
    command: Iterable[str] | None = None,
    silence_s: float = SILENCE_S,
    waiting: Engine | None = None,
    step: Callable[[str], object] = lambda _name: None,
) -> dict[str, Any]:
    """Let the engine work on a request whose pixels are in the folder already.

    Parameters
    ----------
    folder : RequestFolder
    request : mapping
        ``operation``, ``options`` and the operation's other entries; protocol and version are added here.
    progress : callable
        Called with the share of the work done, in [0, 1].
    command : iterable of str, optional
        What to run instead of the engine; the folder is appended.
    silence_s : float
        Longest silence of the engine, s.
    waiting : Engine, optional
        An engine that was started before and waits. It waits again after an answer, and is ended if it gives
        none.
    step : callable
        Called with the name of each step that begins.

    Returns
    -------
    dict
        The result.

    Raises
    ------
    EngineError
        The engine's own error, or the reason of its end.
    """
    text = json.dumps({"protocol": PROTOCOL, "version": __version__, **request})
    (folder.path / "request.json").write_text(text, encoding="utf-8")
    if waiting is not None:
        try:
            waiting.tell(str(folder.path), folder.nonce)
            return _listen(waiting, folder, progress, step, silence_s)
        except _SaidError:
            raise
        except BaseException:
            waiting.end()
            raise
    if folder.engine is None:
        begin(folder, command=command)
    try:
        if isinstance(folder.engine, KeptEngine):
            with suppress(_EndedError):
                folder.engine.tell(str(folder.path), folder.nonce)
                return _listen(folder.engine, folder, progress, step, silence_s)
            folder.end_engine()  # killed, perhaps; another one says why if it cannot do it either
            begin(folder, command=command)
        folder.engine.tell(folder.nonce)
        return _listen(folder.engine, folder, progress, step, silence_s, folder.path / _LOG)
    finally:
        folder.end_engine()


def begin(folder: RequestFolder, of: str = "", command: Iterable[str] | None = None) -> None:
    """Take the engine that is kept between calls for Re-stitch, if there is one, else start one for this
    folder, so that it loads its modules while pixels are written.

    Parameters
    ----------
    folder : RequestFolder
    of : str
        The operation that will be requested, if it is known.
    command : iterable of str, optional
        What to run instead of the engine.

    Raises
    ------
    EngineError
        When it cannot be started.
    """
    if of == "restitch" and (kept := kept_engine(command_of(find_python()), PROTOCOL)) is not None:
        folder.engine = kept
        return
    with (folder.path / _LOG).open("wb") as noise:
        folder.engine = Engine([str(folder.path), *([of] if of else [])], noise, command)


def keep() -> None:
    """Start the engine that Re-stitch takes next, unless it runs."""
    with suppress(EngineError):
        keep_engine(command_of(find_python()))


class Engine:
    """An engine process and the lines that it prints.

    Parameters
    ----------
    arguments : sequence of str
        A request's folder; or ``-`` and perhaps the name of a preview, for an engine that waits for requests.
    noise : file, optional
        File for its stderr.
    command : iterable of str, optional
        What to run instead.

    Raises
    ------
    EngineError
        When there is no engine, or it cannot be started.
    """

    def __init__(
        self,
        arguments: Sequence[str] = ("-",),
        noise: IO[bytes] | int = subprocess.DEVNULL,
        command: Iterable[str] | None = None,
    ) -> None:
        python = command_of(find_python()) if command is None else list(command)
        self._block = ExitStack()
        try:
            self._process = self._block.enter_context(
                started([*python, *arguments], stdin=subprocess.PIPE, stderr=noise)
            )
        except OSError as error:
            text = _("TopoSeam's engine {python} does not start ({reason}).")
            said = text.format(python=python[0], reason=error.strerror)
            raise EngineError(f"{said} {_INSTALL}") from error
        #: Whether it has sent its protocol and version.
        self.greeted = False
        self._lines: queue.Queue[bytes | None] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    @property
    def lives(self) -> bool:
        """True if the process runs and can be asked."""
        return self._process.poll() is None

    def tell(self, *lines: str) -> None:
        """Send lines: the nonce of a folder, by which the engine recognizes it, and before it the folder if
        the engine does not know it yet.
        """
        with suppress(OSError):  # it has ended already, which reading shows
            if self._process.stdin is not None:
                self._process.stdin.write("".join(f"{line}\n" for line in lines).encode())
                self._process.stdin.flush()

    def read_line(self, silence_s: float) -> bytes | None:
        """Return the next line; None after the engine's end.

        Raises
        ------
        queue.Empty
            After `silence_s` seconds without a line.
        """
        return self._lines.get(timeout=silence_s)

    def kill(self) -> None:
        """Kill the process, if it still runs."""
        if self.lives:
            self._process.kill()

    def end(self) -> int:
        """Kill the process and wait for its end; return its exit code."""
        self.kill()
        code = self.wait()
        if self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()
        self._block.close()
        return code

    def wait(self) -> int:
        """Wait for the end of the process; return its exit code."""
        return self._process.wait()

    def _read(self) -> None:
        if self._process.stdout is not None:
            # Until the pipe closes, which is after the engine's end if a process that it started outlives it.
            with self._process.stdout, suppress(OSError):
                for line in self._process.stdout:
                    self._lines.put(line)
        self._lines.put(None)


def _listen(
    process: Engine | KeptEngine,
    folder: RequestFolder,
    progress: Callable[[float], None],
    step: Callable[[str], object],
    silence_s: float,
    log: Path | None = None,
) -> dict[str, Any]:
    share = 0.0
    while True:
        try:
            line = process.read_line(silence_s)
        except queue.Empty:
            raise EngineError(
                _(
                    "TopoSeam's engine has not moved for {seconds} s and was stopped; nothing was changed. "
                    "Try again."
                ).format(seconds=round(silence_s))
            ) from None
        if line is None:
            raise _EndedError(_obituary(process, log))
        folder.touch()
        try:
            event = json.loads(line)
            kind = event["event"]
        except (ValueError, KeyError, TypeError):
            continue
        if kind == "hello":
            process.greeted = True
            if (event.get("protocol"), event.get("version")) != (PROTOCOL, __version__):
                raise EngineError(
                    _(
                        "The plug-in is of TopoSeam {own} and the installed TopoSeam is {other}; run "
                        "“toposeam gimp install” and start GIMP again."
                    ).format(own=__version__, other=event.get("version"))
                )
        elif kind in ("progress", "alive"):
            share = float(event.get("share", share))
            progress(share)
        elif kind == "step":
            step(str(event.get("name")))
        elif kind == "error":
            raise _SaidError(in_gimps_words(event))
        elif kind == "result":
            result: dict[str, Any] = event["result"]
            return result


def _obituary(process: Engine | KeptEngine, log: Path | None) -> str:
    """Return the message for the user about an engine that ended without an error."""
    code = process.wait()
    said = [
        line.strip()
        for line in (log.read_text(encoding="utf-8", errors="replace") if log else "").splitlines()
        if line.strip()
    ][-1:]
    last = " " + _("Its last words: {words}").format(words=said[0][:300]) if said else ""
    if not process.greeted:
        return _("TopoSeam's engine does not start.") + f"{last} {_INSTALL}"
    if code in (-9, 137):
        return _(
            "TopoSeam's engine was killed, perhaps because memory ran out; nothing was changed. Close other "
            "pictures and try again."
        )
    ended = _("TopoSeam's engine ended unexpectedly (code {code}); nothing was changed.")
    return ended.format(code=code) + last
