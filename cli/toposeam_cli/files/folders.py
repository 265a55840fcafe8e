"""Folders of pictures in place of the names of their files."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

import toposeam as ts
from toposeam.sentence import counted
from toposeam_cli.files.writing import PICTURE_SUFFIXES

#: Suffixes of files that are taken for pictures.
PICTURES = (*PICTURE_SUFFIXES, ".heic", ".heif", ".hif", ".avif", ".bmp", ".jp2", ".gif")


def in_folders(paths: Sequence[Path], output: Path) -> tuple[list[Path], list[str]]:
    """List files, and the pictures in each folder by name, but what the command itself writes there.

    Parameters
    ----------
    paths : sequence of Path
        Files and folders.
    output : Path
        Files of its name, and of its name with a number, are products and no pictures to be joined.

    Returns
    -------
    files : list of Path
    left_out : list of str
        The names of other files in the folders.

    Raises
    ------
    OptionError
        If a folder holds no picture, or only one and nothing else is given.
    """
    files, left_out = list[Path](), list[str]()
    made = re.compile(rf"{re.escape(output.stem)}(-\d+)?{re.escape(output.suffix)}")
    for path in paths:
        if not os.path.isdir(path):  # noqa: PTH112 - False for names that are too long
            files.append(path)
            continue
        here = path.resolve() == output.resolve().parent
        found = sorted(one for one in path.iterdir() if one.is_file() and not one.name.startswith("."))
        found = [one for one in found if not (here and made.fullmatch(one.name))]
        pictures = [one for one in found if one.suffix.lower() in PICTURES]
        left_out += [one.name for one in found if one.suffix.lower() not in PICTURES]
        if len(pictures) < (2 if len(paths) == 1 else 1):
            raise ts.OptionError(
                f"the folder '{path}' holds {counted(len(pictures), 'picture')}; put two or more there that "
                "overlap"
            )
        files += pictures
    return files, left_out
