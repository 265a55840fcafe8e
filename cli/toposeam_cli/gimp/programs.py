"""The installed programs of GIMP, and the profile that each reads."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from toposeam_gimp.engine.launching import absolute_entries, find_program, run


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """An installed GIMP."""

    #: "3.0"
    version: str
    #: The program that runs without a window; None where only its sandbox is known.
    console: str | None
    #: Kind of installation as in :class:`toposeam_cli.gimp.folders.Profile`: "GIMP" or "Flatpak".
    kind: str = "GIMP"

    @property
    def is_3(self) -> bool:
        """True if it is a GIMP 3, for which the plug-in is made."""
        return self.version.startswith("3.")


def programs() -> list[Program]:
    """Return the installed GIMPs, the newest first; of each version the first on PATH."""
    found: dict[str, Program] = {}
    for folder in _folders():
        for file in sorted(folder.glob("gimp*")):
            match = re.fullmatch(r"gimp(-console)?-(\d+\.\d+)(\.exe)?", file.name)
            if match is None or find_program(str(file)) is None:
                continue
            version = match[2]
            known = found.get(version)
            if known is None or (known.console is None and match[1]):
                found[version] = Program(version=version, console=str(file) if match[1] else None)
    return [*sorted(found.values(), key=_order, reverse=True), *_flatpaks()]


def _order(program: Program) -> list[int]:
    return [int(part) for part in program.version.split(".")]


def _folders() -> Iterator[Path]:
    yield from map(Path, absolute_entries(os.environ.get("PATH", "")))
    if sys.platform == "darwin":
        yield Path("/Applications/GIMP.app/Contents/MacOS")
    if sys.platform == "win32":
        yield Path(os.environ.get("PROGRAMFILES", "C:/Program Files")) / "GIMP 3" / "bin"
        yield Path(os.environ.get("LOCALAPPDATA", "")) / "Programs" / "GIMP 3" / "bin"


def _flatpaks() -> Iterator[Program]:
    flatpak = find_program("flatpak")
    if flatpak is None:
        return
    answer = run([flatpak, "info", "org.gimp.GIMP"])
    match = re.search(r"Version:\s*(\d+\.\d+)", answer.stdout)
    if answer.returncode == 0 and match is not None:
        yield Program(version=match[1], console=None, kind="Flatpak")
