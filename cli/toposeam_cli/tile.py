"""``toposeam tile``: a picture made to repeat."""

from __future__ import annotations

from pathlib import Path

import click

import toposeam as ts
from toposeam_cli.parameters import FILE, OUTPUT
from toposeam_cli.progress import share_bar
from toposeam_cli.texture_files import BORDERS, Destinations, map_outputs, read_maps, read_sources, result_options, search_options


@click.command()
@click.argument("image", type=FILE)
@click.option("-o", "--output", type=OUTPUT, required=True, help="The picture that repeats: .png, .tif, .jpg or .webp.")
@click.option("--band", type=int, help="How many px along each border may change; an eighth of the shorter side by default, 48 at most.")
@click.option("--tileable", type=click.Choice(list(BORDERS)), default="both", show_default=True, help="The axes to repeat on.")
@click.option("--preview", type=OUTPUT, help="Also write the picture repeated 3 × 3.")
@search_options
@result_options
def tile(
    image: Path, output: Path, band: int | None, tileable: str, preview: Path | None, also: tuple[Path, ...],
    weights: tuple[float, ...] | None, seed: int, tolerance: float, smooth: int, seams: Path | None, labels: Path | None,
    coordinates: Path | None, max_megapixels: float, force: bool, quiet: bool,
) -> None:  # fmt: skip
    """Make IMAGE repeat without a visible border, changing only a band along its borders.

    \b
    toposeam tile moss.jpg -o moss_tile.png --preview moss_3x3.png
    toposeam tile frieze.png --tileable x -o frieze_tile.png
    """  # noqa: D301 - click wants the character
    goes = Destinations(
        output=output, maps=map_outputs(output, also), seams=seams, labels=labels, coordinates=coordinates, preview=preview, force=force,
    )  # fmt: skip
    picture = read_sources([image], max_megapixels)[0]
    maps = read_maps(also, 1, max_megapixels)
    with share_bar(f"closing {image.name}", quiet) as progress:
        made = ts.make_tileable(
            picture.pixels, band, seed, BORDERS[tileable], alpha=picture.alpha, maps=[given[0].pixels for given in maps], weights=weights,
            smooth=smooth, progress=progress, tolerance=tolerance,
        )  # fmt: skip
    goes.write(made, picture, [given[0] for given in maps])
    if not quiet:
        height, width = made.labels.shape
        click.echo(f"{output}: {width} × {height} px, {made.count} patches in a band of {made.settings['band']} px")
