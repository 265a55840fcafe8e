"""A motif on disk: its sketches, the one that is shown, and those that undo and redo lead to."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path

import toposeam as ts
from toposeam_cli.edit.motif.sketch import Sketch
from toposeam_cli.edit.work import works_folder
from toposeam_cli.files.writing import atomic_write
from toposeam_cli.motifs.recipe_files import read_recipe, read_toml, recipe_from_table

_FILE = "motif.json"
#: So many sketches are kept in each direction.
MOST_KEPT = 60
#: Elements along the sides of a motif that is not begun from a file.
SIDE = 256


@dataclass(slots=True, eq=False)
class MotifWork:
    """A folder with the sketches of a motif."""

    folder: Path
    #: The file whose recipe is begun with; None for one that is drawn.
    source: Path | None

    def read(self) -> tuple[list[Sketch], int] | None:
        """Return the sketches that are kept, and the number of the one that was shown; None if there are
        none.
        """
        try:
            record = json.loads((self.folder / _FILE).read_text(encoding="utf-8"))
            sketches = [Sketch.from_dict(one) for one in record["sketches"]]
            at = int(record["at"])
        except (OSError, ValueError, KeyError, TypeError, ts.TopoSeamError):
            return None
        return (sketches, at) if 0 <= at < len(sketches) else None

    def save(self, sketches: list[Sketch], at: int) -> None:
        """Write the sketches.

        Raises
        ------
        OutputError
            If the disk is full.
        """
        self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        record = {"sketches": [sketch.to_dict() for sketch in sketches], "at": at}
        atomic_write(self.folder / _FILE, json.dumps(record), force=True)

    def first(self, seed: int) -> Sketch:
        """Return the sketch to begin with: the recipe of the file, or what a seed draws.

        Raises
        ------
        OptionError, ImageError
            If the file holds no recipe.
        """
        if self.source is None:
            return Sketch(recipe=ts.motif.random_recipe((SIDE, SIDE), style=None, repeat=None, seed=seed))
        if self.source.suffix.lower() == ".toml":
            recipe = recipe_from_table(read_toml(self.source), self.source)
            if recipe is None:
                raise ts.OptionError(
                    f"'{self.source}' holds parameters, not a whole recipe; write one by toposeam motif "
                    "--show-recipe"
                )
            return Sketch(recipe=recipe)
        return Sketch(recipe=read_recipe(self.source))


def motif_work(source: Path | None) -> MotifWork:
    """Return the work on a file of a motif, or on the one that is drawn without."""
    name = "motif"
    if source is not None:
        state = source.stat()
        stamp = f"{state.st_size} {state.st_mtime_ns}".encode()
        name += "-" + hashlib.sha256(os.fsencode(source.resolve()) + stamp).hexdigest()[:16]
    return MotifWork(works_folder() / name, source)
