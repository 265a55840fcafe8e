"""GI-free: the private temporary folder of one request, the removal of those that a crash has left, and a
folder of this user for what is kept.
"""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from toposeam_gimp.texts import _

_PREFIX = "toposeam-request-"
_SIGN_OF_LIFE = "alive"
#: Name of the file with the nonce, by which the engine recognizes a folder of the plug-in; it touches no
#: other.
MARKER = "toposeam-request"
#: Age of the last sign of life at which a folder counts as abandoned, s.
STALE_S = 15 * 60.0


def users_folder() -> Path:
    """Return a folder for small files that only this user can open, in this user's cache; made if need be.

    Raises
    ------
    OSError
        When it cannot be made.
    RuntimeError
        When this user has no home.
    """
    cache = os.environ.get("XDG_CACHE_HOME", "")
    if sys.platform == "win32":
        place = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "TopoSeam"
    elif sys.platform == "darwin":
        place = Path.home() / "Library" / "Caches" / "TopoSeam"
    else:
        place = (Path(cache) if Path(cache).is_absolute() else Path.home() / ".cache") / "toposeam" / "gimp"
    place.mkdir(mode=0o700, parents=True, exist_ok=True)
    place.chmod(0o700)
    return place


class FolderError(Exception):
    """The temporary folder cannot be used; the text says what to do."""


class RequestFolder:
    """A folder that only this user can read. It is removed at the end of the ``with`` block, however that
    ends.

    Parameters
    ----------
    needed : int
        Bytes that must be free on its disk.
    """

    def __init__(self, needed: int = 0) -> None:
        self._parent = Path(tempfile.gettempdir())
        sweep(self._parent)
        free = shutil.disk_usage(self._parent).free
        if free < needed:
            raise FolderError(too_small(self._parent, needed))
        self.path = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=self._parent))
        #: The nonce that the engine reads from its stdin and finds in the folder.
        self.nonce = secrets.token_hex(16)
        (self.path / MARKER).write_text(self.nonce, encoding="ascii")
        #: The engine that was started for this request; None if there is none.
        self.engine: Any = None
        self.touch()

    def touch(self) -> None:
        """Mark the folder as in use."""
        with suppress(OSError):
            (self.path / _SIGN_OF_LIFE).touch()

    def __enter__(self) -> RequestFolder:
        return self

    def end_engine(self) -> None:
        """Stop the engine that was started for this request."""
        if self.engine is not None:
            self.engine.end()
            self.engine = None

    def __exit__(self, *_: object) -> None:
        self.end_engine()
        shutil.rmtree(self.path, ignore_errors=True)


def too_small(folder: Path, needed: int | None = None) -> str:
    """Return the message for the user when the temporary folder is full."""
    size = "" if needed is None else " " + _("{size} MiB are needed.").format(size=max(needed >> 20, 1))
    text = _(
        "There is no space left in the temporary folder {folder}.{size} Free some, or start GIMP with "
        "TMPDIR set to a larger folder."
    )
    return text.format(folder=folder, size=size)


def is_full(error: OSError) -> bool:
    """Test whether an error means that the disk is full."""
    return error.errno in (errno.ENOSPC, errno.EDQUOT)


def sweep(parent: Path, now: float | None = None) -> None:
    """Remove request folders whose owners crashed."""
    now = time.time() if now is None else now
    for folder in parent.glob(_PREFIX + "*"):
        with suppress(OSError):
            if folder.is_symlink() or not (folder / MARKER).is_file():
                continue  # another user's, or not made by us, in spite of its name
            sign = folder / _SIGN_OF_LIFE
            own = not hasattr(os, "getuid") or folder.lstat().st_uid == os.getuid()
            seen = (sign if sign.exists() else folder).lstat()
            if own and now - seen.st_mtime > STALE_S:
                shutil.rmtree(folder, ignore_errors=True)
