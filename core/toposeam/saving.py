"""Atomic writing of files by core (drawings, meshes): a file is complete, or is not there."""

from __future__ import annotations

import os
import secrets
from contextlib import suppress
from pathlib import Path
from typing import Any

from toposeam.checks import check_kind

fcntl: Any = None
with suppress(ImportError):  # Windows has no fcntl
    import fcntl


def save(path: str | Path, content: str | bytes) -> None:
    """Write a file under a temporary name and rename it when it is complete; an existing file is replaced.

    Parameters
    ----------
    path : str or Path
    content : str or bytes
        Text is written as UTF-8.

    Raises
    ------
    OptionError
        When `path` is neither a str nor a Path.
    OSError
        When the file cannot be written; an existing file is unchanged.
    """
    target = Path(os.path.realpath(path_of(path)))
    temporary = target.with_name(f".toposeam-{secrets.token_hex(8)}.part")
    try:
        with temporary.open("xb") as file:
            if fcntl is not None:
                with suppress(OSError):  # the lock shows the command line that the file is in use
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
            if fcntl is not None:
                temporary.replace(target)
        if fcntl is None:  # Windows cannot rename an open file
            temporary.replace(target)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError) and error.filename == str(temporary):
            error.filename = str(path)
        raise


def path_of(path: Any) -> Path:
    """Return a file's name as a path.

    Raises
    ------
    OptionError
    """
    check_kind("path", path, (str, Path), "the name of a file")
    return Path(path)
