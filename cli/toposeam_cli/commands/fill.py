"""``toposeam fill``: part of a picture replaced by patches of the rest."""

from __future__ import annotations

import json
from pathlib import Path

import click
import numpy as np

import toposeam as ts
from toposeam.sentence import counted
from toposeam_cli.app.command import Command, option
from toposeam_cli.app.options import FILE, OUTPUT
from toposeam_cli.app.progress import say, share_bar
from toposeam_cli.media.pictures.masks import read_white
from toposeam_cli.textures.options import (
    Patches,
    Results,
    Search,
    patch_options,
    read_one,
    result_options,
    search_options,
    summary,
)


@click.command(
    cls=Command, everyday=["output", "box", "mask", "by", "patch", "level", "from", "avoid", "seed", "force"]
)
@click.argument("image", type=FILE)
@option(
    "--box",
    "boxes",
    heading="Hole",
    metavar="X,Y,W,H",
    multiple=True,
    help="Replace this box, px from the upper left corner; may be given several times.",
)
@option(
    "--mask",
    heading="Hole",
    type=FILE,
    help="Replace where this picture of the same size is white; or an ellipse:X,Y,W,H.",
)
@option(
    "-o",
    "--output",
    heading="Output",
    type=OUTPUT,
    required=True,
    help="The filled picture: .png, .tif, .jpg or .webp.",
)
@patch_options
@option(
    "--band",
    heading="Hole",
    type=int,
    help="Width of the band round the hole that may change too, px; by default the overlap, with shifts 8.",
)
@option(
    "--by",
    heading="Hole",
    type=click.Choice(ts.typing.BYS),
    default="auto",
    show_default=True,
    help="Continue a texture by patches, or stitch a photograph from shifted copies of itself.",
)
@option(
    "--level/--no-level",
    heading="Light",
    default=True,
    show_default=True,
    help="Level shifted copies so that light runs on; not for normals, heights or masks.",
)
@option(
    "--from",
    "source",
    heading="Hole",
    type=FILE,
    help="Copy only from where this picture is white, or a box:X,Y,W,H.",
)
@option(
    "--avoid",
    heading="Hole",
    type=FILE,
    help="Copy nothing from where this picture is white, or a box:X,Y,W,H.",
)
@search_options
@result_options
def fill(
    image: Path,
    boxes: tuple[str, ...],
    mask: Path | None,
    output: Path,
    patches: Patches,
    band: int | None,
    by: ts.typing.By,
    level: bool,
    source: Path | None,
    avoid: Path | None,
    search: Search,
    results: Results,
) -> None:
    """Replace part of IMAGE by what the rest of it is like.

    \b
    toposeam fill meadow.jpg --box 420,310,80,120 -o meadow_clean.png
    toposeam fill street.jpg --mask car.png --avoid faces.png -o street_clean.png
    """  # noqa: D301 - click wants the character
    if mask is None and not boxes:
        raise click.UsageError("Say what is to be replaced: --box X,Y,W,H, or --mask FILE")
    goes = results.destinations(output, search)
    picture, maps = read_one(image, search, results)
    goes.check([picture], maps)
    shape = picture.pixels.shape[:2]
    holes = [*(Path(f"box:{box}") for box in boxes), *([] if mask is None else [mask])]
    hole = np.any([read_white(each, shape, image.name, results.max_pixels) for each in holes], axis=0)
    copied, spared = (
        None if path is None else read_white(path, shape, image.name, results.max_pixels)
        for path in (source, avoid)
    )
    with share_bar(f"filling {image.name}", results.quiet) as progress:
        made = ts.fill(
            picture.pixels,
            hole,
            by=by,
            level=level,
            band=band,
            alpha=picture.alpha,
            source=copied,
            avoid=spared,
            progress=progress,
            **maps.keywords(picture, search.weights),
            **patches.keywords(),
            **search.keywords(),
        )
    goes.write(made, picture, maps)
    if results.as_json:
        say(json.dumps(summary(output, made), indent=2), lines=True)
    elif not results.quiet:
        pieces = counted(made.count, "patch" if made.settings["by"] == "patches" else "shift")
        say(f"{output}: {made.settings['pixels']} px replaced by {pieces}, {made.verdict}")
