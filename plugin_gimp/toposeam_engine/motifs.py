"""What the engine can be asked for about motifs: layers of ink invented, and repeated by their rule."""

from __future__ import annotations

from typing import Any

import numpy as np

import toposeam as ts
from toposeam.colours import to_hex
from toposeam.motif.inked import MAX_PATTERN
from toposeam.motif.tiling import tile
from toposeam_engine.serving import Job


def motif(job: Job) -> dict[str, Any]:
    """Layers of ink: a density per ink, the inks' and the paper's colours, and the recipe."""
    made = generated(job)
    return {
        "inks": [to_hex(ink) for ink in made.inks],
        "paper": to_hex(made.paper),
        "densities": [job.write(density) for density in made.coverage()],
        "recipe": made.recipe.to_dict(),
    }


def generated(job: Job) -> ts.Motif:
    """The motif itself."""
    options = job.options
    size = options.pop("size")
    if not options["mass"]:
        del options["mass"]  # then the seed decides, as for the palette
    if options["palette"] == "random":
        del options["palette"]
    if job.request.get("layer") is None:
        del options["base_strength"]
    else:
        options["base"] = np.array(job.read(job.request["layer"]))
    return ts.generate_motif(size, progress=job.progress, **options)


def repeat(job: Job) -> dict[str, Any]:
    """Densities laid side by side by a rule."""
    rows, columns = int(job.options["rows"]), int(job.options["columns"])
    cells = [job.read(raster) for raster in job.request["densities"]]
    height, width = cells[0].shape
    if rows * columns * height * width > MAX_PATTERN:
        raise ts.OptionError(
            f"the pattern would have {columns * width:,} × {rows * height:,} pixels; ask for fewer motifs"
        )
    written = []
    for index, cell in enumerate(cells, start=1):
        written.append(job.write(tile(cell, str(job.request["repeat"]), (rows, columns))))
        job.progress(index / len(cells))
    return {"densities": written}
