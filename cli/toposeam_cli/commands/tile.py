"""``toposeam tile``: a picture made to repeat."""

from __future__ import annotations

import dataclasses
import json
from functools import partial
from pathlib import Path

import click

import toposeam as ts
from toposeam.sentence import counted
from toposeam_cli.app.command import Command, option
from toposeam_cli.app.options import FILE, OUTPUT
from toposeam_cli.app.progress import say, share_bar
from toposeam_cli.media.pictures.picture import Picture
from toposeam_cli.textures.maps import Maps, white_of
from toposeam_cli.textures.options import (
    Results,
    Search,
    read_one,
    result_options,
    search_options,
    summary,
    unfolded,
)

#: A bent picture is taken if its joints are seen this many times as much as those of the picture as it is.
_MUCH_BETTER = 0.6


@click.command(
    cls=Command,
    everyday=["output", "tileable", "band", "size", "level", "preview", "normal", "seams", "force"],
)
@click.argument("image", type=FILE)
@option(
    "-o",
    "--output",
    heading="Output",
    type=OUTPUT,
    required=True,
    help="The picture that repeats: .png, .tif, .jpg or .webp; a folder where IMAGE is a folder of maps.",
)
@option(
    "--band",
    heading="Texture",
    type=int,
    help="How many px along each border may change; by default an eighth of the shorter side, 48 at most, or "
    "more where elements are larger.",
)
@option(
    "--tileable",
    heading="Texture",
    type=click.Choice([name for name in ts.texture.TILEABLE if name != "none"]),
    default="both",
    show_default=True,
    help="The axes to repeat on.",
)
@option(
    "--size",
    heading="Texture",
    type=click.Choice(["auto", "keep"]),
    default="auto",
    show_default=True,
    help="auto: where an order is seen, crop to the largest size on which bricks, threads or lines close "
    "without being stretched, and where lines end in the band, bend by up to 8° and crop so that they go on; "
    "keep: never.",
)
@option("--flatten", heading="Light", is_flag=True, help="Take slow light out of IMAGE first.")
@option(
    "--level/--no-level",
    heading="Light",
    default=False,
    show_default=True,
    help="Take out the light by which opposite borders differ. Not for pictures of normals or heights.",
)
@option("--preview", heading="Output", type=OUTPUT, help="Also write the picture repeated 3 × 3.")
@search_options
@result_options
def tile(
    image: Path,
    output: Path,
    band: int | None,
    tileable: ts.texture.Tileable,
    size: str,
    flatten: bool,
    level: bool,
    preview: Path | None,
    search: Search,
    results: Results,
) -> None:
    """Make IMAGE repeat without a visible border, changing only a band along its borders.

    IMAGE may be a folder with the maps of a material, whose names end in _albedo, _normal, _height and so on.

    \b
    toposeam tile moss.jpg -o moss_tile.png --preview moss_3x3.png
    toposeam tile frieze.png --tileable x -o frieze_tile.png
    toposeam tile wall/ -o wall_tile    # all maps of a material
    """  # noqa: D301 - click wants the character
    (file,), search, material = unfolded([image], search)
    goes = results.destinations(output, search, preview, material=material)
    picture, maps = read_one(file, search, results)
    goes.check([picture], maps)
    fits = _closing_size(picture, tileable)
    cropped = size == "auto" and fits != picture.pixels.shape[:2]
    if cropped:
        picture, maps = _cropped(picture, fits), maps.changed(partial(_cropped, size=fits))
    with share_bar(f"closing {image.name}", results.quiet) as progress:

        def closed(picture: Picture, maps: Maps) -> ts.texture.Synthesis:
            return ts.tile(
                picture.pixels,
                band=band,
                tileable=tileable,
                flatten=flatten,
                level=level,
                alpha=picture.alpha,
                progress=progress,
                **maps.keywords(picture, search.weights),
                **search.keywords(),
            )

        made = closed(picture, maps)
        # a bend would turn the normals of a map
        bends = size == "auto" and not cropped and not maps.has_normal
        fit = _border_fit(picture, tileable, made) if bends else None
        if fit is not None:
            others = fit[0], maps.changed(partial(_bent, fit=fit[1], mixed=False))
            again = closed(*others)
            fit = fit if again.verdict.noticed <= _MUCH_BETTER * made.verdict.noticed else None
            if fit is not None:
                made, (picture, maps) = again, others
                fits = made.labels.shape
    goes.write(made, picture, maps)
    if results.as_json:
        say(json.dumps(summary(output, made), indent=2), lines=True)
    elif not results.quiet:
        height, width = made.labels.shape
        say(
            f"{output}: {width} × {height} px, {counted(made.count, 'patch')} in a band of "
            f"{made.settings['band']} px, {made.verdict}"
        )
        if fit is not None:
            say(f"bent by up to {fit[1].most:.0f} px so that its lines go on (--size keep: not)")
        elif cropped:
            say("cropped to where its order closes (--size keep: not)")
        elif fits != (height, width):
            say(
                f"its order does not close on this size; cropped to {fits[1]} × {fits[0]} px it does (--size "
                "auto)"
            )


def _border_fit(
    picture: Picture, tileable: ts.texture.Tileable, made: ts.texture.Synthesis
) -> tuple[Picture, ts.texture.BorderFit] | None:
    """Bend a picture so that its lines go on, if joints are seen in what has been made of it as it is."""
    if made.verdict.unseen or picture.alpha is not None:
        return None
    fit = ts.texture.fit_borders(picture.pixels, tileable=tileable, data_range=white_of(picture))
    return None if fit is None else (_bent(picture, fit=fit, mixed=True), fit)


def _bent(picture: Picture, fit: ts.texture.BorderFit, *, mixed: bool) -> Picture:
    return dataclasses.replace(picture, pixels=fit.apply(picture.pixels, mixed=mixed))


def _closing_size(picture: Picture, tileable: ts.texture.Tileable) -> tuple[int, int]:
    """Return the height and width within a picture at which its regular pattern closes."""
    return ts.texture.closing_size(
        picture.pixels,
        picture.pixels.shape[:2],
        tileable=tileable,
        within=True,
        alpha=picture.alpha,
        data_range=white_of(picture),
    )


def _cropped(picture: Picture, size: tuple[int, int]) -> Picture:
    """Return the middle of a picture."""
    rows, columns = (
        slice((length - kept) // 2, (length - kept) // 2 + kept)
        for length, kept in zip(picture.pixels.shape[:2], size, strict=True)
    )
    alpha = None if picture.alpha is None else picture.alpha[rows, columns]
    return dataclasses.replace(picture, pixels=picture.pixels[rows, columns], alpha=alpha)
