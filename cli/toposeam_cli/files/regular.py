"""Checks that a file may be read: it is on a disk, as a pipe or a device may never end."""

from __future__ import annotations

import glob
import os
import stat
from pathlib import Path

from toposeam.errors import ImageError, OptionError

#: Extensions of cameras' raw files. In some of them libvips would take the small preview for the picture.
_RAW = {
    ".3fr",
    ".arw",
    ".cr2",
    ".cr3",
    ".crw",
    ".dng",
    ".erf",
    ".iiq",
    ".kdc",
    ".mef",
    ".mos",
    ".mrw",
    ".nef",
    ".nrw",
    ".orf",
    ".pef",
    ".raf",
    ".raw",
    ".rw2",
    ".rwl",
    ".sr2",
    ".srf",
    ".srw",
    ".x3f",
}


def real_path(path: Path) -> Path:
    """Resolve the links of a path; a link to itself stays, for which :meth:`Path.resolve` fails."""
    return Path(os.path.realpath(path))


def check_regular(path: Path, what: str = "it", *, folders: bool = True) -> None:
    """Refuse pipes, devices and sockets; the reader reports other errors.

    Parameters
    ----------
    path : Path
    what : str
        The kind of file that is expected, for the error's text.
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
    """Refuse a pattern of file names, which the shell has not replaced: it matches no file or was in quotes.

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


def check_input(path: Path) -> None:
    """Refuse a path that is no file or may not be read, an empty file, and a camera's raw file.

    Raises
    ------
    ImageError
    """
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            raise ImageError(f"'{path}' is a folder; name a picture inside it")
        if not stat.S_ISREG(mode):
            raise ImageError(f"'{path}' is not a regular file; save the picture to disk first")
        with path.open("rb") as file:
            if not file.read(1):
                raise ImageError(f"'{path}' is empty; export the picture again")
        if path.suffix.lower() in _RAW:
            raise ImageError(
                f"'{path}' is raw data of a camera, which has to be developed first; export TIFF or JPEG "
                "from darktable, RawTherapee or the camera's own program and give that"
            )
    except ImageError:
        raise
    except (FileNotFoundError, NotADirectoryError) as error:
        check_pattern(path)
        raise ImageError(f"there is no file '{path}'; check its name and folder") from error
    except (OSError, ValueError) as error:
        raise ImageError(
            f"cannot read '{path}' ({getattr(error, 'strerror', None) or error}); check its name and your "
            "right to read it"
        ) from error


def check_regular_below(folder: Path, what: str) -> None:
    """Refuse a folder that holds anything but files and folders, at any depth.

    Raises
    ------
    OptionError
    """
    for place, _, names in os.walk(folder):
        for name in names:
            check_regular(Path(place, name), what)
