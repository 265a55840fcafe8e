"""GI-free: the engine that is kept between calls, so that Re-stitch need not wait for its libraries.

There is one for each run of GIMP and each installed engine. It listens on a socket in a folder that only this
user can enter, and ends by itself (:mod:`toposeam_engine.listening`). Where it cannot be reached, as on
Windows, whose Python has no such sockets, every call starts an engine of its own.
"""

from __future__ import annotations

import hashlib
import json
import os
import queue
import socket
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from toposeam_gimp import __version__
from toposeam_gimp.engine.launching import find_program, leave_running
from toposeam_gimp.engine.turns import session_folder

#: Longest wait for the greeting of a kept engine, s; one that answers another call does not greet.
_GREETING_S = 1.0
_PREFIX = "toposeam-engine-"


class KeptEngine:
    """A connection to a kept engine; it is asked like an :class:`~toposeam_gimp.engine.process.Engine`."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection, self._lines = connection, connection.makefile("rb")
        #: Whether it has sent its protocol and version.
        self.greeted = False

    def tell(self, *lines: str) -> None:
        """Send a request's folder and its nonce."""
        with suppress(OSError):  # it has ended, which reading shows
            self._connection.sendall("".join(f"{line}\n" for line in lines).encode())

    def read_line(self, silence_s: float) -> bytes | None:
        """Return the next line; None after the engine's end.

        Raises
        ------
        queue.Empty
            After `silence_s` seconds without a line.
        """
        self._connection.settimeout(silence_s)
        try:
            return self._lines.readline() or None
        except TimeoutError:
            raise queue.Empty from None
        except OSError:
            return None

    def end(self) -> int:
        """Close the connection: the engine waits for the next one, or ends if it was at work."""
        with suppress(OSError):
            self._lines.close()
            self._connection.close()
        return 0

    #: It ends by itself.
    wait = end


def keep_engine(command: Sequence[str]) -> None:
    """Start an engine that is kept for this run of GIMP, unless there is one; it is ready after a second or
    two. Without Unix sockets nothing happens.

    Parameters
    ----------
    command : sequence of str
        Starts the engine.
    """
    if not hasattr(socket, "AF_UNIX"):
        return
    with suppress(OSError, RuntimeError):
        address, gimp = _address(command), os.getppid()
        _sweep(address.parent)
        if gimp > 1 and not address.exists():
            leave_running([*command, "--listen", str(address), str(gimp)])


def kept_engine(command: Sequence[str], protocol: int) -> KeptEngine | None:
    """Return the kept engine that such a command has started; None if there is none that speaks the protocol,
    or it is at work.
    """
    if not hasattr(socket, "AF_UNIX"):
        return None
    with suppress(OSError, RuntimeError):
        address, connection = _address(command), socket.socket(socket.AF_UNIX)
        engine = KeptEngine(connection)
        connection.settimeout(_GREETING_S)
        try:
            connection.connect(str(address))
            line = engine.read_line(_GREETING_S)
        except (ConnectionRefusedError, FileNotFoundError):
            line = None
        except (queue.Empty, OSError):  # at work
            line = b"null"
        if line is None:  # it was killed
            address.unlink(missing_ok=True)
        with suppress(ValueError, AttributeError):
            hello = json.loads(line or b"null")
            if (hello.get("protocol"), hello.get("version")) == (protocol, __version__):
                engine.greeted = True
                return engine
        engine.end()
    return None


def _address(command: Sequence[str]) -> Path:
    """Return the socket for this run of GIMP, whose child this process is, and for a command: another
    installation has another one.
    """
    about = Path(find_program(command[0]) or command[0]).stat()
    told = json.dumps([list(command), about.st_mtime_ns, about.st_ino, __version__])
    name = hashlib.sha256(told.encode()).hexdigest()[:12]
    return session_folder() / f"{_PREFIX}{os.getppid()}-{name}"


def _sweep(folder: Path) -> None:
    """Remove the sockets that killed engines of earlier runs of GIMP have left."""
    for old in folder.glob(f"{_PREFIX}*"):
        number = old.name.removeprefix(_PREFIX).partition("-")[0]
        try:
            os.kill(int(number), 0)
        except ProcessLookupError:
            old.unlink(missing_ok=True)
        except (OSError, ValueError):
            continue
