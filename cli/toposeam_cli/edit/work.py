"""A work on disk: its pictures, settings and strokes, in a folder of the user's that outlives the program."""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import toposeam as ts
from toposeam_cli.files.temporary import create, lock
from toposeam_cli.files.writing import atomic_write

#: Names in the folder of a work.
_WORK, _LAYOUT, _PICTURES, _LOCK = "work.json", "placed.toml", "pictures", "lock"
#: So many works are listed on the first page; older ones are removed.
_REMEMBERED = 12


def works_folder() -> Path:
    """Return the folder of all works, which only the user may read."""
    home = os.environ.get("TOPOSEAM_WORKS")
    if home:
        return Path(home)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / "toposeam" / "edit"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "toposeam" / "edit"
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state") / "toposeam" / "edit"


@dataclass(slots=True, eq=False)
class Work:
    """The pictures of a page, what was chosen for them, and all strokes."""

    folder: Path
    files: list[Path] = field(default_factory=list)
    #: Options of ``toposeam stitch`` that were chosen on the page, by name.
    settings: dict[str, str] = field(default_factory=dict)
    #: Gestures in order, each a list of strokes as plain values.
    gestures: list[list[dict[str, Any]]] = field(default_factory=list)

    @property
    def layout(self) -> Path:
        """The file that says where the pictures lie."""
        return self.folder / _LAYOUT

    @property
    def pictures(self) -> Path:
        """The folder of the pictures that were dropped on the page."""
        return self.folder / _PICTURES

    @property
    def is_placed(self) -> bool:
        """True if the files say themselves where their pictures lie."""
        return len(self.files) == 1

    def source(self) -> list[Path]:
        """Return what is joined: the layout of this work if it is known where its pictures lie, else them.

        Raises
        ------
        ImageError
            If an OpenRaster file cannot be read.
        """
        if self.layout.exists():
            return [self.layout]
        if len(self.files) == 1 and self.files[0].suffix.lower() == ".ora":
            self._unpack(self.files[0])
            return [self.layout]
        return self.files

    def _unpack(self, path: Path) -> None:
        """Write the layers of an OpenRaster file as pictures, and a layout of them."""
        from toposeam.layers.canvas.transforms import similarity
        from toposeam_cli.media.layouts.layout import Layout, LayoutLayer, layout_text
        from toposeam_cli.media.pictures.openraster import read_ora
        from toposeam_cli.media.pictures.picture import write_picture

        self.pictures.mkdir(parents=True, exist_ok=True, mode=0o700)
        layers = []
        for number, layer in enumerate(read_ora(path, ts.MAX_PIXELS)):
            file = self.pictures / f"{number}.png"
            write_picture(file, layer.picture, True)
            layers.append(LayoutLayer(file=file, name=layer.name, transform=similarity(layer.at)))
        atomic_write(self.layout, layout_text(self.folder, Layout(layers=tuple(layers))), force=True)

    @property
    def touched(self) -> bool:
        """True if there is something that would be lost."""
        return bool(self.gestures or self.settings) or (self.pictures.is_dir() and self.layout.exists())

    def save(self) -> None:
        """Write pictures' names, settings and strokes.

        Raises
        ------
        OutputError
            If the disk is full.
        """
        self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        content = {
            "files": [os.fsencode(path).hex() for path in self.files],
            "stamps": [_stamp(path) for path in self.files],
            "settings": self.settings,
            "gestures": self.gestures,
        }
        atomic_write(self.folder / _WORK, json.dumps(content), force=True)

    def forget(self) -> None:
        """Remove the work from the disk; pictures that lie elsewhere stay."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def forget_places(self) -> None:
        """Remove what says where the pictures lie."""
        self.layout.unlink(missing_ok=True)


def work_of(files: Sequence[Path]) -> Work:
    """Return the work on some pictures: the one that was begun, or a new one; without any, an empty one."""
    real = [path.resolve() for path in files]
    name = secrets.token_hex(8)
    if real:
        name = hashlib.sha256(b"\0".join(map(os.fsencode, real))).hexdigest()[:16]
    found = read_work(works_folder() / name)
    return found or Work(folder=works_folder() / name, files=real)


def read_work(folder: Path) -> Work | None:
    """Read a work; None if there is none in that folder. Places are forgotten if a picture has changed."""
    try:
        content = json.loads((folder / _WORK).read_text(encoding="utf-8"))
        files = [Path(os.fsdecode(bytes.fromhex(name))) for name in content["files"]]
        work = Work(folder, files, content["settings"], content["gestures"])
        changed = content["stamps"] != [_stamp(path) for path in files]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    if changed:
        work.forget_places()
    return work


def recent_works() -> list[tuple[str, Work, float]]:
    """Return the name, the work and the time of the works that were begun, the newest first."""
    found = []
    with suppress(OSError):
        for folder in works_folder().iterdir():
            with suppress(OSError):
                changed = (folder / _WORK).stat().st_mtime
                work = read_work(folder)
                if work is not None and work.files and all(path.exists() for path in work.files):
                    found.append((folder.name, work, changed))
    found.sort(key=lambda each: -each[2])
    return found[:_REMEMBERED]


@contextmanager
def claimed_work(work: Work) -> Iterator[None]:
    """Keep other pages off a work during the block, and remove it in the end if nothing was done.

    Raises
    ------
    OptionError
        If another page has it open.
    """
    with claimed(work.folder, "these pictures are"):
        yield
        now = read_work(work.folder)  # another process paints
        if now is None or not now.touched:
            work.forget()


@contextmanager
def claimed(folder: Path, what: str) -> Iterator[None]:
    """Keep other pages off the folder of a work during the block.

    Raises
    ------
    OptionError
        If another page has it open.
    """
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    path = folder / _LOCK
    with suppress(FileExistsError):
        os.close(create(path))
    descriptor = os.open(path, os.O_RDWR)
    try:
        if not lock(descriptor):
            raise ts.OptionError(f"{what} open on another page; go on there, or end that first")
        yield
    finally:
        os.close(descriptor)


def _stamp(path: Path) -> list[float]:
    """Return what changes when a file does."""
    try:
        state = path.stat()
    except OSError:
        return []
    return [state.st_size, state.st_mtime]
