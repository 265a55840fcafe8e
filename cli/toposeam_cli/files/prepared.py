"""An output that is complete under a temporary name: how it gets its own, and how that is taken back."""

from __future__ import annotations

import hashlib
import os
import secrets
from dataclasses import dataclass
from pathlib import Path

from toposeam_cli.files.temporary import create, remove


@dataclass(slots=True, eq=False)
class Prepared:
    """A complete output under a temporary name."""

    path: Path
    target: Path
    temporary: Path
    force: bool
    is_folder: bool = False
    #: What it replaces, kept until all outputs have their names.
    backup: Path | None = None
    #: Of the temporary file, by which the output is known to be ours.
    inode: int | None = None


def give_name(temporary: Path, target: Path, force: bool) -> None:
    """Give a complete file its name; without force not one that is taken."""
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
        os.close(create(target))
        try:
            temporary.replace(target)
        except BaseException:
            target.unlink()
            raise


def put_folder(output: Prepared, force: bool) -> None:
    """Do the same for a folder, whose predecessor is kept beside it."""
    if os.path.lexists(output.target):
        if not force:
            raise FileExistsError
        # No temporary name: clean-up must not take it for something unfinished.
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
    """SHA-256 of a file's content, or of a folder's files; one of its own kind for what is neither, equal to
    no other.
    """
    try:
        if path.is_dir() and not path.is_symlink():
            files = sorted(each for each in path.rglob("*") if not each.is_dir())
            told = "".join(f"{each.relative_to(path)}\0{digest(each)}\0" for each in files)
            return hashlib.sha256(os.fsencode(told)).hexdigest()
        if not path.is_file():
            return secrets.token_hex()
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return secrets.token_hex()
