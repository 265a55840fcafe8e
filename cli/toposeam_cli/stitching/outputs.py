"""Output of a composite: its formats, cropping, background, and files that belong to it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

import toposeam as ts
from toposeam.images import full_scale
from toposeam.layers.canvas.largest_rectangle import largest_full
from toposeam.layers.canvas.layer import Box, extent_of
from toposeam.layers.canvas.tile_map import all_of, any_of, blocks, cover_of, new_map
from toposeam_cli.figures.search import SUFFIXES as SEARCH_SUFFIXES
from toposeam_cli.files.regular import real_path
from toposeam_cli.files.writing import PICTURE_SUFFIXES, all_or_nothing, atomic_write, check_output
from toposeam_cli.media.pictures.background import colour_of, on_background
from toposeam_cli.media.pictures.deep_zoom import check_deep_zoom, write_deep_zoom
from toposeam_cli.media.pictures.openraster import write_ora
from toposeam_cli.media.pictures.picture import Keep, Picture, write_picture
from toposeam_cli.stitching.inputs import PlacedPictures


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

    @property
    def has_alpha(self) -> bool:
        """True if the picture's format knows transparency."""
        return self.output.suffix.lower() not in (".jpg", ".jpeg")


def numbered(out: Outputs, number: int) -> Outputs:
    """Return the same outputs for a group of pictures, under names that end in its number."""
    paths: dict[str, Any] = {
        field.name: path.with_stem(f"{path.stem}-{number}")
        for field in dataclasses.fields(out)
        if isinstance(path := getattr(out, field.name), Path)
    }
    return dataclasses.replace(out, **paths)


def write(
    out: Outputs,
    job: PlacedPictures,
    finished: ts.layers.Stitched,
    documents: Sequence[tuple[Path, bytes]],
    overlay: npt.NDArray[np.uint8] | None,
) -> None:
    """Write all outputs, or none."""
    image, alpha = finished.image, finished.alpha
    if out.background is not None and alpha is not None:
        image, alpha = on_background(image, alpha, colour_of(out.background)), None
    with all_or_nothing():
        if out.output.suffix.lower() == ".ora":
            write_ora(out.output, finished, job.pictures, job.layers, out.force)
        else:
            write_composite(out, dataclasses.replace(job.pictures[0], pixels=image, alpha=alpha))
        for path, document in documents:
            atomic_write(path, document, out.force)
        if out.labels is not None:
            write_picture(out.labels, Picture(pixels=_labels(finished)), out.force)
        if out.overlay is not None and overlay is not None:
            write_picture(out.overlay, Picture(pixels=overlay), out.force)


def write_composite(out: Outputs, picture: Picture, keep: Keep | None = None) -> None:
    """Write the joined picture itself; what `keep` is, :func:`match_pictures` tells."""
    if out.output.suffix.lower() == ".dzi":
        write_deep_zoom(out.output, picture, out.force, out.quality, keep)
        return
    options: dict[str, Any] = {"quality": out.quality, "compression": out.compression, "pyramid": out.pyramid}
    write_picture(out.output, picture, out.force, keep=keep, **options)


def _labels(stitched: ts.layers.Stitched) -> Any:
    """(H, W) uint8: grays from black for the first layer to white for the last; black where there is none."""
    grays = np.rint(np.linspace(0, 255, len(stitched.names))).astype(np.uint8)
    return np.append(grays, np.uint8(0))[stitched.label_map]


def check_outputs(out: Outputs) -> None:
    """Refuse outputs that cannot be written, before any work is spent on them."""
    suffix = out.output.suffix.lower()
    check_output(out.output, out.force, (*PICTURE_SUFFIXES, ".ora", ".dzi"))
    if suffix == ".dzi":
        check_deep_zoom(out.output, out.force)
    for path, suffixes in (
        (out.seam, (".svg",)),
        (out.history, SEARCH_SUFFIXES),
        (out.save_layout, (".toml", ".pto")),
        (out.report, (".html",)),
    ):
        if path is not None:
            check_output(path, out.force, suffixes)
    for path in (out.labels, out.overlay):
        if path is not None:
            check_output(path, out.force)
    paths = out.output, out.seam, out.labels, out.overlay, out.history, out.save_layout, out.report
    given = [real_path(path) for path in paths if path is not None]
    if len(set(given)) < len(given):
        raise ts.OptionError("two outputs have the same name; give each a name of its own")
    if suffix == ".ora" and (out.crop is not None or out.background is not None):
        raise ts.OptionError("--crop and --background are for pictures; an .ora file keeps all of the layers")
    if out.fill_edges is not None:
        kept = {".ora": suffix == ".ora", "--crop outside": out.crop == "outside"}
        kept["--background"] = out.background is not None
        for name in (name for name, given in kept.items() if given):
            raise ts.OptionError(f"--fill-edges leaves no holes, and {name} keeps them; leave one out")
    if out.pyramid and suffix not in (".tif", ".tiff"):
        raise ts.OptionError(f"--pyramid is for .tif, not for {suffix}; leave it out, or write .tif or .dzi")
    if out.quality is not None and suffix not in (".jpg", ".jpeg", ".dzi"):
        raise ts.OptionError(f"--quality is for .jpg, and {suffix} loses nothing; leave it out")
    if out.compression is not None and suffix not in (".tif", ".tiff"):
        raise ts.OptionError(f"--compression is for .tif, not for {suffix}; leave it out")
    if out.background is not None:
        colour_of(out.background)


def crop_of(out: Outputs, layers: Sequence[ts.Layer]) -> str:
    """Return the crop of the picture; refuse, before any work is spent on it, one whose format cannot hold
    it.
    """
    if out.fill_edges is not None:
        return "inside"
    if out.crop is not None and (out.has_alpha or out.crop == "inside" or out.background is not None):
        return out.crop
    if out.has_alpha or out.background is not None:
        return "outside"
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


def _opaque(layers: Sequence[ts.Layer]) -> npt.NDArray[np.bool_]:
    """(H, W) bool: where some layer is opaque."""
    canvas = extent_of(layers)
    opaque = new_map(canvas.shape, False, bool)
    for layer in layers:
        place, full, cover = canvas.place(layer), full_scale(layer.image.dtype), cover_of(layer)
        for box in blocks(Box(0, 0, *place.shape)):
            here = (
                cover[box.slices]
                if layer.alpha is None
                else cover[box.slices] & (layer.alpha[box.slices] >= full)
            )
            at = box.moved(*place[:2]).slices
            opaque[at] = opaque[at] | here
    return opaque


@dataclass(frozen=True, slots=True, kw_only=True)
class Cropped:
    """A composite as it is written."""

    stitched: ts.layers.Stitched
    #: Where it begins on the canvas, x and y; None where it is all of it.
    at: tuple[int, int] | None = None
    #: Share of its pixels that no picture showed.
    filled: float = 0.0


def cropped(stitched: ts.layers.Stitched, out: Outputs) -> Cropped:
    """Return the largest rectangle without holes, or with those near a picture filled."""
    if stitched.alpha is None:
        return Cropped(stitched=stitched)
    shown = stitched.alpha >= full_scale(stitched.image.dtype)
    reached = shown
    if out.fill_edges is not None and shown.any():
        reached = scipy.ndimage.distance_transform_edt(~shown) <= out.fill_edges
    box = largest_full(reached)
    if box is None:
        raise ts.ImageError(f"'{out.output}' cannot be cropped: no pixel is opaque; use .png or .tif")
    image, holes = stitched.image[box.slices], ~shown[box.slices]
    if holes.any():
        white = full_scale(image.dtype) if image.dtype.kind == "f" else None
        image = ts.fill(image, holes, data_range=white).image
    part = dataclasses.replace(stitched, image=image, alpha=None, label_map=stitched.label_map[box.slices])
    return Cropped(stitched=part, at=(box.left, box.top), filled=float(holes.mean()))
