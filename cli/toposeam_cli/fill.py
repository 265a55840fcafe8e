"""``toposeam fill``: part of a picture replaced by what the rest of it is like."""

from __future__ import annotations

from pathlib import Path

import click

import toposeam as ts
from toposeam_cli.parameters import FILE, OUTPUT
from toposeam_cli.picture import read_white
from toposeam_cli.progress import share_bar
from toposeam_cli.texture_files import (
    Destinations,
    PatchType,
    map_outputs,
    read_maps,
    read_sources,
    result_options,
    search_options,
)  # fmt: skip


@click.command()
@click.argument("image", type=FILE)
@click.option("--mask", type=FILE, required=True, help="A picture of the same size, white where the picture is to be replaced.")
@click.option("-o", "--output", type=OUTPUT, required=True, help="The filled picture: .png, .tif, .jpg or .webp.")
@click.option("--patch", type=PatchType(), default="auto", show_default=True, help="Side of a patch, px; auto: by the picture's own scale.")
@click.option("--overlap", type=int, help="How far patches overlap, px; a quarter of the patch by default.")
@click.option("--band", type=int, help="Width of the band round the hole that may change as well, px; the overlap by default.")
@click.option("--allow", type=FILE, help="Copy only from where this picture is white.")
@search_options
@result_options
def fill(
    image: Path, mask: Path, output: Path, patch: int | None, overlap: int | None, band: int | None, allow: Path | None,
    also: tuple[Path, ...], weights: tuple[float, ...] | None, seed: int, tolerance: float, smooth: int, seams: Path | None,
    labels: Path | None, coordinates: Path | None, max_megapixels: float, force: bool, quiet: bool,
) -> None:  # fmt: skip
    """Replace part of IMAGE by what the rest of it is like.

    \b
    toposeam fill meadow.jpg --mask bin.png -o meadow_clean.png
    """  # noqa: D301 - click wants the character
    goes = Destinations(
        output=output, maps=map_outputs(output, also), seams=seams, labels=labels, coordinates=coordinates, force=force
    )  # fmt: skip
    picture = read_sources([image], max_megapixels)[0]
    maps = read_maps(also, 1, max_megapixels)
    shape = picture.pixels.shape[:2]
    hole = read_white(mask, shape, image.name, round(max_megapixels * 1e6))
    allowed = None if allow is None else read_white(allow, shape, image.name, round(max_megapixels * 1e6))
    with share_bar(f"filling {image.name}", quiet) as progress:
        made = ts.fill(
            picture.pixels, hole, patch, overlap, seed, band=band, alpha=picture.alpha, allow=allowed,
            maps=[given[0].pixels for given in maps], weights=weights, smooth=smooth, progress=progress, tolerance=tolerance,
        )  # fmt: skip
    goes.write(made, picture, [given[0] for given in maps])
    if not quiet:
        click.echo(f"{output}: {int(hole.sum())} px replaced by {made.count} patches")
