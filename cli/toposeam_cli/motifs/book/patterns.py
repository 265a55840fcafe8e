"""The content of a pattern book's pages: one pattern round a theme, or one product, as a job of a worker
process.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import toposeam as ts
from toposeam.motif.book import SEASONS, book_recipe
from toposeam.motif.ink.mixing import mix
from toposeam.motif.ink.sampling import resample
from toposeam.motif.kinds import measure
from toposeam.motif.recipe.recipe import unpack_base
from toposeam.motif.symmetry.tiling import period
from toposeam_cli.media.pictures.colour import to_depth
from toposeam_cli.media.pictures.picture import Picture, write_picture
from toposeam_cli.motifs.printing import Print, per_mm, printable, sheet_coverage
from toposeam_cli.motifs.products import draw_product, pattern_px
from toposeam_cli.motifs.recipe_files import read_recipe
from toposeam_cli.motifs.themes import read_theme

if TYPE_CHECKING:
    from toposeam.motif import Motif

#: Motifs across and down of a swatch, so that it repeats by translation for every rule.
_SWATCH = 2


#: Keys of the result of :func:`draw_pattern`, and the types of their values.
ROW: dict[str, type] = {
    "number": int,
    "theme": str,
    "kind": str,
    "season": str,
    "stroke": float,
    "likeness": float,
    "repeat": str,
    "layers": int,
    "mass": list,
    "p": float,
    "sources": list,
    "sinks": list,
    "ambient": float,
    "iterations": int,
    "filter": float,
    "base_strength": float,
}


def draw_pattern(
    theme: str,
    seed: int,
    number: int,
    size: int,
    motif: str,
    swatch: str,
    force: bool = False,
    width_mm: float | None = None,
    dpi: float | None = None,
) -> dict[str, Any]:
    """Make one pattern: the motif with its recipe, at its size on paper, and a swatch that repeats by
    translation. Return its measurements.
    """
    recipe = book_recipe(_theme(theme), seed, number, size)
    made = ts.motif(recipe)
    paper = Print(width_mm=width_mm, dpi=dpi)
    image = mix(sheet_coverage(made, paper), made.inks, made.paper, made.inking)
    settings = {**paper.note(), "recipe": recipe.to_dict()}
    write_picture(motif, printable(image, paper.resolution, settings), force)
    write_picture(
        swatch, Picture(pixels=to_depth(ts.repeat(made, (_SWATCH, _SWATCH)), np.dtype(np.uint8))), force
    )
    # The theme as on the plate, in the motif's own cell. Hexagonal cells are sheared, so that it is not
    # measured.
    upright = made.densities.shape[1:] == recipe.size
    base = resample(unpack_base(recipe.base), "none", recipe.size) if upright else None
    character = measure(made.image(), base)
    first = recipe.layers[0]
    return {
        "number": number,
        "theme": Path(theme).stem,
        "kind": str(character.kind),
        "season": SEASONS[number % len(SEASONS)],
        "stroke": round(character.stroke, 4),
        "likeness": round(character.likeness, 3),
        "repeat": recipe.repeat,
        "layers": len(recipe.layers),
        "mass": [round(layer.mass, 3) for layer in recipe.layers],
        "p": first.penalty,
        "sources": [len(layer.sources) for layer in recipe.layers],
        "sinks": [len(layer.sinks) for layer in recipe.layers],
        "ambient": round(first.ambient, 2),
        "iterations": recipe.iterations,
        "filter": round(recipe.filter_radius, 2),
        "base_strength": round(recipe.base_strength, 2),
    }


def draw_on_product(
    motif: str,
    product: str,
    output: str,
    motif_mm: float | None = None,
    force: bool = True,
    second: str | None = None,
    inks: int | None = None,
    edge: str | None = None,
    dpi: float | None = None,
) -> None:
    """Make one mock-up from a motif's recipe, and from a second recipe for products of two patterns. The
    first may be simplified (`ts.motif.simplify`).
    """
    across = pattern_px(product, motif_mm, dpi)
    made, pattern = _sharp(motif, across, inks, edge)
    other = None if second is None else (_sharp(second, across)[1], across)
    dark = made.inks[int(np.argmin(made.inks.sum(axis=1)))]
    drawn = draw_product(product, pattern, across, made.paper, dark * made.paper, motif_mm, other, dpi)
    write_picture(output, shown_at(drawn, dpi), force=force)


def shown_at(drawn: np.ndarray, dpi: float | None) -> Picture:
    """Return a mock-up as a picture, with its resolution if it is given."""
    return Picture(pixels=drawn, resolution=per_mm(dpi))


def _sharp(
    motif: str, across: int, inks: int | None = None, edge: str | None = None
) -> tuple[Motif, np.ndarray]:
    """Return a motif and the piece of its pattern that repeats by translation, motifs `across` px wide."""
    made = ts.motif(ts.motif.simplify(read_recipe(Path(motif)), inks=inks, edge=edge))
    height, width = made.densities.shape[1:]
    size = (max(1, round(across * height / width)), across)
    return made, to_depth(ts.repeat(made, period(made.repeat), size=size), np.dtype(np.uint8))


@functools.lru_cache(maxsize=2)
def _theme(path: str) -> np.ndarray:
    return read_theme(Path(path))
