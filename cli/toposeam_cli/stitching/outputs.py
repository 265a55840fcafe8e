"""Output of a composite: its formats, cropping, background, and files that belong to it."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import toposeam as ts
from toposeam_cli.app.command import option
from toposeam_cli.app.options import OUTPUT
from toposeam_cli.figures.search import SUFFIXES as SEARCH_SUFFIXES
from toposeam_cli.files.regular import real_path
from toposeam_cli.files.writing import COMPRESSIONS, PICTURE_SUFFIXES, check_output

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from toposeam.arrays import Mask
    from toposeam.layers.canvas.layer import Box
    from toposeam_cli.media.pictures.picture import Keep, Picture

#: What is kept of a joined picture.
CROPS = ("fit", "inside", "outside")
#: Formats that know no transparency.
OPAQUE = (".jpg", ".jpeg")
_BOX = re.compile(",".join([r"\s*(\d{1,9})\s*"] * 4))


def parse_crop(value: str) -> str:
    """Return a word of :data:`CROPS`, or ``X,Y,W,H``, a box of what ``outside`` writes, px."""
    word = value.strip().lower()
    if word in CROPS:
        return word
    match = _BOX.fullmatch(word)
    if match is None or not int(match[3]) or not int(match[4]):
        raise click.BadParameter(
            f"{value!r} is no crop; write {', '.join(CROPS)}, or a box like 40,0,3000,2000"
        )
    return ",".join(str(int(number)) for number in match.groups())


def output_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of outputs: files, formats and cropping."""
    options = (
        option(
            "-o",
            "--output",
            heading="Output",
            type=OUTPUT,
            required=True,
            help="The joined picture: .png, .tif, .jpg, .webp or .dzi; .ora keeps the layers.",
        ),
        option(
            "--save-layout",
            heading="Output",
            type=OUTPUT,
            help="Also write the whole work as a layout (.toml), which makes the same picture again, or its "
            "places for Hugin (.pto).",
        ),
        option(
            "--report",
            heading="Output",
            type=OUTPUT,
            help="Also write a page (.html): the picture with its seams, before and after, what each "
            "seam costs.",
        ),
        option(
            "--contact",
            heading="Output",
            type=OUTPUT,
            help="Also write all panoramas small on one sheet (.jpg, .png), each with its line.",
        ),
        option(
            "--skip-bad",
            heading="Output",
            is_flag=True,
            help="Leave out pictures that cannot be read, and name them.",
        ),
        option(
            "--seam",
            heading="Output",
            type=OUTPUT,
            help="Also write the seams as SVG; edit them and give them back with --use-seam.",
        ),
        option(
            "--crop",
            heading="Output",
            kept=True,
            type=parse_crop,
            metavar=f"[{'|'.join(CROPS)}|X,Y,W,H]",
            help="fit: bend the boundary a little, fill slivers and keep most of it, the default of "
            "photographs; inside: the largest rectangle without holes, that of formats without transparency; "
            "outside: all of it; X,Y,W,H: this box of it, px.",
        ),
        option(
            "--fill-edges",
            heading="Output",
            kept=True,
            type=click.IntRange(1, 1000),
            metavar="PX",
            help="Crop to what lies within PX pixels of the pictures, and fill there what none of them "
            "shows.",
        ),
        option(
            "--background",
            heading="Output",
            kept=True,
            metavar="COLOUR",
            help="Fill holes with a colour, like white or #20304a.",
        ),
        option(
            "--quality",
            heading="Output",
            kept=True,
            type=click.IntRange(1, 100),
            help="Of .jpg; 95 by default.",
        ),
        option(
            "--compression",
            heading="Output",
            kept=True,
            type=click.Choice(COMPRESSIONS),
            help="Of .tif; deflate by default.",
        ),
        option(
            "--pyramid",
            heading="Output",
            kept=True,
            is_flag=True,
            help="Write .tif in tiles and at every size; .dzi always is.",
        ),
        option(
            "--labels",
            heading="Output",
            type=OUTPUT,
            help="Also write which picture shows where: black for A, white for the last, grays between.",
        ),
        option(
            "--overlay",
            heading="Output",
            type=OUTPUT,
            help="Also write the joined picture with the seams drawn over it.",
        ),
        option(
            "--history",
            heading="Output",
            type=OUTPUT,
            help="For two pictures: find the seam by heat, and also write how it converged: a figure "
            "(.png, .svg, "
            ".pdf), or an animation (.gif, .webp).",
        ),
        option(
            "--json",
            "as_json",
            heading="Output",
            is_flag=True,
            help="Print costs, optima, ratios, stages, iterations and seconds as JSON.",
        ),
        option(
            "-v",
            "--verbose",
            heading="Output",
            is_flag=True,
            help="Also print how pictures were placed, and method, length, cost and time of the seams.",
        ),
    )
    for each in reversed(options):
        command = each(command)
    return command


@dataclass(frozen=True, slots=True, kw_only=True)
class Outputs:
    """Options of the output."""

    output: Path
    crop: str | None
    fill_edges: int | None
    background: str | None
    quality: int | None
    compression: str | None
    pyramid: bool
    seam: Path | None
    labels: Path | None
    overlay: Path | None
    history: Path | None
    save_layout: Path | None
    report: Path | None
    as_json: bool
    force: bool
    quiet: bool
    verbose: bool = False
    contact: Path | None = None

    @property
    def has_alpha(self) -> bool:
        """True if the picture's format knows transparency."""
        return self.output.suffix.lower() not in OPAQUE


def outputs_of(out: Outputs) -> list[Path]:
    """List the files that are to be written."""
    values = (getattr(out, field.name) for field in dataclasses.fields(out))
    return [path for path in values if isinstance(path, Path)]


def numbered(out: Outputs, number: int) -> Outputs:
    """Return the same outputs for a group of pictures, with the group's number at the end of their names."""
    paths: dict[str, Any] = {
        field.name: path.with_stem(f"{path.stem}-{number}")
        for field in dataclasses.fields(out)
        if field.name != "contact" and isinstance(path := getattr(out, field.name), Path)
    }
    return dataclasses.replace(out, **paths)


def write_composite(out: Outputs, picture: Picture, keep: Keep | None = None) -> None:
    """Write the joined picture; `keep` is as for :func:`match_pictures`."""
    if out.output.suffix.lower() == ".dzi":
        from toposeam_cli.media.pictures.deep_zoom import write_deep_zoom

        write_deep_zoom(out.output, picture, out.force, out.quality, keep)
        return
    from toposeam_cli.media.pictures.picture import write_picture

    options: dict[str, Any] = {"quality": out.quality, "compression": out.compression, "pyramid": out.pyramid}
    write_picture(out.output, picture, out.force, keep=keep, **options)


def check_outputs(out: Outputs) -> None:
    """Refuse outputs that cannot be written, before any work is done for them."""
    suffix = out.output.suffix.lower()
    check_output(out.output, out.force, (*PICTURE_SUFFIXES, ".ora", ".dzi"))
    if suffix == ".dzi":
        from toposeam_cli.media.pictures.deep_zoom import check_deep_zoom

        check_deep_zoom(out.output, out.force)
    for path, suffixes in (
        (out.seam, (".svg",)),
        (out.history, SEARCH_SUFFIXES),
        (out.save_layout, (".toml", ".pto")),
        (out.report, (".html",)),
        (out.contact, (".jpg", ".jpeg", ".png")),
    ):
        if path is not None:
            check_output(path, out.force, suffixes)
    for path in (out.labels, out.overlay):
        if path is not None:
            check_output(path, out.force)
    given = list(map(real_path, outputs_of(out)))
    if len(set(given)) < len(given):
        raise ts.OptionError("two outputs have the same name; give each a name of its own")
    if suffix == ".ora" and (out.crop is not None or out.background is not None):
        raise ts.OptionError("--crop and --background are for pictures; an .ora file keeps all of the layers")
    if suffix in (".ora", ".dzi") and out.contact is not None:
        raise ts.OptionError(
            f"--contact shows pictures in one file, not {suffix}; write .png or .tif, or leave it out"
        )
    if out.fill_edges is not None:
        if out.crop == "fit":
            raise ts.OptionError(
                "--crop fit fills what it needs, and --fill-edges says how far; leave one out"
            )
        kept = {".ora": suffix == ".ora", "--background": out.background is not None}
        kept[f"--crop {out.crop}"] = out.crop not in (None, "inside")
        for name in (name for name, given in kept.items() if given):
            raise ts.OptionError(f"--fill-edges leaves no holes, and {name} keeps them; leave one out")
    foreign = foreign_to(suffix)
    if out.pyramid and "pyramid" in foreign:
        raise ts.OptionError(f"--pyramid is for .tif, not for {suffix}; leave it out, or write .tif or .dzi")
    if out.quality is not None and "quality" in foreign:
        raise ts.OptionError(f"--quality is for .jpg, and {suffix} loses nothing; leave it out")
    if out.compression is not None and "compression" in foreign:
        raise ts.OptionError(f"--compression is for .tif, not for {suffix}; leave it out")
    if out.background is not None:
        from toposeam_cli.media.pictures.background import colour_of

        colour_of(out.background)


def foreign_to(suffix: str) -> set[str]:
    """Return the options of formats that files with this suffix have no use for."""
    of_formats = {
        "pyramid": (".tif", ".tiff"),
        "quality": (".jpg", ".jpeg", ".dzi"),
        "compression": (".tif", ".tiff"),
    }
    whole = {"crop", "background", "fill_edges"} if suffix == ".ora" else set()
    return whole | {name for name, suffixes in of_formats.items() if suffix not in suffixes}


def crop_of(out: Outputs, layers: Sequence[ts.Layer], wrap: int | None) -> str:
    """Return the crop of the picture; refuse in advance one that the format of the output cannot hold. `wrap`
    is the width of a round canvas, px.
    """
    if out.crop == "fit":
        return "fit"
    if (box := box_of_crop(out.crop)) is not None:
        _check_box(out, layers, box, wrap)
        return str(out.crop)
    if wrap is not None:
        keeps_holes = out.fill_edges is None and (out.has_alpha or out.background is not None)
        return out.crop or ("outside" if keeps_holes else "inside")
    if out.fill_edges is not None:
        return "inside"
    if out.crop is not None and (out.has_alpha or out.crop == "inside" or out.background is not None):
        return out.crop
    if out.has_alpha or out.background is not None:
        return "outside"
    from toposeam.layers.canvas.tile_map import all_of, any_of

    opaque = _opaque(layers)
    if all_of(opaque):
        return "outside"
    if out.crop == "outside":
        raise ts.ImageError(
            f"'{out.output}' cannot be written: the picture is partly transparent, which "
            f"{out.output.suffix} cannot hold; use .png or .tif, or add --background or --crop inside"
        )
    if not any_of(opaque):
        raise ts.ImageError(
            f"'{out.output}' cannot be written: the picture is transparent everywhere, which "
            f"{out.output.suffix} cannot hold; use .png or .tif, or add --background"
        )
    return "inside"


def box_of_crop(crop: str | None) -> Box | None:
    """Return the box of a crop on the canvas, px; None if the crop is a word."""
    from toposeam.layers.canvas.layer import Box

    if crop is None or crop in CROPS:
        return None
    left, top, width, height = map(int, crop.split(","))
    return Box(top, left, top + height, left + width)


def _check_box(out: Outputs, layers: Sequence[ts.Layer], box: Box, wrap: int | None) -> None:
    """Refuse a box that shows nothing, or holes that the format of the output cannot hold."""
    from toposeam.layers.canvas.layer import Box
    from toposeam.layers.canvas.tile_map import blocks

    opaque = _opaque(layers, wrap)
    height, width = opaque.shape
    shown = box.shared(Box(0, 0, height, width))
    parts = list(blocks(shown)) if min(shown.shape) > 0 else []
    if not any(opaque[part.slices].any() for part in parts):
        raise ts.ImageError(
            f"--crop {out.crop} shows no pixel of the picture, which is {width} x {height} px; move the box"
        )
    if not (out.has_alpha or out.background is not None or all(opaque[part.slices].all() for part in parts)):
        raise ts.ImageError(
            f"'{out.output}' cannot be written: the box of --crop is partly transparent, which "
            f"{out.output.suffix} cannot hold; make it smaller, use .png or .tif, or add --background"
        )


def _opaque(layers: Sequence[ts.Layer], wrap: int | None = None) -> npt.NDArray[np.bool_]:
    """(H, W) bool mask, True where some layer is opaque; perhaps of a round canvas of a width, px."""
    from toposeam.images import full_scale
    from toposeam.layers.canvas.canvas import common_canvas, extent_of
    from toposeam.layers.canvas.layer import Box
    from toposeam.layers.canvas.tile_map import blocks, cover_of, new_map

    canvas = extent_of(layers)
    if wrap is not None:
        canvas = common_canvas(layers, max_megapixels=1e12, wrap=wrap)
    whole, turns = Box(0, 0, *canvas.shape), (0,) if wrap is None else (0, -wrap)
    opaque = new_map(canvas.shape, False, bool)
    for layer, place in zip(layers, canvas.places, strict=True):
        full, cover = full_scale(layer.image.dtype), cover_of(layer)
        for box in blocks(Box(0, 0, *place.shape)):
            here = (
                cover[box.slices]
                if layer.alpha is None
                else cover[box.slices] & (layer.alpha[box.slices] >= full)
            )
            for turn in turns:
                moved = box.moved(place.top, place.left + turn)
                part = moved.shared(whole)
                if min(part.shape) > 0:
                    opaque[part.slices] = opaque[part.slices] | here[part.within(moved)]
    return opaque


def largest_opaque(opaque: Mask, out: Outputs) -> Box:
    """Return the largest rectangle in which all pixels are opaque.

    Raises
    ------
    ImageError
        If there is none.
    """
    from toposeam.layers.canvas.largest_rectangle import largest_full

    box = largest_full(opaque)
    if box is None:
        raise ts.ImageError(f"'{out.output}' cannot be cropped: no pixel is opaque; use .png or .tif")
    return box
