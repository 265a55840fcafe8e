"""Outputs: checked before the long work, written under temporary names, renamed together when all are
complete.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path

from toposeam.errors import OptionError, TopoSeamError
from toposeam_cli.files.interruption import uninterrupted
from toposeam_cli.files.temporary import (
    claimed,
    claimed_folder,
    create,
    not_needed,
    remove,
    temporary_beside,
    tidy_once,
)

#: The suffix of OpenEXR, whose package is loaded for it alone.
EXR = ".exr"
#: The extensions :func:`toposeam_cli.media.pictures.picture.write_picture` writes.
PICTURE_SUFFIXES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".webp")
#: Those of textures and their maps.
TEXTURE_SUFFIXES = (*PICTURE_SUFFIXES, EXR)
#: Compressions of TIFF.
COMPRESSIONS = ("deflate", "lzw", "none")


class OutputError(TopoSeamError, OSError):
    """A file that could not be written: full disk, read-only folder, lost drive."""


@dataclass(slots=True, eq=False)
class Prepared:
    """A complete output under a temporary name."""

    path: Path
    target: Path
    temporary: Path
    force: bool
    is_folder: bool = False
    #: The replaced file or folder, kept until all outputs have their names.
    backup: Path | None = None
    #: Inode of the temporary file, by which the renamed output is recognized.
    inode: int | None = None


def give_name(temporary: Path, target: Path, force: bool) -> None:
    """Give a complete file its name; without `force` only if no file has it."""
    if force:
        temporary.replace(target)
        return
    try:
        os.link(temporary, target)  # unlike a rename, refuses a name that is taken
    except FileExistsError:
        raise
    except OSError:
        # No hard links here (FAT, some network drives): create the name, then replace our own file.
        os.close(create(target))
        try:
            temporary.replace(target)
        except BaseException:
            target.unlink()
            raise


def put_folder(output: Prepared, force: bool) -> None:
    """Give a complete folder its name; its predecessor is kept beside it."""
    if os.path.lexists(output.target):
        if not force:
            raise FileExistsError
        # Not a temporary name: clean-up must not take it for an unfinished folder.
        output.backup = output.target.with_name(f".toposeam-{secrets.token_hex(8)}.old")
        output.target.rename(output.backup)
    try:
        output.temporary.rename(output.target)
    except BaseException:
        if output.backup is not None:
            output.backup.rename(output.target)
        raise


def take_back(output: Prepared) -> None:
    """Undo what :func:`give_name` may have done, unless another process has changed it since."""
    if output.inode is None or output.target.stat().st_ino != output.inode:
        return
    if output.is_folder:
        remove(output.target)
        if output.backup is not None:
            output.backup.rename(output.target)
    elif output.backup is not None:
        output.backup.replace(output.target)
    else:
        output.target.unlink()


def digest(path: Path) -> str:
    """Return the SHA-256 of a file's content, or of a folder's files; a random number for neither."""
    try:
        if path.is_dir() and not path.is_symlink():
            files = sorted(each for each in path.rglob("*") if not each.is_dir())
            content = "".join(f"{each.relative_to(path)}\0{digest(each)}\0" for each in files)
            return hashlib.sha256(os.fsencode(content)).hexdigest()
        if not path.is_file():
            return secrets.token_hex()
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return secrets.token_hex()


@dataclass(slots=True, eq=False)
class OutputBlock:
    """The outputs of a block, which get their names together; see :func:`all_or_nothing`."""

    #: SHA-256 of files that we made earlier, by their real paths. They may be replaced while they have it.
    own: Mapping[str, str] = field(default_factory=dict)
    #: Whether a former try may have ended after its outputs got their names: an output that exists with equal
    #: content counts as written.
    resumed: bool = False
    #: SHA-256 of every file that the block made, by its real path; filled at its end if `digests` was set.
    made: dict[str, str] = field(default_factory=dict)
    _prepared: list[Prepared] = field(default_factory=list)
    _open: ExitStack = field(default_factory=ExitStack)

    def may_replace(self, target: Path) -> bool:
        """Test whether an existing file may be there, or be replaced, without force."""
        return self.resumed or self._is_own(target)

    def claim(self, output: Prepared) -> None:
        """Make the empty temporary file or folder, safe from other processes' clean-up."""
        tidy_once(output.target.parent)
        claim = claimed_folder if output.is_folder else claimed
        self._open.enter_context(claim(output.temporary))

    def complete(self, output: Prepared) -> None:
        """Mark the temporary file or folder as complete."""
        with suppress(OSError):
            shutil.copymode(output.target, output.temporary)  # of the file that it replaces, if there is one
        if not output.is_folder:
            with output.temporary.open("rb+") as file:
                os.fsync(file.fileno())
        output.inode = output.temporary.stat().st_ino
        self._prepared.append(output)

    @property
    def count(self) -> int:
        """Number of complete outputs."""
        return len(self._prepared)

    def commit(self, digests: bool) -> None:
        """Give all outputs their names; where one cannot get its own, the others are as they were before."""
        if digests:
            self.made = {str(output.target): digest(output.temporary) for output in self._prepared}
        begun: list[Prepared] = []
        with uninterrupted():
            try:
                for output in self._prepared:
                    with _failures_reported(output.path):
                        begun.append(output)
                        self._put(output)
            except BaseException:
                for output in reversed(begun):
                    with suppress(OSError):
                        take_back(output)
                raise
            for output in begun:
                if output.backup is not None:
                    not_needed(output.backup)

    def close(self) -> None:
        """Remove what is left of temporary files."""
        for output in self._prepared:
            for path in (output.temporary, output.backup):
                if path is not None:
                    remove(path)
        self._open.close()

    def forget(self, *outputs: Prepared) -> None:
        """Drop outputs and remove their temporary files."""
        for output in outputs:
            remove(output.temporary)
            if output in self._prepared:
                self._prepared.remove(output)

    def drop(self, since: int) -> None:
        """Forget the outputs from that number on."""
        self.forget(*self._prepared[since:])

    def _is_own(self, target: Path) -> bool:
        return str(target) in self.own and self.own[str(target)] == digest(target)

    def _put(self, output: Prepared) -> None:
        force = output.force
        if not force and os.path.lexists(output.target):
            if self.resumed and digest(output.target) == digest(output.temporary):
                return
            force = self._is_own(output.target)
        if output.is_folder:
            put_folder(output, force)
            return
        if force and output.target.exists():
            output.backup = temporary_beside(output.target)
            try:
                os.link(output.target, output.backup)
            except OSError:  # no hard links here
                shutil.copy2(output.target, output.backup)
        give_name(output.temporary, output.target, force)


#: The outputs of the current block.
_outputs: ContextVar[OutputBlock | None] = ContextVar("outputs", default=None)


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
        tidy_once(target.parent)  # also old folders of a command that was killed after renaming its outputs
        with suppress(FileNotFoundError):
            if not stat.S_ISREG(target.lstat().st_mode):
                raise OptionError(
                    f"cannot write '{path}': that name is taken by something other than a file; choose "
                    "another name"
                )
            if not force and not is_expected(path):
                raise _already_exists(path)
        # Creating a file is the only sure test: access rights do not show read-only mounts, quotas, or what
        # root may do.
        tempfile.TemporaryFile(dir=target.parent).close()
    except TopoSeamError:
        raise
    except (OSError, ValueError) as error:
        raise OptionError(
            f"cannot write '{path}' ({reason(error)}); choose another name or folder"
        ) from error
    return path


def is_expected(path: Path) -> bool:
    """Test whether an output may exist already without force: a former try of this job left it."""
    outputs = _outputs.get()
    return outputs is not None and outputs.may_replace(_target(path))


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
def replacing(path: Path, force: bool = False, *, folder: bool = False) -> Iterator[Path]:
    """Yield an empty temporary file in the folder of `path`. On success it gets that name, on any failure it
    is removed.

    Within :func:`all_or_nothing` it takes the name at the end of that block, with all the others. Without
    `force` a file that appears under that name meanwhile is not overwritten either. A symbolic link keeps
    pointing where it did, and its target is replaced. An :class:`OSError` within the block is a failure to
    write, and leaves as :class:`OutputError`.

    With `folder` it is a folder; the caller then checks what `force` replaces.
    """
    outputs = _outputs.get()
    if outputs is None:
        with all_or_nothing(), replacing(path, force, folder=folder) as temporary:
            yield temporary
        return
    with _failures_reported(path):
        target = _target(path)
        output = Prepared(path, target, temporary_beside(target), force, folder)
        try:
            outputs.claim(output)
            yield output.temporary
            outputs.complete(output)
        except BaseException:
            outputs.forget(output)
            raise


@contextmanager
def new_folder(path: Path | None) -> Iterator[None]:
    """Make the folder of a block's outputs, if there is none; where the block fails it goes again.

    Raises
    ------
    OutputError
    """
    if path is None or path.is_dir():
        yield
        return
    with _failures_reported(path):
        path.mkdir()
    try:
        yield
    except BaseException:
        with suppress(OSError):
            path.rmdir()
        raise


@contextmanager
def all_or_nothing(
    own: Mapping[str, str] | None = None, *, resumed: bool = False, digests: bool = False
) -> Iterator[OutputBlock]:
    """Let the files that are written in the block appear together at its end, or none of them.

    When the block fails, or one of its outputs cannot get its name, every file is as it was before, also
    those that `force` would have replaced. The outputs of a block within another one get their names with
    that one's.

    Parameters
    ----------
    own : mapping of real path to SHA-256, optional
        Files that we made earlier: they may be replaced without force while they hold what we wrote.
    resumed : bool
        Whether the same block may have ended between giving names and recording it: outputs that exist
        already and are equal byte for byte are then no error.
    digests : bool
        Whether to note the SHA-256 of every file in ``made``.

    Yields
    ------
    OutputBlock
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
    outputs = OutputBlock(dict(own or {}), resumed)
    try:
        _outputs.set(outputs)
        yield outputs
        outputs.commit(digests)
    finally:
        try:
            _leave(outputs)
        finally:  # even if interrupted there; if this is interrupted, `remove_unfinished` does the rest
            with uninterrupted():
                _leave(outputs)
                outputs.close()


def _leave(outputs: OutputBlock) -> None:
    """End a block of outputs: later files do not belong to it."""
    if _outputs.get() is outputs:
        _outputs.set(None)


@contextmanager
def _failures_reported(path: Path) -> Iterator[None]:
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


def _target(path: Path) -> Path:
    return Path(os.path.realpath(path))


def reason(error: Exception) -> str:
    """Return the system's text for a failure."""
    return (getattr(error, "strerror", None) or str(error)).lower()


def _already_exists(path: Path) -> OptionError:
    return OptionError(f"'{path}' exists already; pass --force to replace it, or choose another name")
