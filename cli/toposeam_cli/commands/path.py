"""``toposeam path``: a way over a map of costs, planned by heat."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
import numpy as np

import toposeam as ts
from toposeam_cli.app.command import Command
from toposeam_cli.app.options import FILE, OUTPUT, FiniteRange, OffsetType, force_option, quiet_option
from toposeam_cli.app.progress import say, share_bar
from toposeam_cli.files.writing import atomic_write, check_output
from toposeam_cli.media.pictures.colour import to_depth
from toposeam_cli.media.pictures.picture import Picture, read_within, write_picture

if TYPE_CHECKING:
    from toposeam.path import PlannedPath

#: Largest map, pixels: the heat is solved in each of 70 iterations.
_MAX_PIXELS = 4_000_000
_SUFFIXES = (".svg", ".png", ".tif", ".tiff", ".jpg", ".jpeg", ".webp")


@click.command(cls=Command)
@click.argument("ground", metavar="MAP", type=FILE)
@click.option(
    "--from",
    "sources",
    type=OffsetType(),
    multiple=True,
    required=True,
    help="Where a way starts, in px; may be repeated.",
)
@click.option(
    "--to",
    "sinks",
    type=OffsetType(),
    multiple=True,
    required=True,
    help="Where ways may end; may be repeated.",
)
@click.option("--via", type=OffsetType(), multiple=True, help="A stopover; several are visited in order.")
@click.option(
    "--steepest",
    type=FiniteRange(1, 1e6),
    default=10.0,
    show_default=True,
    help="What a step through black costs; one through white costs 1.",
)
@click.option(
    "--wall",
    type=FiniteRange(0, 1),
    default=0.02,
    show_default=True,
    help="Pixels at most this bright are obstacles, 0 to 1; so are transparent ones.",
)
@click.option("-o", "--output", type=OUTPUT, help="The ways: .svg, or drawn on the map as .png, .tif, .jpg.")
@force_option
@quiet_option
def path(
    ground: Path,
    sources: tuple[tuple[int, int], ...],
    sinks: tuple[tuple[int, int], ...],
    via: tuple[tuple[int, int], ...],
    steepest: float,
    wall: float,
    output: Path | None,
    force: bool,
    quiet: bool,
) -> None:
    """Find a way over MAP by heat: easy where it is bright, blocked where it is black.

    \b
    toposeam path map.png --from 4,80 --to 130,80 -o way.svg
    toposeam path map.png --from 4,80 --via 60,10 --to 130,80 -o drawn.png
    """  # noqa: D301 - click wants the character
    if output is not None:
        check_output(output, force, _SUFFIXES)
    picture = read_within(ground, _MAX_PIXELS)
    brightness = _brightness(picture)
    cost = np.where(brightness > wall, steepest + (1 - steepest) * brightness, np.inf)
    with share_bar(f"leading heat over {ground.name}", quiet) as bar:
        found = ts.path(cost, sources, sinks, stopovers=via, progress=bar)
    if output is not None and output.suffix.lower() == ".svg":
        atomic_write(output, found.to_svg(), force)
    elif output is not None:
        write_picture(output, Picture(pixels=_drawn(brightness, found)), force)
    if not quiet:
        for line, price in zip(found.paths, found.costs, strict=True):
            begin, end = (",".join(f"{value:g}" for value in point - 0.5) for point in line.points[[0, -1]])
            points = len(line.points)
            say(f"{begin} to {end}: {line.length:.1f} px, cost {price:.1f}, {points} points")


def _brightness(picture: Picture) -> np.ndarray:
    """Return a picture's brightness, (H, W) float in [0, 1]; 0 where it is transparent."""
    from skimage.color import rgb2gray

    values = to_depth(picture.pixels, np.dtype(np.float32)).astype(np.float64)
    gray = rgb2gray(values) if values.ndim == 3 else values
    return gray if picture.alpha is None else np.where(picture.covered(), gray, 0.0)


def _drawn(brightness: np.ndarray, found: PlannedPath) -> np.ndarray:
    """Draw the ways on the map, in red on a white halo."""
    from PIL import Image, ImageDraw

    picture = Image.fromarray(np.rint(255 * np.clip(brightness, 0, 1)).astype(np.uint8)).convert("RGB")
    brush = ImageDraw.Draw(picture)
    wide = max(1, round(min(picture.size) / 300))
    for colour, width in (("white", 3 * wide), ("#d0021b", wide)):
        for line in found.paths:
            brush.line([tuple(point) for point in line.points - 0.5], fill=colour, width=width, joint="curve")
    return np.asarray(picture)
