"""``toposeam repeat``: a sheet of motifs, side by side by their rule."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import click
import numpy as np

import toposeam as ts
from toposeam.motif.arrange import tile
from toposeam.motif.motif import MAX_PATTERN
from toposeam.motif.svg import SvgOptions, draw_svg
from toposeam_cli.motif import SUFFIXES, Print, describe
from toposeam_cli.output import atomic_write, check_output
from toposeam_cli.parameters import FILE, OUTPUT, PairType, PaperLengthType
from toposeam_cli.picture import read_picture, write_picture
from toposeam_cli.progress import share_bar
from toposeam_cli.recipe_file import read_recipe, read_settings, to_xmp


@click.command()
@click.argument("picture", metavar="MOTIF", type=FILE)
@click.argument("counts", metavar="ROWSxCOLUMNS", type=PairType(first="rows"))
@click.option("-o", "--output", type=OUTPUT, required=True, help="The sheet: .png, .tif, .jpg, .webp or .svg.")
@click.option("--rule", type=click.Choice(ts.REPEATS), help="How any picture is arranged; by default as its motif was made for.")
@click.option("--motif-width", type=PaperLengthType(), help="For .svg: width of one motif on paper, like 60mm.")
@click.option("--levels", type=click.IntRange(1, 64), default=12, show_default=True, help="For .svg: steps from paper to full ink.")
@click.option("--force", is_flag=True, help="Replace existing files.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def repeat(
    picture: Path, counts: tuple[int, int], output: Path, rule: str | None, motif_width: float | None, levels: int, force: bool,
    quiet: bool,
) -> None:  # fmt: skip
    """Lay a motif side by side, mirrored or turned where its rule says so.

    \b
    toposeam repeat motif.png 8x8 -o sheet.png
    toposeam repeat photograph.jpg 3x3 -o kaleidoscope.png --rule reflect

    An .svg, as input or output, is drawn from the recipe in the motif; pictures are copied pixel by pixel.
    """  # noqa: D301 - click wants the character
    drawn = output.suffix.lower() == ".svg"
    check_output(output, force, (*SUFFIXES, ".jpg", ".jpeg", ".webp"))
    if picture.suffix.lower() == ".svg" and not drawn:
        raise ts.OptionError(f"'{picture}' is a drawing, so its sheet is one; write it to a .svg, or begin with: toposeam motif --like")
    if drawn:
        recipe = read_recipe(picture)
        if rule is not None and rule != recipe.repeat:
            raise ts.OptionError(f"a drawing repeats by the motif's own rule, {recipe.repeat}; leave --rule out, or write a .png")
        with share_bar(f"drawing {output.name}", quiet) as bar:
            made = ts.generate_motif(recipe, progress=None if bar is None else lambda done, total: bar(done / total))
        paper = Print(counts=counts, width_mm=motif_width, levels=levels)
        document = draw_svg(made, counts, options=SvgOptions(levels=levels, width_mm=motif_width), note=paper.note())
        atomic_write(output, document, force)
        if not quiet:
            click.echo(f"{output}: {len(document) / 1e6:.1f} MB, {describe(made, counts)}")
        return
    if motif_width is not None:
        raise ts.OptionError("--motif-width belongs to .svg; a picture keeps the resolution it has")
    motif = read_picture(picture)
    settings = None
    if rule is None:
        settings = read_settings(picture, ", or say how to arrange this with --rule")
        recipe = read_recipe(picture)
        if Print(**Print.read(settings)).laid(recipe) != ((1, 1), motif.pixels.shape[:2]):
            raise ts.OptionError(f"'{picture}' is not one whole motif; give one, or say how to arrange this with --rule translate")
        rule = recipe.repeat
    height, width = motif.pixels.shape[:2]
    if counts[0] * counts[1] * height * width > MAX_PATTERN:
        raise ts.OptionError(
            f"the sheet would have {counts[1] * width:,} × {counts[0] * height:,} px, {MAX_PATTERN:,} in all at most; ask for fewer motifs"
        )
    sheet = dataclasses.replace(
        motif,
        pixels=_tiled(motif.pixels, rule, counts),
        alpha=None if motif.alpha is None else _tiled(motif.alpha, rule, counts),
        xmp=None if settings is None or output.suffix.lower() in (".jpg", ".jpeg") else to_xmp(_sheet_settings(settings, counts)),
    )
    write_picture(output, sheet, force)
    if not quiet:
        height, width = sheet.pixels.shape[:2]
        click.echo(f"{output}: {width} × {height} px, {counts[0]} × {counts[1]} motifs by {rule}")


def _sheet_settings(settings: dict[str, Any], counts: tuple[int, int]) -> dict[str, Any]:
    """The settings of a motif for a sheet of it; a size in px of the motif becomes one of the sheet."""
    printed = Print(**{**Print.read(settings), "counts": counts})
    if printed.pixels is not None:
        printed = dataclasses.replace(printed, pixels=(printed.pixels[0] * counts[1], printed.pixels[1] * counts[0]))
    return {**settings, **printed.note()}


def _tiled(pixels: np.ndarray, rule: str, counts: tuple[int, int]) -> np.ndarray:
    if pixels.ndim == 2:
        return np.ascontiguousarray(tile(pixels, rule, counts))
    return np.ascontiguousarray(np.moveaxis(tile(np.moveaxis(pixels, 2, 0), rule, counts), 0, 2))
