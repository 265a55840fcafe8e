"""Temporary files and folders under names that only we use. They are locked while they are written, and
removed when their writer is interrupted, ends, or was killed.
"""

from __future__ import annotations

import atexit
import os
import re
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

fcntl: Any = None
with suppress(ImportError):  # there is none on Windows
    import fcntl

_OURS = re.compile(r"\.toposeam-[0-9a-f]{16}\.part")
#: Age at which an unchanged temporary file counts as abandoned where the file system has no locks, s.
_ABANDONED_S = 24 * 3600.0

#: Temporary files and folders, and the process that made each (a fork does not own it).
_unfinished: dict[Path, int] = {}
#: Folders in which this process has removed the leftovers of killed commands.
_tidied: set[Path] = set()


def temporary_beside(target: Path) -> Path:
    """Return a new temporary name in the folder of `target`; whatever has it is removed when the process
    ends.
    """
    path = target.with_name(f".toposeam-{secrets.token_hex(8)}.part")
    not_needed(path)
    return path


def not_needed(path: Path) -> None:
    """Mark a path for removal when the process ends."""
    _unfinished[path] = os.getpid()


def remove(path: Path) -> None:
    """Remove a file or folder if possible."""
    with suppress(OSError):
        if stat.S_ISDIR(path.lstat().st_mode):
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink()
    _unfinished.pop(path, None)


@atexit.register
def remove_unfinished() -> None:
    """Remove the temporary files and folders of this process, at whatever step it was interrupted. Call this
    before :func:`os._exit`.
    """
    for path, owner in list(_unfinished.items()):
        if owner == os.getpid():
            remove(path)


@contextmanager
def claimed(path: Path) -> Iterator[None]:
    """Create an empty file that :func:`remove_stale` leaves alone within the block."""
    while True:
        descriptor = create(path)
        if _is_claimed(path, descriptor):
            break
    try:
        if fcntl is None:
            os.close(descriptor)  # an open file cannot be renamed either
        yield
    finally:
        if fcntl is not None:
            os.close(descriptor)


@contextmanager
def claimed_folder(path: Path, mode: int = 0o777) -> Iterator[Path]:
    """Make a folder that :func:`remove_stale` leaves alone within the block. It is removed at the end unless
    it was renamed.
    """
    descriptor = -1
    try:
        while True:
            path.mkdir(mode)
            if fcntl is None:
                break  # Windows opens no folders
            descriptor = os.open(path, os.O_RDONLY)
            if _is_claimed(path, descriptor):
                break
        yield path
    finally:
        remove(path)
        if descriptor >= 0:
            os.close(descriptor)


@contextmanager
def private_folder() -> Iterator[Path]:
    """Make a folder that no other user can open, in the system's folder for temporary files; remove those of
    killed commands first.
    """
    shared = Path(tempfile.gettempdir())
    tidy_once(shared)
    with claimed_folder(temporary_beside(shared / "private"), 0o700) as folder:
        yield folder


def _is_claimed(path: Path, descriptor: int) -> bool:
    """Claim a new file. False if another process has removed it meanwhile as stale; it is then closed."""
    lock(descriptor)
    with suppress(OSError):
        if path.stat().st_ino == os.fstat(descriptor).st_ino:
            return True
    os.close(descriptor)
    return False


def create(path: Path) -> int:
    """Open a new file.

    Raises
    ------
    FileExistsError
    """
    return os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)


def tidy_once(folder: Path) -> None:
    """Call :func:`remove_stale`, once per process and folder."""
    if folder not in _tidied:
        _tidied.add(folder)
        remove_stale(folder)


def remove_stale(folder: Path) -> None:
    """Remove the temporary files and folders of a folder whose writers have ended: this user's, with our kind
    of name, and not locked.
    """
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if _OURS.fullmatch(entry.name):
                with suppress(OSError):
                    _remove_if_stale(folder / entry.name)


def _remove_if_stale(path: Path) -> None:
    state = path.lstat()
    is_folder = stat.S_ISDIR(state.st_mode)
    if not (is_folder or stat.S_ISREG(state.st_mode)):
        return
    if hasattr(os, "getuid") and state.st_uid != os.getuid():
        return
    is_old = time.time() - state.st_mtime > _ABANDONED_S
    if fcntl is None:
        if is_old or not is_folder:  # Windows does not remove open files, but files in open folders
            remove(path)
        return
    descriptor = os.open(path, (os.O_RDONLY if is_folder else os.O_RDWR) | os.O_NOFOLLOW)
    try:
        locked = _lock(descriptor)
        if is_old if locked is None else locked:
            remove(path)
    finally:
        os.close(descriptor)


def lock(descriptor: int) -> bool:
    """Claim an open file until it is closed or its process ends; False if another process has claimed it."""
    return _lock(descriptor) is not False


def _lock(descriptor: int) -> bool | None:
    """Lock as :func:`lock` does; None where the file system has no locks."""
    if fcntl is None:
        return True  # Windows does not allow to remove or replace an open file
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True
