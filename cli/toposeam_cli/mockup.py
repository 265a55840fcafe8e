"""``toposeam mockup``: a motif on a tie, a scarf, a shirt or a framed canvas."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

import toposeam as ts
from toposeam.motif.arrange import tile
from toposeam_cli.book_jobs import draw_on_product
from toposeam_cli.colour import to_depth, widen
from toposeam_cli.mockups import PRODUCTS, draw_product
from toposeam_cli.output import check_output
from toposeam_cli.parameters import FILE, OUTPUT, PaperLengthType
from toposeam_cli.picture import Picture, read_picture, write_picture
from toposeam_cli.recipe_file import read_settings


@click.command()
@click.argument("motif", type=FILE)
@click.option("--on", "product", type=click.Choice(list(PRODUCTS)), required=True, help="What the pattern is printed on.")
@click.option("-o", "--output", type=OUTPUT, required=True, help="The picture: .png, .tif, .jpg or .webp.")
@click.option("--motif-width", type=PaperLengthType(), help="Width of one motif on it, like 3cm; by default what is customary.")
@click.option("--rule", type=click.Choice(ts.REPEATS), help="For a picture without a recipe: the rule it repeats by.")
@click.option("--force", is_flag=True, help="Replace existing files.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def mockup(motif: Path, product: str, output: Path, motif_width: float | None, rule: str | None, force: bool, quiet: bool) -> None:
    """Show MOTIF on a product, to scale.

    \b
    toposeam mockup motif.png --on tie -o tie.png
    toposeam mockup motif.png --on scarf --motif-width 15cm -o scarf.png
    """  # noqa: D301 - click wants the character
    check_output(output, force)
    if motif_width is not None and not 2 <= motif_width <= 5000:
        raise ts.OptionError(f"--motif-width is {motif_width:g} mm; on a {product} use 2 mm to 5 m")
    if rule is None:
        read_settings(motif, ", or say with --rule how this repeats")
        draw_on_product(str(motif), product, str(output), motif_width, force)
    else:
        picture = read_picture(motif)
        pixels = to_depth(widen(picture.pixels), np.dtype(np.uint8))
        if picture.alpha is not None:  # printed on white
            opacity = to_depth(picture.alpha, np.dtype(np.float32))[..., np.newaxis]
            pixels = np.rint(opacity * pixels + (1 - opacity) * 255).astype(np.uint8)
        pattern = np.moveaxis(tile(np.moveaxis(pixels, 2, 0), rule, (2, 2)), 0, 2)
        drawn = draw_product(PRODUCTS[product], pattern, pixels.shape[1], np.ones(3), pixels.reshape(-1, 3).min(axis=0) / 255, motif_width)
        write_picture(output, Picture(pixels=drawn), force)
    if not quiet:
        width = PRODUCTS[product].motif_mm if motif_width is None else motif_width
        click.echo(f"{output}: {product}, one motif {width:g} mm wide")
