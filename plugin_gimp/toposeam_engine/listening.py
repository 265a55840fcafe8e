"""``python -m toposeam_engine --listen SOCKET OWNER``: an engine that is kept between the calls of a program.

It loads its libraries, listens on a Unix socket that only this user can open, and serves one connection at a
time as the engine that waits on stdin does (:mod:`toposeam_engine.serving`). It ends when nobody has asked
for some minutes, when the process OWNER has ended, when the asker leaves in the middle of a request, or when
TopoSeam was installed anew; the socket is removed.
"""

from __future__ import annotations

import os
import socket
import time
from contextlib import suppress
from pathlib import Path

import toposeam
import toposeam_engine

#: Time without a request after which the engine ends, s.
IDLE_S = 600.0
#: How often it looks whether its owner still runs, s.
_LOOK_EVERY_S = 2.0


def bound(address: Path) -> socket.socket | None:
    """Return a socket that listens at an address; None if another engine already does."""
    with socket.socket(socket.AF_UNIX) as other, suppress(OSError):
        other.connect(str(address))
        return None
    listener, old = socket.socket(socket.AF_UNIX), os.umask(0o177)
    unready = address.with_name(f"{address.name}-{os.getpid()}")
    try:
        listener.bind(str(unready))
    finally:
        os.umask(old)
    listener.listen(1)
    listener.settimeout(_LOOK_EVERY_S)
    unready.rename(address)  # one that refuses counts as left behind
    return listener


def next_asker(listener: socket.socket, owner: int) -> socket.socket | None:
    """Wait for a connection; return None once the engine shall end."""
    since, installed = time.monotonic(), _installed()
    while time.monotonic() - since < IDLE_S and _runs(owner) and _installed() == installed:
        with suppress(TimeoutError):
            asker, _address = listener.accept()
            return asker if _installed() == installed else None
    return None


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except OSError:
        return False
    return True


def _installed() -> list[int]:
    """Return when the modules of this engine were installed; empty if they are gone."""
    with suppress(OSError):
        return [Path(str(each.__file__)).stat().st_mtime_ns for each in (toposeam, toposeam_engine)]
    return []
