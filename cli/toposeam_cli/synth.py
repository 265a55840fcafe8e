"""``toposeam synth``: a large texture from small samples."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import click
import numpy as np

import toposeam as ts
from toposeam.images import full_scale
from toposeam_cli.parameters import FILE, OUTPUT, FiniteRange
from toposeam_cli.picture import read_picture, read_white, write_picture
from toposeam_cli.progress import share_bar
from toposeam_cli.texture_files import (
    BORDERS,
    Destinations,
    PatchType,
    SizeType,
    alphas,
    map_outputs,
    read_maps,
    read_sources,
    result_options,
    search_options,
)  # fmt: skip


@click.command()
@click.argument("sources", metavar="SOURCE...", type=FILE, nargs=-1, required=True)
@click.option("--size", type=SizeType(), help="Width and height of the texture, px; one number for a square.")
@click.option("-o", "--output", type=OUTPUT, required=True, help="The texture: .png, .tif, .jpg or .webp.")
@click.option("--patch", type=PatchType(), default="40", show_default=True, help="Side of a patch, px; auto: by the texture's own scale.")
@click.option("--overlap", type=int, help="How far patches overlap, px; a quarter of the patch by default.")
@click.option("--tileable", type=click.Choice(list(BORDERS)), help="The texture repeats along these axes.")
@click.option("--mask", type=FILE, multiple=True, help="Sample only where this picture is white; once per source.")
@click.option("--guide", type=FILE, help="What the texture should look like, a picture of its size; needs --guide-source.")
@click.option("--guide-source", type=FILE, multiple=True, help="What the source looks like in the guide's terms; once per source.")
@click.option("--guide-weight", type=FiniteRange(0, 1), default=0.5, show_default=True, help="How much the guide counts.")
@click.option("--use-coordinates", type=FILE, help="Cut SOURCE as another texture was cut: what its --coordinates wrote.")
@search_options
@result_options
def synth(
    sources: tuple[Path, ...], size: tuple[int, int] | None, output: Path, patch: int | None, overlap: int | None, tileable: str | None,
    mask: tuple[Path, ...], guide: Path | None, guide_source: tuple[Path, ...], guide_weight: float,
    use_coordinates: Path | None, also: tuple[Path, ...], weights: tuple[float, ...] | None, seed: int, tolerance: float, smooth: int,
    seams: Path | None, labels: Path | None, coordinates: Path | None, max_megapixels: float, force: bool, quiet: bool,
) -> None:  # fmt: skip
    """Grow a large texture from a small SOURCE, or from several.

    \b
    toposeam synth moss.png --size 2048x1024 --tileable both -o moss_large.png
    toposeam synth wall.png --also wall_normal.png --size 1024 -o large.png
    """  # noqa: D301 - click wants the character
    if (size is None) == (use_coordinates is None):
        raise ts.OptionError("say how large the texture is with --size, or give the coordinates of another one with --use-coordinates")
    if size is None or use_coordinates is not None:
        _cut_alike(sources, output, use_coordinates, BORDERS[tileable] if tileable else False, smooth, max_megapixels, force)
        return
    count = len(sources)
    maps_out = map_outputs(output, also[::count])
    goes = Destinations(output=output, maps=maps_out, seams=seams, labels=labels, coordinates=coordinates, force=force)
    if mask and len(mask) != count:
        raise ts.OptionError(f"--mask was given {len(mask)} times for {count} sources; give one for each, in their order")
    if (guide is None) != (not guide_source):
        raise ts.OptionError("--guide and --guide-source belong together: what is wanted, and what the source stands for; give both")
    pictures = read_sources(sources, max_megapixels)
    maps = read_maps(also, count, max_megapixels)
    limit = round(max_megapixels * 1e6)
    shapes = [picture.pixels.shape[:2] for picture in pictures]
    allowed = [
        read_white(path, shape, source.name, round(max_megapixels * 1e6))
        for path, shape, source in zip(mask, shapes, sources, strict=False)
    ]
    wanted = None if guide is None else read_picture(guide, max_pixels=limit).pixels
    stands = [read_picture(path, max_pixels=limit).pixels for path in guide_source]
    with share_bar(f"growing {output.name}", quiet) as progress:
        made = ts.synthesize(
            [picture.pixels for picture in pictures], size, patch, overlap, seed, BORDERS[tileable] if tileable else False,
            alpha=alphas(pictures), mask=allowed or None, maps=[[one.pixels for one in given] for given in maps], weights=weights,
            guide=wanted, guide_source=stands or None, guide_weight=guide_weight, smooth=smooth, max_pixels=limit, progress=progress,
            tolerance=tolerance,
        )  # fmt: skip
    goes.write(made, pictures[0], [given[0] for given in maps])
    if not quiet:
        click.echo(f"{output}: {size[1]} × {size[0]} px, {made.count} patches of {made.patch[1]} × {made.patch[0]} px")


def _cut_alike(
    sources: tuple[Path, ...],
    output: Path,
    coordinates: Path | None,
    tileable: ts.Tileable,
    smooth: int,
    max_megapixels: float,
    force: bool,
) -> None:
    """Other pictures, cut as a texture was cut before."""
    goes = Destinations(output=output, force=force)
    pictures = read_sources(sources, max_megapixels)
    given = read_picture(coordinates or Path(), max_pixels=round(max_megapixels * 1e6)).pixels
    if given.ndim != 3 or given.dtype != np.uint16:
        raise ts.ImageError(f"{coordinates} holds no coordinates; give the 16-bit RGB picture that --coordinates wrote")
    column, row, exemplar = np.moveaxis(given.astype(np.int32), 2, 0)
    place = np.stack([row, column], axis=2)
    options: dict[str, Any] = {"wraps": (tileable in (True, "y"), tileable in (True, "x")), "smooth": smooth}
    made = ts.apply_coordinates([picture.pixels for picture in pictures], place, exemplar, **options)
    opacity = None
    if alphas(pictures) is not None:
        full = [np.full(one.pixels.shape[:2], full_scale(one.pixels.dtype)) if one.alpha is None else one.alpha for one in pictures]
        opacity = ts.apply_coordinates(full, place, exemplar, **options)
    write_picture(goes.output, dataclasses.replace(pictures[0], pixels=made, alpha=opacity), force)
