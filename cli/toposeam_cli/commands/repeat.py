"""``toposeam repeat``: a sheet of motifs, or of any picture, side by side by a rule."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np

import toposeam as ts
from toposeam.motif.ink.printing import MAX_PATTERN
from toposeam.motif.symmetry.kaleidoscope import GROUPS
from toposeam.motif.symmetry.tiling import tile
from toposeam_cli.app.command import Command
from toposeam_cli.app.options import FILE, OUTPUT, OffsetType, PairType, force_option, quiet_option
from toposeam_cli.app.progress import say, share_bar
from toposeam_cli.files.writing import check_output
from toposeam_cli.media.pictures.colour import to_depth
from toposeam_cli.media.pictures.picture import MAX_MOTIF, Picture, read_within, write_picture
from toposeam_cli.motifs.print_options import (
    PrintOptions,
    RepeatType,
    check_laid,
    check_print,
    print_options,
    write_print,
)
from toposeam_cli.motifs.printing import SUFFIXES, Print, describe, ink_names, sheet_coverage
from toposeam_cli.motifs.recipe_files import read_recipe, read_settings, to_xmp


@click.command(cls=Command)
@click.argument("picture", metavar="MOTIF", type=FILE)
@click.argument("counts", metavar="COLUMNSxROWS", type=PairType(cells=True))
@click.option(
    "-o", "--output", type=OUTPUT, required=True, help="The sheet: .png, .tif, .jpg, .webp or .svg."
)
@click.option(
    "--repeat",
    "rule",
    type=RepeatType(),
    help="How any picture is arranged; also 'drop 1/3', 'brick 1/4'.  [default: as the motif was made for]",
)
@click.option(
    "--cell",
    type=PairType(),
    help="Make a kaleidoscope of a picture: WIDTHxHEIGHT of the cell of the wallpaper group --repeat.",
)
@click.option("--at", type=OffsetType(), help="With --cell: what of the picture is in the middle.")
@print_options
@force_option
@quiet_option
def repeat(
    picture: Path,
    counts: tuple[int, int],
    output: Path,
    rule: str | None,
    cell: tuple[int, int] | None,
    at: tuple[int, int] | None,
    ink: PrintOptions,
    force: bool,
    quiet: bool,
) -> None:
    """Lay a motif side by side, mirrored or turned where its rule says so.

    \b
    toposeam repeat motif.png 8x8 -o sheet.png
    toposeam repeat motif.png 4x4 -o sheet.tif --motif-width 60mm --separations
    toposeam repeat photograph.jpg 3x3 -o kaleidoscope.png --repeat p6m --cell 400

    With any of the options of ink, and for an .svg, a motif is drawn from the recipe in it; pictures are
    copied pixel by pixel.
    """  # noqa: D301 - click wants the character
    drawn = output.suffix.lower() == ".svg"
    check_output(output, force, (*SUFFIXES, ".jpg", ".jpeg", ".webp"))
    if cell is None and at is not None:
        raise ts.OptionError("--at says what is in the middle of a kaleidoscope; give --cell too")
    if picture.suffix.lower() == ".svg" and not drawn and ink == PrintOptions():
        raise ts.OptionError(
            f"'{picture}' is a drawing, so its sheet is one; write it to a .svg, or say with --motif-width "
            "how wide a motif is on paper"
        )
    if drawn or ink != PrintOptions():
        if cell is not None:
            raise ts.OptionError(
                "a kaleidoscope is copied pixel by pixel; leave out the options of ink, and .svg"
            )
        extent, rule = _inked(picture, counts[::-1], output, rule, ink, force, quiet)
    else:
        sheet, rule = _copied(picture, counts[::-1], output, rule, cell, at, quiet)
        write_picture(output, sheet, force)
        height, width = sheet.pixels.shape[:2]
        extent = f"{width} × {height} px, {counts[0]} × {counts[1]} motifs by {rule}"
    if not quiet:
        say(f"{output}: {extent}")


def _inked(
    path: Path,
    counts: tuple[int, int],
    output: Path,
    rule: str | None,
    ink: PrintOptions,
    force: bool,
    quiet: bool,
) -> tuple[str, str]:
    """Return a sheet drawn from the recipe in a motif."""
    recipe = read_recipe(path)
    if rule is not None and rule != recipe.repeat:
        raise ts.OptionError(
            f"what is drawn from a recipe repeats by the motif's own rule, {recipe.repeat}; leave --repeat "
            "out, or the options of ink"
        )
    paper = ink.over({}, counts=counts)
    paper.check(recipe, output.suffix.lower() == ".svg")
    check_print(output, ink_names(recipe), ink, force)
    with share_bar(f"drawing {output.name}", quiet) as bar:
        made = ts.motif(recipe, progress=bar)
    extent = write_print(output, made, lambda: sheet_coverage(made, paper), paper, ink, force)
    return f"{extent}, {describe(made, counts)}", recipe.repeat


def _copied(
    path: Path,
    counts: tuple[int, int],
    output: Path,
    rule: str | None,
    cell: tuple[int, int] | None,
    at: tuple[int, int] | None,
    quiet: bool,
) -> tuple[Picture, str]:
    """Return a sheet of copies of a picture, and the rule by which it is laid."""
    settings = None
    if cell is None and rule is None:
        settings = read_settings(path, ", or say how to arrange this with --repeat")
    if cell is not None and counts[0] * counts[1] * cell[0] * cell[1] > MAX_PATTERN:
        raise ts.OptionError(
            f"the sheet would have {counts[1] * cell[0]:,} × {counts[0] * cell[1]:,} px, {MAX_PATTERN:,} in "
            "all at most; ask for fewer motifs, or smaller ones with --cell"
        )
    motif = read_within(path, MAX_MOTIF)
    if cell is not None:
        if rule not in GROUPS:
            raise ts.OptionError(
                f"a kaleidoscope shows a wallpaper group; give one with --repeat: {', '.join(GROUPS)}"
            )
        shown, rule = f"a kaleidoscope by {rule}", rule
        with share_bar(f"drawing {output.name}", quiet) as bar:
            motif = _kaleidoscope(motif, rule, cell, at, bar)
    elif rule is None:
        recipe = read_recipe(path)
        if settings is not None and Print(**Print.read(settings)).laid(recipe) != (
            (1, 1),
            motif.pixels.shape[:2],
        ):
            raise ts.OptionError(
                f"'{path}' is not one whole motif; give one, or say how to arrange this with --repeat "
                "translate"
            )
        shown = rule = recipe.repeat
    else:
        check_laid(path, rule, "make a kaleidoscope of it with --cell, or say --repeat translate")
        shown = rule
    height, width = motif.pixels.shape[:2]
    if counts[0] * counts[1] * height * width > MAX_PATTERN:
        raise ts.OptionError(
            f"the sheet would have {counts[1] * width:,} × {counts[0] * height:,} px, {MAX_PATTERN:,} in all "
            "at most; ask for fewer motifs"
        )
    sheet = dataclasses.replace(
        motif,
        pixels=_tiled(motif.pixels, rule, counts),
        alpha=None if motif.alpha is None else _tiled(motif.alpha, rule, counts),
        xmp=None
        if settings is None or output.suffix.lower() in (".jpg", ".jpeg")
        else to_xmp(_sheet_settings(settings, counts)),
    )
    return sheet, shown


def _kaleidoscope(
    motif: Picture,
    rule: str,
    cell: tuple[int, int],
    at: tuple[int, int] | None,
    progress: Callable[[float], None] | None,
) -> Picture:
    """Return the picture's cell of a wallpaper group, opacity and all."""
    planes = [np.atleast_3d(to_depth(motif.pixels, np.dtype(np.float32)))]
    if motif.alpha is not None:
        planes.append(to_depth(motif.alpha, np.dtype(np.float32))[..., np.newaxis])
    every = np.concatenate(planes, axis=2)
    shown = ts.motif.kaleidoscope(every, rule, cell[::-1], at=at, progress=progress)
    colours = planes[0].shape[2]
    pixels = to_depth(shown[..., :colours], motif.pixels.dtype)
    return dataclasses.replace(
        motif,
        pixels=np.ascontiguousarray(pixels[..., 0] if motif.pixels.ndim == 2 else pixels),
        alpha=None
        if motif.alpha is None
        else np.ascontiguousarray(to_depth(shown[..., -1], motif.alpha.dtype)),
    )


def _sheet_settings(settings: dict[str, Any], counts: tuple[int, int]) -> dict[str, Any]:
    """Return the print settings for a sheet of a motif; its size in px becomes that of the sheet."""
    printed = Print(**{**Print.read(settings), "counts": counts})
    if printed.pixels is not None:
        printed = dataclasses.replace(
            printed, pixels=(printed.pixels[0] * counts[1], printed.pixels[1] * counts[0])
        )
    return {**settings, **printed.note()}


def _tiled(pixels: np.ndarray, rule: str, counts: tuple[int, int]) -> np.ndarray:
    if pixels.ndim == 2:
        return np.ascontiguousarray(tile(pixels, rule, counts))
    return np.ascontiguousarray(np.moveaxis(tile(np.moveaxis(pixels, 2, 0), rule, counts), 0, 2))
