"""Files that may be read: those on a disk, for a pipe or a device may never come to an end."""

from __future__ import annotations

import glob
import os
import stat
from pathlib import Path

from toposeam.errors import OptionError


def real_path(path: Path) -> Path:
    """Return where a path leads; a link that leads to itself stays, where :meth:`Path.resolve` fails."""
    return Path(os.path.realpath(path))


def check_regular(path: Path, what: str = "it", *, folders: bool = True) -> None:
    """Refuse pipes, devices and sockets; the reader reports other errors.

    Parameters
    ----------
    path : Path
    what : str
        What the file should be, for the error's text.
    folders : bool
        Whether it may be a folder.

    Raises
    ------
    OptionError
    """
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return
    if not (stat.S_ISREG(mode) or (folders and stat.S_ISDIR(mode))):
        raise OptionError(f"'{path}' is not a regular file; save {what} to disk, and name that")


def check_pattern(path: Path) -> None:
    """Refuse a pattern of files, which is there because the shell found none for it, or left it alone.

    Raises
    ------
    OptionError
    """
    pattern = str(path)
    if not set("*?") & set(pattern) or path.exists():
        return
    if glob.glob(pattern):  # noqa: PTH207 - patterns may be absolute
        raise OptionError(f"'{pattern}' is in quotes, so that the shell leaves it alone; take them away")
    raise OptionError(f"no file matches '{pattern}'; check its folder and spelling")


def check_regular_below(folder: Path, what: str) -> None:
    """Refuse folders in which anything is neither a file nor a folder.

    Raises
    ------
    OptionError
    """
    for place, _, names in os.walk(folder):
        for name in names:
            check_regular(Path(place, name), what)
