"""``toposeam enblend``: what Hugin and scripts ask enblend for."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

import toposeam as ts
from toposeam.layers.canvas.layer import Box
from toposeam.layers.composite.stitching import composed_of_masks
from toposeam_cli.app.options import OUTPUT
from toposeam_cli.app.progress import say, share_bar
from toposeam_cli.files.scratch import scratch
from toposeam_cli.files.writing import all_or_nothing, check_output
from toposeam_cli.media.pictures.masks import read_white
from toposeam_cli.media.pictures.picture import Picture, write_picture
from toposeam_cli.stitching.enblend_line import (
    VERSION,
    CanvasFrame,
    blend_width,
    compression_of,
    files_of,
    frame_of,
    mask_name,
    understood,
    wrap_of,
)
from toposeam_cli.stitching.inputs import PlacedPictures, arrange, sparse_megapixels
from toposeam_cli.stitching.outputs import Outputs
from toposeam_cli.stitching.positions import Where
from toposeam_cli.stitching.rendering import render, write
from toposeam_cli.stitching.report import hidden

#: A result of more pixels is refused, as by ``stitch --max-megapixels``; a panorama has a frame.
_MAX_MEGAPIXELS = 4000.0


class _Words(click.Command):
    """Reads enblend's command line."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Take out what does not matter, and say so."""
        words, ignored = understood(args)
        for option in dict.fromkeys(ignored):
            say(f"warning: {option} means nothing here and is left out", err=True)
        return super().parse_args(ctx, words)


@click.command(cls=_Words)
@click.argument("words", metavar="INPUT...", nargs=-1, required=True)
@click.option("-o", "--output", type=OUTPUT, default=Path("a.tif"), show_default=True, help="The panorama.")
@click.option("-f", "--frame", metavar="WxH+X+Y", help="Size and place of the result.")
@click.option("-w", "--wrap", metavar="MODE", default="none", help="horizontal: it goes all the way round.")
@click.option("-l", "--levels", default="auto", help="Blend over 2 to the power of LEVELS px; auto is 32 px.")
@click.option("--compression", default="lzw", help="Of .tif: none, lzw, deflate. Of .jpg: 0 to 100.")
@click.option("--save-masks", metavar="TEMPLATE", help="Also write where each picture shows, as mask-%n.tif.")
@click.option("--load-masks", metavar="TEMPLATE", help="Show each picture where its mask is white.")
@click.version_option(VERSION, message="%(version)s")
def enblend(words: tuple[str, ...], **given: Any) -> None:
    """Blend pictures that Hugin's nona has placed: in enblend's place, with its options.

    Options that change nothing here are left out with a warning. An existing output is replaced.
    """
    files = files_of(words)
    output: Path = given["output"]
    compression, quality = compression_of(given["compression"])
    jpeg = output.suffix.lower() in (".jpg", ".jpeg")
    check_output(output, True)
    made = [output]
    if given["save_masks"] is not None:
        made += [mask_name(given["save_masks"], index, file, output) for index, file in enumerate(files)]
    for name in made:
        if any(name.exists() and file.exists() and name.samefile(file) for file in files):
            raise ts.OptionError(
                f"'{name}' is one of the pictures to be blended; give the output another name"
            )
    out = Outputs(
        output=output,
        crop="outside",
        fill_edges=None,
        background="black" if jpeg else None,
        quality=quality if jpeg else None,
        compression=compression if output.suffix.lower() in (".tif", ".tiff") else None,
        pyramid=False,
        seam=None,
        labels=None,
        overlay=None,
        history=None,
        save_layout=None,
        report=None,
        as_json=False,
        force=True,
        quiet=False,
    )
    with scratch(output.parent) as files_of_pixels, share_bar("blending", False) as progress:
        job = arrange(files, Where(), max_megapixels=_MAX_MEGAPIXELS, scratch=files_of_pixels, alone=True)
        frame = _frame(job, given["frame"])
        layers = [_moved(layer, frame) for layer in job.layers]
        options: dict[str, Any] = {
            "blend": "multiband",
            "blend_width": blend_width(given["levels"]),
            "wrap": frame.width if wrap_of(given["wrap"]) else None,
        }
        shape = frame.height, frame.width
        if given["load_masks"] is not None or len(layers) == 1:
            masks = None if given["load_masks"] is None else _masks(given["load_masks"], files, output, shape)
            whole = composed_of_masks(layers, masks, shape, **options)
        else:
            whole = ts.stitch(layers, max_megapixels=_MAX_MEGAPIXELS, **options)
        left, top = (-edge for edge in whole.origin)
        composed = whole.crop(Box(top, left, top + frame.height, left + frame.width))
        with all_or_nothing():
            rendered = render(composed, job, out, "outside", files_of_pixels, progress)
            if given["save_masks"] is not None:
                for index, file in enumerate(files):
                    name = mask_name(given["save_masks"], index, file, output)
                    shows = composed.labels(slice(0, frame.height), slice(0, frame.width)) == index
                    write_picture(name, Picture(pixels=shows.astype(np.uint8) * np.uint8(255)), True)
            write(out, job, rendered, {}, files_of_pixels)
    if given["load_masks"] is None:
        for warning in hidden(whole, "mask the others in Hugin where one is to show"):
            say(f"warning: {warning}", err=True)


def _moved(layer: ts.Layer, frame: CanvasFrame) -> ts.Layer:
    return dataclasses.replace(layer, at=(layer.at[0] - frame.x, layer.at[1] - frame.y))


def _frame(job: PlacedPictures, text: str | None) -> CanvasFrame:
    if text is not None:
        frame = frame_of(text)
        if frame.width * frame.height > _MAX_MEGAPIXELS * 1e6:
            raise ts.OptionError(
                f"-f {text} is {frame.width} x {frame.height} pixels, more than "
                f"{_MAX_MEGAPIXELS:g} megapixels; make the frame smaller"
            )
        return frame
    most = sparse_megapixels(_MAX_MEGAPIXELS, sum(math.prod(layer.image.shape[:2]) for layer in job.layers))
    try:
        canvas = ts.layers.common_canvas(job.layers, max_megapixels=most)
    except ts.OptionError as error:
        raise error.within("{error}, or give the frame, as -f WIDTHxHEIGHT") from None
    return CanvasFrame(canvas.shape[1], canvas.shape[0], *canvas.origin)


def _masks(template: str, files: Sequence[Path], output: Path, shape: tuple[int, int]) -> list[np.ndarray]:
    names = [mask_name(template, index, file, output) for index, file in enumerate(files)]
    return [read_white(name, shape, "the panorama", round(_MAX_MEGAPIXELS * 1e6)) for name in names]
