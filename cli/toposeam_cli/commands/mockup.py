"""``toposeam mockup``: a motif on a tie, a scarf, a cushion, a wall …"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

import toposeam as ts
from toposeam.motif.ink.stroke_edges import EDGES
from toposeam.motif.symmetry.tiling import period, tile
from toposeam_cli.app.command import Command
from toposeam_cli.app.options import FILE, OUTPUT, FiniteRange, PaperLengthType, force_option, quiet_option
from toposeam_cli.app.progress import say
from toposeam_cli.files.writing import check_output
from toposeam_cli.media.pictures.colour import to_depth, widen
from toposeam_cli.media.pictures.picture import MAX_MOTIF, read_within, write_picture
from toposeam_cli.motifs.book.patterns import draw_on_product, shown_at
from toposeam_cli.motifs.print_options import RepeatType, check_laid
from toposeam_cli.motifs.products import PRODUCTS, draw_product
from toposeam_cli.motifs.products import product as product_named
from toposeam_cli.motifs.recipe_files import read_settings


@click.command(cls=Command)
@click.argument("motif", type=FILE)
@click.option(
    "--on",
    "product",
    type=click.Choice(PRODUCTS),
    required=True,
    help="What the pattern is printed on.",
)
@click.option(
    "--second",
    type=FILE,
    help="Another motif: for the lining, collar, border, piping, ribbon, wainscot.",
)
@click.option("-o", "--output", type=OUTPUT, required=True, help="The picture: .png, .tif, .jpg or .webp.")
@click.option(
    "--motif-width",
    type=PaperLengthType(),
    help="Width of one motif on it, like 3cm; by default what is customary.",
)
@click.option(
    "--dpi",
    type=FiniteRange(1, 10_000),
    help="Pixels per inch of the thing itself.  [default: 1200 px along its longer side]",
)
@click.option(
    "--inks", type=click.IntRange(1), help="Simplify: keep this many inks, those with the most ink."
)
@click.option("--edge", type=click.Choice(EDGES), help="Sharpen, or soften: how all strokes end.")
@click.option(
    "--repeat",
    "rule",
    type=RepeatType(),
    help="For a picture without a recipe: the rule it repeats by.",
)
@force_option
@quiet_option
def mockup(
    motif: Path,
    product: str,
    second: Path | None,
    output: Path,
    motif_width: float | None,
    dpi: float | None,
    inks: int | None,
    edge: str | None,
    rule: str | None,
    force: bool,
    quiet: bool,
) -> None:
    """Show MOTIF on a product, to scale.

    \b
    toposeam mockup motif.png --on tie -o tie.png
    toposeam mockup motif.png --on scarf --motif-width 15cm -o scarf.png
    toposeam mockup motif.png --on shirt --second collar.png -o shirt.jpg
    toposeam mockup motif.png --on tie --inks 2 --edge crisp -o tie.png
    toposeam mockup motif.png --on phone --dpi 300 -o phone.tif
    """  # noqa: D301 - click wants the character
    check_output(output, force)
    if motif_width is not None and not 2 <= motif_width <= 5000:
        raise ts.OptionError(f"--motif-width is {motif_width:g} mm; on a {product} use 2 mm to 5 m")
    shown = product_named(product, dpi)
    if rule is None:
        read_settings(motif, ", or say with --repeat how this repeats")
        if second is not None:
            read_settings(second, "; a second pattern needs one")
        other = None if second is None else str(second)
        draw_on_product(str(motif), product, str(output), motif_width, force, other, inks, edge, dpi)
    elif inks is not None or edge is not None:
        raise ts.OptionError("--inks and --edge change a motif by its recipe; leave --repeat out")
    else:
        check_laid(motif, rule, "say --repeat translate, or make it so with toposeam repeat --cell")
        picture = read_within(motif, MAX_MOTIF)
        pixels = to_depth(widen(picture.pixels), np.dtype(np.uint8))
        if picture.alpha is not None:  # printed on white
            opacity = to_depth(picture.alpha, np.dtype(np.float32))[..., np.newaxis]
            pixels = np.rint(opacity * pixels + (1 - opacity) * 255).astype(np.uint8)
        pattern = np.moveaxis(tile(np.moveaxis(pixels, 2, 0), rule, period(rule)), 0, 2)
        drawn = draw_product(
            product,
            pattern,
            pixels.shape[1],
            np.ones(3),
            pixels.reshape(-1, 3).min(axis=0) / 255,
            motif_width,
            dpi=dpi,
        )
        write_picture(output, shown_at(drawn, dpi), force)
    if not quiet:
        width = shown.motif_mm if motif_width is None else motif_width
        say(f"{output}: {product}, one motif {width:g} mm wide")
