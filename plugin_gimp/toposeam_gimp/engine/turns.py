"""GI-free: one plug-in process after another."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from toposeam_gimp.engine.folder import users_folder

#: Longest wait for another entry, s: what hangs meanwhile must not stop all others.
_PATIENCE_S = 60.0
_LOOK_EVERY_S = 0.05
_NAME = "toposeam-turn"


@contextmanager
def turn(patience_s: float = _PATIENCE_S) -> Iterator[None]:
    """Run the blocks of all plug-in processes of this user one after another; without file locks, or after
    `patience_s` seconds, they run at once.
    """
    lock = None
    with suppress(ImportError, OSError, KeyError, RuntimeError):
        lock = os.open(
            session_folder() / _NAME, os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600
        )
        _wait(lock, time.monotonic() + patience_s)
    try:
        yield
    finally:
        if lock is not None:
            os.close(lock)


def session_folder() -> Path:
    """Return a folder that nobody else can open: that of this session, or one in this user's cache."""
    session = os.environ.get("XDG_RUNTIME_DIR", "")
    if Path(session).is_absolute():
        with suppress(OSError):
            seen = Path(session).lstat()
            if seen.st_uid == os.getuid() and not seen.st_mode & 0o077 and Path(session).is_dir():
                return Path(session)
    return users_folder()


def _wait(lock: int, end: float) -> None:
    import fcntl

    while True:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() > end:
                return
            time.sleep(_LOOK_EVERY_S)
        else:
            return
