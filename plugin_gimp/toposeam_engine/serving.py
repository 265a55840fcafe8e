"""``python -m toposeam_engine FOLDER [OPERATION]``: the numerics for programs that cannot load them, like the
GIMP plug-in.

The folder belongs to one request and holds all of it: ``request.json``, the pixels in raw files beside it,
and the results. The asker made it, put a nonce into a file called ``toposeam-request`` there, and writes
the same nonce as the first line on stdin; any other folder is refused and left untouched. The engine speaks
on stdout, one JSON object a line::

    {"event": "hello", "protocol": 5, "version": "0.2.0"}
    {"event": "step", "name": "seams"}                  what is done next
    {"event": "progress", "share": 0.25}
    {"event": "alive"}                                  every few seconds, so that silence means trouble
    {"event": "result", "result": {…}}                  or what went wrong:
    {"event": "error", "message": "what to do", "kind": "apart", "parameter": null, "data": {"name": "sky"}}

With the name of an operation it loads that operation's modules before the nonce comes, while pixels are
written. Called with ``-`` in place of a folder, and perhaps with names of previews, it loads its libraries
and serves one request after another, as for previews: each is two lines on stdin, the folder's name and its
nonce, and gets one result or error. Called with ``--listen`` it does so for one connection after another
(:mod:`toposeam_engine.listening`).

It ends when its stdin is closed, as the asker has ended then, and removes the folder on which it works. To
cancel, end the process.
"""

from __future__ import annotations

import hmac
import json
import math
import os
import queue
import shutil
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any, TextIO

from toposeam.errors import Interval, Term, TopoSeamError
from toposeam.sentence import as_toposeam_error, printable
from toposeam_engine.job import EngineJob

#: Version of the protocol, to be raised when requests or results change their meaning.
PROTOCOL = 5
#: The file with the nonce in a request's folder; the plug-in writes it.
MARKER = "toposeam-request"
_LONGEST_NONCE = 200
_LONGEST_LINE = 4096
#: The operations, and the module of each, whose function of that name does it; loaded on demand.
OPERATIONS = {
    "stitch": "seams",
    "restitch": "restitching",
    "patch": "seams",
    "synthesize": "textures",
    "make_tileable": "textures",
    "fill": "textures",
    "motif": "motifs",
    "repeat": "motifs",
    "loop": "animations",
    "preview": "previews",
}
_HEARTBEAT_S = 2.0


class Channel:
    """The events to the asker; used from several threads."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._lock = threading.Lock()
        self._share = -1.0

    def send(self, event: str, **fields: Any) -> None:
        """Send one event."""
        with self._lock:
            self._stream.write(json.dumps({"event": event, **fields}) + "\n")
            self._stream.flush()

    def progress(self, share: float) -> None:
        """Report the share of the work done, in [0, 1]; invisibly small steps are left out."""
        if share >= self._share + 0.002 or share >= 1.0 > self._share:
            self._share = share
            self.send("progress", share=round(min(max(share, 0.0), 1.0), 4))

    def restart(self) -> None:
        """Reset the progress to 0 for the next request."""
        self._share = -1.0


class Asker:
    """The asking process, at the other end of a file descriptor, which a thread reads. Once that is closed
    nobody needs results, and the engine cleans up: the request's folder, and perhaps the socket on which it
    listens.
    """

    def __init__(self, descriptor: int = 0, listens: Path | None = None) -> None:
        self._descriptor, self._listens = descriptor, listens
        self._lines: queue.Queue[bytes | None] = queue.Queue()
        self._folder: Path | None = None
        self._gone = False
        self._lock = threading.Lock()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def line(self) -> bytes | None:
        """Return the next line; an incomplete last line counts, and None is the end."""
        return self._lines.get()

    def waits_for(self, folder: Path | None) -> None:
        """Set the folder in work, which is removed when the asker ends."""
        with self._lock:
            self._folder = folder
            gone = self._gone
        if gone and folder is not None:
            self._leave(folder)

    def join_if_gone(self) -> None:
        """Wait for the end of this process if the asker has ended, as the request's folder is then gone."""
        if self._gone and self._folder is not None:
            self._reader.join()

    def _read(self) -> None:
        rest = b""
        while block := self._block():
            *lines, rest = (rest + block).split(b"\n")
            for line in [*lines, *([rest] if len(rest) > _LONGEST_LINE else [])]:
                self._lines.put(line[: _LONGEST_LINE + 1])
            rest = rest if len(rest) <= _LONGEST_LINE else b""
        if rest:
            self._lines.put(rest)
        self._lines.put(None)
        with self._lock:
            self._gone, folder = True, self._folder
        if folder is not None:
            self._leave(folder)

    def _block(self) -> bytes:
        """Return what was written; nothing at the end. It does not go through sys.stdin, whose lock would
        abort the interpreter's end.
        """
        try:
            return os.read(self._descriptor, 4096)
        except OSError:  # a connection that was reset
            return b""

    def _leave(self, folder: Path) -> None:
        shutil.rmtree(folder, ignore_errors=True)
        if self._listens is not None:
            self._listens.unlink(missing_ok=True)
        os._exit(3)


def main(arguments: list[str] | None = None) -> int:
    """Serve one request, or all that come."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments[:1] == ["--listen"] and len(arguments) == 3 and arguments[2].isdigit():
        return _listen(Path(arguments[1]), int(arguments[2]))
    waits = arguments[:1] == ["-"] and len(arguments) <= 2
    if not waits and (len(arguments) not in (1, 2) or not Path(arguments[0]).is_dir()):
        print("usage: python -m toposeam_engine FOLDER   (the GIMP plug-in calls it)", file=sys.stderr)  # noqa: T201
        return 2
    # Output of libraries must not get between the events.
    channel = Channel(os.fdopen(os.dup(1), "w", encoding="utf-8"))
    os.dup2(2, 1)
    asker = Asker()
    try:
        channel.send("hello", protocol=PROTOCOL, version=_version())
        if waits:
            _load_all()
        for of in arguments[1:]:
            import_module("toposeam_engine.rehearsing").rehearse(of)
    except Exception as error:
        channel.send("error", **described(error))
        return 1
    threading.Thread(target=_beat, args=(channel,), daemon=True).start()
    if not waits:
        return _answer(asker, channel, Path(arguments[0]), asker.line())
    return _answer_all(asker, channel)


def _answer_all(asker: Asker, channel: Channel) -> int:
    """Serve one request after another until the asker leaves."""
    code = 0
    while name := asker.line():
        code = _answer(asker, channel, Path(os.fsdecode(name)), asker.line())
        channel.restart()
    return code


def _listen(address: Path, owner: int) -> int:
    """Serve one connection after another."""
    listening = import_module("toposeam_engine.listening")
    _load_all()
    import_module("toposeam_engine.rehearsing").rehearse("restitch")
    listener = listening.bound(address)
    if listener is None:
        return 0
    try:
        while (connection := listening.next_asker(listener, owner)) is not None:
            with connection, suppress(OSError), connection.makefile("w", encoding="utf-8") as stream:
                channel, asker = Channel(stream), Asker(connection.fileno(), address)
                channel.send("hello", protocol=PROTOCOL, version=_version())
                threading.Thread(target=_beat, args=(channel,), daemon=True).start()
                _answer_all(asker, channel)
    finally:
        listener.close()
        address.unlink(missing_ok=True)
    return 0


def _load_all() -> None:
    """Load all modules that requests may need, which takes longer than most previews."""
    for module in set(OPERATIONS.values()):
        import_module(f"toposeam_engine.{module}")


def _answer(asker: Asker, channel: Channel, folder: Path, nonce: bytes | None) -> int:
    """Serve one request."""
    try:
        folder = folder.resolve()
        _check_folder(folder, nonce or b"")
        asker.waits_for(folder)
        result = _serve(folder, channel)
        asker.waits_for(None)
    except Exception as error:
        asker.join_if_gone()
        asker.waits_for(None)
        channel.send("error", **described(error))
        return 1
    channel.send("result", result=result)
    return 0


def described(error: BaseException) -> dict[str, Any]:
    """Describe an error for the asker: its sentence, and the kind, parameter and data with which the asker
    makes its own.
    """
    ours = as_toposeam_error(error)
    data: dict[str, Any] = {}
    for name, value in ours.data.items():
        if isinstance(value, Interval):
            ends = {"above" if value.above else "least": value.low, "most": value.high}
            data |= {end: f"{number:g}" for end, number in ends.items() if math.isfinite(number)}
        elif isinstance(value, Term) and not value.name:
            data["name"] = printable(str(value))
        elif isinstance(value, tuple):
            data[name] = printable(", ".join(map(str, value)))
        elif not isinstance(value, Term | TopoSeamError):
            data[name] = printable(str(value))
    message = ours.sentence(lambda term: "layers" if term.name == "patches" else None)
    return {"message": printable(message), "kind": ours.kind, "parameter": ours.parameter, "data": data}


def _check_folder(folder: Path, expected: bytes) -> None:
    """Refuse a folder that the asker did not make for this request, as it would be removed at the end."""
    from toposeam.errors import OptionError

    marker = folder / MARKER
    nonce = b""
    if marker.is_file() and not marker.is_symlink():
        with marker.open("rb") as file:
            nonce = file.read(_LONGEST_NONCE)
    if not nonce or not hmac.compare_digest(nonce, expected):
        raise OptionError(
            f"'{folder}' is no request of TopoSeam's plug-in, and was left untouched; only GIMP calls "
            "the engine (after an update, run “toposeam gimp install” and start GIMP again)"
        )


def _serve(folder: Path, channel: Channel) -> dict[str, Any]:
    from toposeam.errors import OptionError

    try:
        request = json.loads((folder / "request.json").read_text(encoding="utf-8"))
    except (ValueError, RecursionError):
        request = None
    if not isinstance(request, dict):
        raise OptionError(f"'{folder}' holds no request; run “toposeam gimp install” and start GIMP again")
    if request.get("protocol") != PROTOCOL or request.get("version") != _version():
        raise OptionError(
            f"the plug-in is of TopoSeam {request.get('version')} and the installed TopoSeam is "
            f"{_version()}; run “toposeam gimp install” and start GIMP again"
        )
    name = request.get("operation")
    if name not in OPERATIONS:
        raise OptionError(f"the engine has no operation {name!r}; it has {', '.join(OPERATIONS)}")
    operation: Callable[[EngineJob], dict[str, Any]] = getattr(
        import_module(f"toposeam_engine.{OPERATIONS[name]}"), name
    )
    return operation(
        EngineJob(
            folder=folder,
            request=request,
            progress=channel.progress,
            step=lambda name: channel.send("step", name=name),
        )
    )


def _version() -> str:
    import toposeam

    return toposeam.__version__


def _beat(channel: Channel) -> None:
    clock = threading.Event()
    with suppress(OSError, ValueError):  # a connection that was closed
        while not clock.wait(_HEARTBEAT_S):
            channel.send("alive")
