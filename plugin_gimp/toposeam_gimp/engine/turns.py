"""GI-free: one plug-in process after another."""

from __future__ import annotations

import getpass
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def turn() -> Iterator[None]:
    """Run the blocks of all plug-in processes of this user one after another; without file locks they run at
    once.
    """
    file = None
    with suppress(ImportError, OSError, KeyError):
        import fcntl

        file = (Path(tempfile.gettempdir()) / f"toposeam-turn-{getpass.getuser()}").open("a")
        fcntl.flock(file, fcntl.LOCK_EX)
    try:
        yield
    finally:
        if file is not None:
            file.close()
