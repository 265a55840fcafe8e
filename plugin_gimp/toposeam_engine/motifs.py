"""The engine's operations on motifs: layers of ink invented, and repeated by their rule."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.colours import to_hex
from toposeam.motif.ink.printing import MAX_PATTERN
from toposeam.motif.symmetry.tiling import tile
from toposeam_engine.job import EngineJob

if TYPE_CHECKING:
    from toposeam.motif import Motif


def motif(job: EngineJob) -> dict[str, Any]:
    """Invent a motif: a density per ink, the colours of inks and paper, and the recipe."""
    made = generated(job)
    return {
        "inks": [to_hex(ink) for ink in made.inks],
        "paper": to_hex(made.paper),
        "densities": [job.write(density) for density in made.coverage()],
        "recipe": made.recipe.to_dict(),
    }


def generated(job: EngineJob) -> Motif:
    """Compute the motif of a request."""
    options = job.options
    size = options.pop("size")
    for name in ("mass", "layers", "penalty", "iterations"):
        if not options.get(name):
            options.pop(name, None)  # then seed and style decide, as for the palette
    for name, drawn in (("palette", "random"), ("edge", "auto")):
        if options.get(name) == drawn:
            del options[name]
    for name in ("style", "repeat"):
        if options.get(name, "random") == "random":
            options[name] = None
    if options.get("penalty") is not None:
        options["penalty"] = max(options["penalty"], 1.0)
    if job.request.get("layer") is None:
        del options["base_strength"]
    else:
        options["base"] = np.array(job.read(job.request["layer"]))
    return ts.motif(size, progress=job.progress, **options)


def repeat(job: EngineJob) -> dict[str, Any]:
    """Lay densities side by side by a rule; return them, the rule, and the colours if a palette was given."""
    densities, rule = repeated(job)
    result = {"densities": [job.write(density) for density in densities], "repeat": rule}
    name = str(job.options.get("palette", "own"))
    if name != "own":
        chosen = ts.motif.palette(name, len(densities))
        result |= {"inks": [to_hex(ink) for ink in chosen.inks], "paper": to_hex(chosen.paper)}
    return result


def repeated(job: EngineJob) -> tuple[list[npt.NDArray[Any]], str]:
    """Return the pattern's densities, and the rule by which they were laid."""
    rows, columns = int(job.options["rows"]), int(job.options["columns"])
    rule = str(job.options.get("repeat", "own"))
    if rule == "own":
        rule = str(job.request["repeat"])
    cells = [job.read(raster) for raster in job.request["densities"]]
    height, width = cells[0].shape
    if rows * columns * height * width > MAX_PATTERN:
        raise ts.OptionError(
            "the pattern would have {width:,} × {height:,} pixels; ask for fewer motifs",
            kind="too large",
            width=columns * width,
            height=rows * height,
        )
    laid = []
    for index, cell in enumerate(cells, start=1):
        laid.append(tile(cell, rule, (rows, columns)))
        job.progress(index / len(cells))
    return laid, rule
