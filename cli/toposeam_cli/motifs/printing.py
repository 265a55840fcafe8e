"""Printing of a motif: rows and columns, size, resolution, and the recipe that is written into the file."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import toposeam as ts
from toposeam.colours import to_hex
from toposeam.motif.ink.printing import MAX_PATTERN
from toposeam.motif.ink.svg import check_counts
from toposeam.motif.optimise.hexagonal_lattice import tile_size
from toposeam.motif.symmetry.rules import HEXAGONAL
from toposeam.sentence import counted
from toposeam_cli.media.pictures.colour import to_depth
from toposeam_cli.media.pictures.libvips import load_vips
from toposeam_cli.media.pictures.picture import Picture
from toposeam_cli.motifs.recipe_files import to_xmp

if TYPE_CHECKING:
    from toposeam.motif import Motif, Recipe

#: An ink that lowers every channel of the paper by less than this is invisible on it; channels are in [0, 1].
_FAINT = 0.12
#: Extensions of a motif's file.
SUFFIXES = (".png", ".tif", ".tiff", ".svg", ".pdf")
#: Extensions of drawings, which are made of curves.
DRAWINGS = (".svg", ".pdf")
#: Resolution of a motif whose width on paper is given, without --dpi.
_DPI = 300.0


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Print:
    """Print settings of a motif; kept beside the recipe."""

    #: Rows and columns of motifs.
    counts: tuple[int, int] = (1, 1)
    #: Width and height of the whole sheet, px.
    pixels: tuple[int, int] | None = None
    #: Width of one motif, mm.
    width_mm: float | None = None
    dpi: float | None = None
    #: Steps from paper to full ink in a drawing.
    levels: int = 12
    #: Whether the paper is transparent.
    transparent: bool = False

    @property
    def resolution(self) -> float | None:
        """Resolution of the picture, px per inch; None if unknown."""
        return _DPI if self.dpi is None and self.width_mm is not None and self.pixels is None else self.dpi

    def laid(self, recipe: Recipe) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return the rows and columns of motifs on the sheet, and the rows and columns of px of one motif,
        which keeps its shape.

        Where the size of the whole sheet is given, the columns of `counts` fill its width, and surplus rows
        are cut at the bottom.
        """
        height, width = tile_size(recipe.size[0]) if recipe.repeat in HEXAGONAL else recipe.size
        if self.pixels is not None:
            across = math.ceil(self.pixels[0] / self.counts[1])
        elif self.width_mm is not None and self.resolution is not None:
            across = max(1, round(self.width_mm / 25.4 * self.resolution))
        else:
            across = width
        size = max(1, round(across * height / width)), across
        rows = self.counts[0] if self.pixels is None else math.ceil(self.pixels[1] / size[0])
        return (rows, self.counts[1]), size

    def check(self, recipe: Recipe, drawn: bool) -> None:
        """Refuse sheets that are too large, before any work."""
        if drawn:
            check_counts(self.counts)
            return
        (rows, columns), (height, width) = self.laid(recipe)
        if rows * columns * height * width > MAX_PATTERN:
            raise ts.OptionError(
                f"the picture would have {columns * width:,} × {rows * height:,} px, and at most "
                f"{MAX_PATTERN:,} in all can be made; ask for fewer or smaller motifs, or a .svg"
            )

    def note(self) -> dict[str, Any]:
        """Return the record that is written into the file."""
        return {"print": dataclasses.asdict(self)}

    @staticmethod
    def read(settings: Mapping[str, Any]) -> dict[str, Any]:
        """Return the print settings in a file's settings, without damaged ones."""
        found = settings.get("print")
        if not isinstance(found, dict):
            return {}
        kept: dict[str, Any] = {}
        for name in ("counts", "pixels"):
            pair = found.get(name)
            if (
                isinstance(pair, list)
                and len(pair) == 2
                and all(isinstance(side, int) and 0 < side < 10**6 for side in pair)
            ):
                kept[name] = tuple(pair)
        for name in ("width_mm", "dpi", "levels"):
            value = found.get(name)
            if isinstance(value, int | float) and 0 < value < 10**5:
                kept[name] = value
        if found.get("transparent") is True:
            kept["transparent"] = True
        return kept


def sheet_coverage(made: Motif, paper: Print) -> np.ndarray:
    """Return the share of each ink on a sheet of a motif, (n_L, H, W)."""
    counts, cell = paper.laid(made.recipe)
    layers = ts.motif.repeat_densities(made, counts, size=cell)
    return layers if paper.pixels is None else layers[:, : paper.pixels[1], : paper.pixels[0]]


def ink_names(recipe: Recipe) -> tuple[str, ...]:
    """Return the names of a motif's inks."""
    return tuple(layer.name or f"ink {number}" for number, layer in enumerate(recipe.layers, 1))


def unseen_inks(recipe: Recipe) -> str | None:
    """Return one sentence if inks are invisible on the paper, whose colour they multiply; None if all are
    visible.
    """
    paper, opaque = np.array(recipe.paper), recipe.inking == "opaque"
    taken = [
        float((abs(paper - layer.ink) if opaque else paper * (1 - np.array(layer.ink))).max())
        for layer in recipe.layers
    ]
    names = [name for name, share in zip(ink_names(recipe), taken, strict=True) if share < _FAINT]
    if not names:
        return None
    if opaque:
        return f"{', '.join(names)} will barely show on {to_hex(paper)}; take another paper or other inks"
    return (
        f"{', '.join(names)} will barely show: inks are transparent and make the paper darker, and "
        f"{to_hex(paper)} is as dark as they are; take a lighter paper, darker inks, or --ink opaque"
    )


def describe(made: Motif, counts: tuple[int, int]) -> str:
    """Return one line about a motif for people."""
    many = "" if counts == (1, 1) else f"{counts[1]} × {counts[0]} motifs, "
    styles = style_words(made.recipe)
    return (
        f"{many}{styles}, {counted(len(made.inks), 'ink')}, repeats by {made.repeat}, seed {made.recipe.seed}"
    )


def style_words(recipe: Recipe) -> str:
    """Return the styles of a motif's layers, each once."""
    return " and ".join(dict.fromkeys(layer.style for layer in recipe.layers))


def per_mm(dpi: float | None) -> tuple[float, float] | None:
    """Convert a resolution in px per inch to px per mm, across and down."""
    return None if dpi is None else (dpi / 25.4, dpi / 25.4)


def printable(
    image: np.ndarray, dpi: float | None, settings: Mapping[str, Any], alpha: np.ndarray | None = None
) -> Picture:
    """Return a picture in sRGB with its resolution and recipe.

    With an `alpha`, `image` is the picture on white; the result has the colours of the inks alone.
    """
    if alpha is not None:
        ink = (image - (1.0 - alpha[..., np.newaxis])) / np.maximum(alpha[..., np.newaxis], 1e-6)
        image = np.where(alpha[..., np.newaxis] > 0, np.clip(ink, 0.0, 1.0), 1.0).astype(np.float32)
    return Picture(
        pixels=to_depth(np.ascontiguousarray(image), np.dtype(np.uint8)),
        alpha=None if alpha is None else to_depth(alpha.astype(np.float32), np.dtype(np.uint8)),
        icc=bytes(load_vips().Image.profile_load("srgb")),
        resolution=per_mm(dpi),
        xmp=to_xmp(settings),
    )


def separation(coverage: np.ndarray, dpi: float | None, settings: Mapping[str, Any]) -> Picture:
    """Return one ink as a gray picture: black for full ink, white for none. It has no colour profile, as its
    numbers are shares of ink.
    """
    return Picture(
        pixels=to_depth(np.ascontiguousarray(1.0 - coverage, dtype=np.float32), np.dtype(np.uint8)),
        resolution=per_mm(dpi),
        xmp=to_xmp(settings),
    )


def plate_path(output: Path, number: int, name: str) -> Path:
    """Return the path of one ink's separation: beside the picture, with the ink's number and name."""
    word = "-".join(re.findall(r"\w+", name)) or "ink"
    return output.with_name(f"{output.stem}.{number}-{word}{output.suffix}")
