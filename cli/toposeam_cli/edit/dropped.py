"""Pictures that were dropped on the page, and the samples that it offers."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator, Sequence
from contextlib import ExitStack
from functools import cache
from pathlib import Path

import toposeam as ts
from toposeam_cli.edit.work import Work, work_of, works_folder
from toposeam_cli.files.temporary import claimed_folder, temporary_beside, tidy_once
from toposeam_cli.files.writing import OutputError, reason

#: Most files of a server, and most bytes of one.
_MOST_FILES, _MOST_BYTES = 1000, 4 << 30
_SAMPLES = (("portrait_left.jpg", "portrait_right.jpg"), ("coffee_a.jpg", "coffee_b.jpg", "coffee_c.jpg"))


class Dropped:
    """Files that arrive from the page; they wait in a folder that goes with the server unless it is used."""

    def __init__(self) -> None:
        self._open = ExitStack()
        self._folder: Path | None = None
        self._files: list[Path] = []
        self._names: list[str] = []

    async def take(self, name: str, chunks: AsyncIterator[bytes]) -> int:
        """Write a file as it arrives; return its number.

        Raises
        ------
        OutputError
            If the disk is full.
        OptionError
            If there are too many, or one is too large.
        """
        if len(self._files) >= _MOST_FILES:
            raise ts.OptionError(f"more than {_MOST_FILES} pictures were dropped; open fewer")
        folder = self._waiting()
        number = len(self._files)
        path = folder / str(number)
        self._files.append(path)
        self._names.append(_plain(name))
        count = 0
        try:
            with path.open("wb") as file:
                async for chunk in chunks:
                    count += len(chunk)
                    if count > _MOST_BYTES:
                        raise ts.OptionError(f"'{name}' is larger than 4 GiB; open it by its name instead")
                    file.write(chunk)
        except OSError as error:
            path.unlink(missing_ok=True)
            raise OutputError(
                f"'{_plain(name)}' cannot be kept in '{folder.parent}' ({reason(error)}); free some space"
            ) from error
        return number

    def as_work(self, numbers: Sequence[int]) -> Work:
        """Return a new work of some of the files, which now belong to it.

        Raises
        ------
        OptionError
            If there are none.
        """
        there = [number for number in dict.fromkeys(numbers) if number < len(self._files)]
        if not there:
            raise ts.OptionError("no pictures were dropped; drop at least two")
        work = work_of([])
        work.pictures.mkdir(parents=True, mode=0o700)
        names: set[str] = set()
        for number in there:
            name = self._names[number]
            while name in names:
                name = f"{Path(name).stem}-{number}{Path(name).suffix}"
            names.add(name)
            if self._files[number].exists():
                work.files.append(self._files[number].rename(work.pictures / name))
        work.save()
        return work

    def close(self) -> None:
        """Remove what was not used."""
        self._open.close()

    def _waiting(self) -> Path:
        if self._folder is None:
            parent = works_folder()
            parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            tidy_once(parent)
            self._folder = self._open.enter_context(
                claimed_folder(temporary_beside(parent / "dropped"), 0o700)
            )
        return self._folder


def _plain(name: str) -> str:
    """Return the name of a file without anything that could lead elsewhere."""
    kept = re.sub(r"[^\w.+ -]", "_", name.replace("\\", "/").rpartition("/")[2]).lstrip(". ")[:120]
    return kept or "picture"


@cache
def samples() -> tuple[tuple[tuple[str, ...], tuple[Path, ...]], ...]:
    """Return the names and files of each sample that is installed."""
    here = Path(__file__).parent / "samples"
    folder = here if here.is_dir() else Path(__file__).parents[3] / "samples"
    found = ((names, tuple(folder / name for name in names)) for names in _SAMPLES)
    return tuple((names, paths) for names, paths in found if all(path.exists() for path in paths))
