"""Files out: checked before the long work, written under temporary names, renamed together when all are
complete.
"""

from __future__ import annotations

import hashlib
import os
import re
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from toposeam.errors import OptionError, TopoSeamError
from toposeam_cli.files.interruption import uninterrupted

fcntl: Any = None
with suppress(ImportError):  # there is none on Windows
    import fcntl

#: The extensions :func:`toposeam_cli.pictures.picture.write_picture` writes.
PICTURE_SUFFIXES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".webp")

_TEMPORARY, _UNFINISHED = ".toposeam-", ".part"
_OURS = re.compile(r"\.toposeam-[0-9a-f]{16}\.part")
#: Where a file system has no locks, temporary files untouched for so long have lost their writer, s.
_ABANDONED_S = 24 * 3600.0


class OutputError(TopoSeamError, OSError):
    """A file that could not be written: full disk, read-only folder, lost drive."""


@dataclass(slots=True, eq=False)
class _Prepared:
    """A complete output under a temporary name."""

    path: Path
    target: Path
    temporary: Path
    force: bool
    #: What it replaces, kept until all outputs have their names.
    backup: Path | None = None
    #: Of the temporary file, by which the output is known to be ours.
    inode: int | None = None


@dataclass(slots=True, eq=False)
class Outputs:
    """The outputs of a block, which get their names together; see :func:`all_or_nothing`."""

    #: Files that we made earlier, by their real paths, and the SHA-256 of what we wrote: as long as that is
    #: what they hold, they may be replaced.
    own: Mapping[str, str] = field(default_factory=dict)
    #: Whether a former try may have been cut short after its outputs got their names: one that is there
    #: already with the very content it should get is as good as written.
    resumed: bool = False
    #: The SHA-256 of every file that the block made, by its real path; at its end, where `digests` was asked.
    made: dict[str, str] = field(default_factory=dict)
    _prepared: list[_Prepared] = field(default_factory=list)
    _open: ExitStack = field(default_factory=ExitStack)

    def may_replace(self, target: Path) -> bool:
        """Whether a file that is there may be found there, or replaced, though nobody forces it."""
        return self.resumed or self._is_own(target)

    def claim(self, output: _Prepared) -> None:
        """Make the empty temporary file, safe from :func:`remove_stale`."""
        tidy_once(output.target.parent)
        self._open.enter_context(claimed(output.temporary))

    def complete(self, output: _Prepared) -> None:
        """The temporary file holds all it should."""
        with suppress(OSError):
            shutil.copymode(output.target, output.temporary)  # of what it will replace, if anything
        with output.temporary.open("rb+") as file:
            os.fsync(file.fileno())
            output.inode = os.fstat(file.fileno()).st_ino
        self._prepared.append(output)

    @property
    def count(self) -> int:
        """How many outputs are complete."""
        return len(self._prepared)

    def commit(self, digests: bool) -> None:
        """Give all outputs their names; where one cannot get its own, the others are as they were before."""
        if digests:
            self.made = {str(output.target): _digest(output.temporary) for output in self._prepared}
        begun: list[_Prepared] = []
        with uninterrupted():
            try:
                for output in self._prepared:
                    with _failures_told(output.path):
                        begun.append(output)
                        self._put(output)
            except BaseException:
                for output in reversed(begun):
                    with suppress(OSError):
                        _take_back(output)
                raise

    def close(self) -> None:
        """Remove what is left of temporary files."""
        for output in self._prepared:
            for path in (output.temporary, output.backup):
                if path is not None:
                    with suppress(OSError):
                        path.unlink()
        self._open.close()

    def forget(self, *outputs: _Prepared) -> None:
        """Remove the temporary files of outputs that will not be."""
        for output in outputs:
            with suppress(OSError):
                output.temporary.unlink()
            if output in self._prepared:
                self._prepared.remove(output)

    def drop(self, since: int) -> None:
        """Forget the outputs from that number on."""
        self.forget(*self._prepared[since:])

    def _is_own(self, target: Path) -> bool:
        return str(target) in self.own and self.own[str(target)] == _digest(target)

    def _put(self, output: _Prepared) -> None:
        force = output.force
        if not force and os.path.lexists(output.target):
            if self.resumed and _digest(output.target) == _digest(output.temporary):
                return
            force = self._is_own(output.target)
        if force and output.target.exists():
            output.backup = temporary_beside(output.target)
            try:
                os.link(output.target, output.backup)
            except OSError:  # no hard links here
                shutil.copy2(output.target, output.backup)
        _rename(output.temporary, output.target, force)


#: The outputs of the block we are in.
_outputs: ContextVar[Outputs | None] = ContextVar("outputs", default=None)


def check_output(
    path: str | Path, force: bool = False, suffixes: Sequence[str] | None = PICTURE_SUFFIXES
) -> Path:
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
        If the extension is not supported, the folder is missing or read-only, or the file exists and `force`
        is False.
    """
    path = Path(path)
    if suffixes is not None and path.suffix.lower() not in suffixes:
        raise OptionError(
            f"cannot write '{path}': the extension '{path.suffix}' is not supported; use one of "
            f"{', '.join(suffixes)}"
        )
    try:
        target = _target(path)
        if not target.parent.is_dir():
            raise OptionError(
                f"cannot write '{path}': there is no folder '{target.parent}'; create it or choose another "
                "one"
            )
        with suppress(FileNotFoundError):
            if not stat.S_ISREG(target.lstat().st_mode):
                raise OptionError(
                    f"cannot write '{path}': that name is taken by something other than a file; choose "
                    "another name"
                )
            outputs = _outputs.get()
            if not force and not (outputs is not None and outputs.may_replace(target)):
                raise _already_exists(path)
        # Only creating a file tells: access rights say nothing of read-only mounts, quotas, or what root may
        # do.
        tempfile.TemporaryFile(dir=target.parent).close()
    except TopoSeamError:
        raise
    except (OSError, ValueError) as error:
        raise OptionError(
            f"cannot write '{path}' ({reason(error)}); choose another name or folder"
        ) from error
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
    """Yield an empty temporary file in the folder of `path`; on success it takes that name, on any failure it
    is removed.

    Within :func:`all_or_nothing` it takes the name at the end of that block, with all the others. Without
    `force` a file that appears under that name meanwhile is not overwritten either. A symbolic link keeps
    pointing where it did, and its target is replaced. An :class:`OSError` within the block is a failure to
    write, and leaves as :class:`OutputError`.
    """
    outputs = _outputs.get()
    if outputs is None:
        with all_or_nothing(), replacing(path, force) as temporary:
            yield temporary
        return
    with _failures_told(path):
        target = _target(path)
        output = _Prepared(path, target, temporary_beside(target), force)
        try:
            outputs.claim(output)
            yield output.temporary
            outputs.complete(output)
        except BaseException:
            outputs.forget(output)
            raise


@contextmanager
def all_or_nothing(
    own: Mapping[str, str] | None = None, *, resumed: bool = False, digests: bool = False
) -> Iterator[Outputs]:
    """Let the files that are written in the block appear together at its end, or none of them.

    When the block fails, or one of its outputs cannot get its name, every file is as it was before, also
    those that `force` would have replaced. A block within another one leaves the end to that.

    Parameters
    ----------
    own : mapping of real path to SHA-256, optional
        Files that we made earlier: they may be replaced without force while they hold what we wrote.
    resumed : bool
        Whether the same block may have been cut short between giving names and telling so: outputs that are
        there already, byte for byte, are then no reason to fail.
    digests : bool
        Whether to note the SHA-256 of every file in ``made``.

    Yields
    ------
    Outputs
    """
    outer = _outputs.get()
    if outer is not None:
        before = outer.count
        try:
            yield outer
        except BaseException:
            outer.drop(before)
            raise
        return
    outputs = Outputs(dict(own or {}), resumed)
    token = _outputs.set(outputs)
    try:
        yield outputs
        outputs.commit(digests)
    finally:
        _outputs.reset(token)
        with uninterrupted():
            outputs.close()


def remove_stale(folder: Path) -> None:
    """Remove the temporary files in a folder whose writers are gone: regular files of this user, called as
    only we call them, that nobody has locked.
    """
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if _OURS.fullmatch(entry.name):
                with suppress(OSError):
                    _remove_if_stale(folder / entry.name)


def _remove_if_stale(path: Path) -> None:
    state = path.lstat()
    if not stat.S_ISREG(state.st_mode) or (hasattr(os, "getuid") and state.st_uid != os.getuid()):
        return
    with path.open("rb+") as file:
        locked = _lock(file.fileno())
        if locked is None:
            locked = time.time() - state.st_mtime > _ABANDONED_S
        if locked and fcntl is not None:
            _remove(path)
    if locked and fcntl is None:  # an open file cannot be removed there, which is why this one was closed
        _remove(path)


def _remove(path: Path) -> None:
    path.unlink()
    shutil.rmtree(folder_of(path), ignore_errors=True)


def folder_of(temporary: Path) -> Path:
    """Where files lie that belong to a temporary one."""
    return temporary.with_name(f"{temporary.name}.d")


#: Folders where the leftovers of killed commands have been looked for by this process.
_tidied: set[Path] = set()


def tidy_once(folder: Path) -> None:
    """Remove what killed commands left in a folder, once a process."""
    if folder not in _tidied:
        _tidied.add(folder)
        remove_stale(folder)


def lock(descriptor: int) -> bool:
    """Claim an open file until it is closed, or its process ends: False if another process has claimed it."""
    return _lock(descriptor) is not False


def _lock(descriptor: int) -> bool | None:
    """As :func:`lock`; None where the file system has no locks."""
    if fcntl is None:
        return True  # Windows does not let anybody remove or replace an open file
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


@contextmanager
def claimed(path: Path) -> Iterator[None]:
    """Create an empty file that :func:`remove_stale` leaves alone within the block."""
    while True:
        descriptor = _create(path)
        lock(descriptor)
        with suppress(OSError):
            if path.stat().st_ino == os.fstat(descriptor).st_ino:
                break
        os.close(descriptor)  # somebody who tidied up was faster than the lock
    try:
        if fcntl is None:
            os.close(descriptor)  # an open file cannot be renamed either
        yield
    finally:
        if fcntl is not None:
            os.close(descriptor)


@contextmanager
def _failures_told(path: Path) -> Iterator[None]:
    try:
        yield
    except TopoSeamError:
        raise
    except FileExistsError as error:
        raise _already_exists(path) from error
    except OSError as error:
        raise OutputError(
            f"cannot write '{path}' ({reason(error)}); free some space or choose another folder"
        ) from error


def _rename(temporary: Path, target: Path, force: bool) -> None:
    if force:
        temporary.replace(target)
        return
    try:
        os.link(temporary, target)  # unlike a rename, refuses a name that is taken
    except FileExistsError:
        raise
    except (
        OSError
    ):  # no hard links here (FAT, some network drives): claim the name, then replace what is ours
        os.close(_create(target))
        try:
            temporary.replace(target)
        except BaseException:
            target.unlink()
            raise


def _take_back(output: _Prepared) -> None:
    """Undo what :func:`_rename` may have done, unless somebody else has been there since."""
    if output.inode is None or output.target.stat().st_ino != output.inode:
        return
    if output.backup is not None:
        output.backup.replace(output.target)
    else:
        output.target.unlink()


def _digest(path: Path) -> str:
    """SHA-256 of a file's content; one of its own kind for what is no file, equal to no other."""
    try:
        if not path.is_file():
            return secrets.token_hex()
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return secrets.token_hex()


def temporary_beside(target: Path) -> Path:
    """A name in the same folder that only we use."""
    return target.with_name(f"{_TEMPORARY}{secrets.token_hex(8)}{_UNFINISHED}")


def _create(path: Path) -> int:
    return os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)


def _target(path: Path) -> Path:
    return Path(os.path.realpath(path))


def reason(error: Exception) -> str:
    """What the system says of a failure."""
    return (getattr(error, "strerror", None) or str(error)).lower()


def _already_exists(path: Path) -> OptionError:
    return OptionError(f"'{path}' exists already; pass --force to replace it, or choose another name")
