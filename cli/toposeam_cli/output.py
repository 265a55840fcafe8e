"""Files out: checked before the long work, written under a temporary name, renamed when complete."""

import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from toposeam.errors import OptionError, TopoSeamError

fcntl: Any = None
with suppress(ImportError):  # there is none on Windows
    import fcntl

#: The extensions :func:`toposeam_cli.picture.write_picture` writes.
PICTURE_SUFFIXES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".webp")

_TEMPORARY, _UNFINISHED = ".toposeam-", ".part"
#: Files that appeared within :func:`all_or_nothing`, each with its inode and time: what another process puts there later is not ours.
_new_files: ContextVar[list[tuple[Path, int, int]] | None] = ContextVar("new_files", default=None)


class OutputError(TopoSeamError, OSError):
    """A file that could not be written: full disk, read-only folder, lost drive."""


def check_output(path: str | Path, force: bool = False, suffixes: Sequence[str] | None = PICTURE_SUFFIXES) -> Path:
    """Refuse an output that cannot be written, before any work is spent on it.

    Parameters
    ----------
    path : str or Path
        The file to be written; its extension is compared without regard to case.
    force : bool
        Whether an existing file may be replaced.
    suffixes : sequence of str or None
        The extensions that are allowed, with their dots; None allows any.

    Returns
    -------
    Path

    Raises
    ------
    OptionError
        If the extension is not supported, the folder is missing or read-only, or the file exists and `force` is False.
    """
    path = Path(path)
    if suffixes is not None and path.suffix.lower() not in suffixes:
        raise OptionError(f"cannot write '{path}': the extension '{path.suffix}' is not supported; use one of {', '.join(suffixes)}")
    try:
        target = _target(path)
        if not target.parent.is_dir():
            raise OptionError(f"cannot write '{path}': there is no folder '{target.parent}'; create it or choose another one")
        with suppress(FileNotFoundError):
            if not stat.S_ISREG(target.lstat().st_mode):
                raise OptionError(f"cannot write '{path}': that name is taken by something other than a file; choose another name")
            if not force:
                raise _already_exists(path)
        # Only creating a file tells: access rights say nothing of read-only mounts, quotas, or what root may do.
        tempfile.TemporaryFile(dir=target.parent).close()
    except TopoSeamError:
        raise
    except (OSError, ValueError) as error:
        raise OptionError(f"cannot write '{path}' ({_reason(error)}); choose another name or folder") from error
    return path


def atomic_write(path: str | Path, content: bytes | str, force: bool = False) -> None:
    """Write a whole file, or leave the folder as it was.

    Parameters
    ----------
    path : str or Path
        The file to be written, of any extension.
    content : bytes or str
        Text is written as UTF-8, its line ends unchanged.
    force : bool
        Whether an existing file may be replaced.

    Raises
    ------
    OptionError
        If the file cannot go there; see :func:`check_output`.
    OutputError
        If writing fails; an existing file is then still there, unchanged.
    """
    path = check_output(path, force, suffixes=None)
    with replacing(path, force) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)


@contextmanager
def replacing(path: Path, force: bool = False) -> Iterator[Path]:
    """Yield an empty temporary file in the folder of `path`; on success it takes that name, on any failure it is removed.

    Without `force` a file that appears under that name meanwhile is not overwritten either. A symbolic link keeps pointing where it
    did, and its target is replaced. An :class:`OSError` within the block is a failure to write, and leaves as :class:`OutputError`.
    """
    target = _target(path)
    temporary = target.with_name(f"{_TEMPORARY}{secrets.token_hex(8)}{_UNFINISHED}")
    try:
        with _claimed(temporary):
            yield temporary
            is_new = not target.exists()
            if not is_new:
                with suppress(OSError):
                    shutil.copymode(target, temporary)
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())
            _rename(temporary, target, force)
        new_files = _new_files.get()
        if is_new and new_files is not None:
            new_files.append((target, *_identity(target)))
    except TopoSeamError:
        raise
    except FileExistsError as error:
        raise _already_exists(path) from error
    except OSError as error:
        raise OutputError(f"cannot write '{path}' ({_reason(error)}); free some space or choose another folder") from error
    finally:
        with suppress(OSError):
            temporary.unlink()


@contextmanager
def all_or_nothing() -> Iterator[None]:
    """Remove the files that appeared in the block if it fails; what it replaced stays replaced."""
    outer = _new_files.get()
    files: list[tuple[Path, int, int]] = []
    token = _new_files.set(files)
    try:
        yield
    except BaseException:
        for path, *identity in files:
            with suppress(OSError):
                if _identity(path) == tuple(identity):
                    path.unlink()
        raise
    else:
        if outer is not None:
            outer += files
    finally:
        _new_files.reset(token)


def _identity(path: Path) -> tuple[int, int]:
    state = path.stat()
    return state.st_ino, state.st_mtime_ns


def remove_stale(folder: Path) -> None:
    """Remove the temporary files in a folder whose writers are gone."""
    for path in folder.glob(f"{_TEMPORARY}*{_UNFINISHED}"):
        with suppress(OSError), path.open("rb+") as file:
            if lock(file.fileno()):
                path.unlink()


def lock(descriptor: int) -> bool:
    """Claim an open file until it is closed, or its process ends: False if another process has claimed it."""
    if fcntl is None:
        return True  # Windows does not let anybody remove or replace an open file
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass  # a file system without locks
    return True


@contextmanager
def _claimed(path: Path) -> Iterator[None]:
    """Create an empty file that :func:`remove_stale` leaves alone within the block."""
    descriptor = _create(path)
    try:
        lock(descriptor)
        if fcntl is None:
            os.close(descriptor)  # an open file cannot be renamed either
        yield
    finally:
        if fcntl is not None:
            os.close(descriptor)


def _rename(temporary: Path, target: Path, force: bool) -> None:
    if force:
        temporary.replace(target)
        return
    try:
        os.link(temporary, target)  # unlike a rename, refuses a name that is taken
    except FileExistsError:
        raise
    except OSError:  # no hard links here (FAT, some network drives): claim the name, then replace what is ours
        os.close(_create(target))
        try:
            temporary.replace(target)
        except BaseException:
            target.unlink()
            raise


def _create(path: Path) -> int:
    return os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)


def _target(path: Path) -> Path:
    return Path(os.path.realpath(path))


def _reason(error: Exception) -> str:
    return (getattr(error, "strerror", None) or str(error)).lower()


def _already_exists(path: Path) -> OptionError:
    return OptionError(f"'{path}' exists already; pass --force to replace it, or choose another name")
