"""The pages of a motif: what the server adds to those of any work."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import toposeam as ts
from toposeam.motif.ink import palette
from toposeam.sentence import sentence
from toposeam_cli.edit.messages import packed
from toposeam_cli.edit.motif import solver
from toposeam_cli.edit.motif.messages import GROWTHS, MOST_LAYERS, SLIDERS, parsed
from toposeam_cli.edit.motif.work import MotifWork
from toposeam_cli.edit.processes import Worker
from toposeam_cli.edit.server import Mirror, Page, Pages
from toposeam_cli.edit.work import claimed
from toposeam_cli.files.writing import atomic_write
from toposeam_cli.motifs.printing import DRAWINGS

#: Name of what *Save* makes for the browser, in the folder of the work.
_SAVED = "motif"
#: Messages that end here.
_HERE = ("cancel", "takeover")


class MotifMirror(Mirror):
    """What the solver has said, for pages that come later: the newest of each kind."""

    def take(self, kind: str, head: dict[str, Any], blocks: list[bytes]) -> None:
        """Keep an event."""
        if kind in ("state", "density", "refused"):
            self.kept[kind] = packed(kind, head, blocks)

    def messages(self) -> list[bytes]:
        """Return the messages that bring a new page up to date."""
        return [self.kept[kind] for kind in ("refused", "state", "density") if kind in self.kept]


class MotifPages(Pages):
    """The pages of a motif, and the process in which it grows."""

    file = "motif.html"
    parse = staticmethod(parsed)

    def __init__(self, work: MotifWork, output: Path | None, end: Callable[[], None]) -> None:
        super().__init__(output, end)
        self.work, self.mirror = work, MotifMirror()

    def begin(self) -> None:
        """Start the process in which the motif grows.

        Raises
        ------
        OptionError
            If the motif is open on another page.
        """
        self._stack.enter_context(claimed(self.work.folder, "this motif is"))
        self._solver = Worker(solver.run, (self.work,), self._take)

    def about(self) -> dict[str, Any]:
        """Return what a page offers: styles, rules, palettes and the ranges of sliders."""
        ways = {name: palette(name, MOST_LAYERS) for name in ts.motif.PALETTES}
        return {
            "styles": list(ts.motif.STYLES),
            "rules": list(ts.motif.REPEATS),
            "palettes": [
                {"name": name, "paper": way.paper.tolist(), "inks": way.inks.tolist()}
                for name, way in ways.items()
            ],
            "sliders": SLIDERS,
            "most": MOST_LAYERS,
        }

    def do(self, page: Page, message: dict[str, Any]) -> None:
        """Do what the page that owns the work asks for."""
        if message["kind"] == "save" and self._saving is not None:
            return
        if message["kind"] not in _HERE:
            self.ask_solver(page, message)

    def _take(self, event: Any) -> None:
        """Pass an event of the solver on; it also says when a recipe to be saved is written."""
        if event is None or event[0] != "recipe":
            super()._take(event)
        elif self._saving is None:
            self._save(event[1])

    def _save(self, wanted: dict[str, Any]) -> None:
        """Begin to make the motif of the recipe that was written."""
        source = Path(wanted["source"])
        target = self.output or self.work.folder / f"{_SAVED}.{wanted['format']}"
        if target.suffix.lower() != ".toml":
            self._write("motif", save_words(wanted, source, target), target)
            return
        self._target = target
        try:
            atomic_write(target, source.read_bytes(), force=True)
        except ts.TopoSeamError as error:
            self._saved(("failed", sentence(error), 0.0))
        else:
            self._saved(("saved", target.name, 1.0))


def save_words(wanted: dict[str, Any], source: Path, target: Path) -> list[str]:
    """Return the options of ``toposeam motif`` that a save stands for; growth is saved beside a picture.

    Parameters
    ----------
    wanted : dict
        Columns and rows of the sheet, and the width and height of one motif in px.
    source, target : Path
        The recipe, and the file to be made.
    """
    columns, rows = wanted["columns"], wanted["rows"]
    words = ["--from", str(source), "--force", "--sheet", f"{columns}x{rows}"]
    if target.suffix.lower() not in DRAWINGS:
        words += ["--pixels", f"{columns * wanted['width']}x{rows * wanted['height']}"]
    if target.name.lower().endswith(GROWTHS):
        return [*words, "--animate", str(target), "-o", str(source.with_suffix(".png"))]
    return [*words, "-o", str(target)]
