"""A composition rendered, in memory or into files, cropped to what is written, and written."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import scipy

import toposeam as ts
from toposeam.arrays import Image
from toposeam.images import Windows, full_scale
from toposeam.layers.canvas.layer import Box
from toposeam.layers.execution.tasks import Executor
from toposeam_cli.files.writing import all_or_nothing, atomic_write
from toposeam_cli.media.pictures.background import colour_of, on_background
from toposeam_cli.media.pictures.picture import Picture, write_picture
from toposeam_cli.stitching.inputs import PlacedPictures
from toposeam_cli.stitching.outputs import Outputs, box_of_crop, largest_opaque, write_composite

if TYPE_CHECKING:
    from toposeam_cli.files.scratch import Scratch


@dataclass(frozen=True, slots=True, kw_only=True)
class Rendered:
    """A rendered composition."""

    #: The composition, cropped as it is written.
    composition: ts.layers.Composition
    picture: Picture
    #: The fraction of pixels that were filled in, as no picture shows there.
    filled: float = 0.0
    #: Whether the output file has been written already.
    written: bool = False

    @property
    def at(self) -> tuple[int, int] | None:
        """The (x, y) of the canvas at which the picture begins; None if it is the whole canvas."""
        cropped = self.composition.cropped
        return None if cropped is None else cropped[:2]

    def verdicts(self, executor: Executor | None = None) -> Sequence[ts.seam.Verdict]:
        """Judge each seam in the picture that was rendered; empty unless the law of costs is "natural"."""
        pixels, crop = self.picture.pixels, self.composition.cropped
        judged = self.composition.verdicts(executor, lambda *at: np.asarray(pixels[at]))
        return [verdict.inside(crop) for verdict in judged.values()]


def render(
    composed: ts.layers.Composition,
    job: PlacedPictures,
    out: Outputs,
    crop: str,
    scratch: Scratch | None,
    progress: Callable[[float], None] | None = None,
    executor: Executor | None = None,
) -> Rendered:
    """Render a composition; pictures that are stored in files are rendered into files, perhaps by an
    executor.

    If the first window settles the format of the picture, it is written while it is rendered. So this must be
    called within the same block of outputs as :func:`write`.

    Raises
    ------
    ImageError
        If the picture cannot be cropped.
    OutputError
        If the disk is full.
    """
    if crop == "fit":
        composed = ts.layers.fitted(composed)
        crop = "outside" if composed.period is not None and out.has_alpha else "inside"
    elif (box := box_of_crop(crop)) is not None:
        composed, crop = composed.crop(box.shared(Box(0, 0, *composed.shape))), "outside"
    if job.stored and scratch is not None:
        from toposeam_cli.stitching.file_sink import render_to_files

        like = job.pictures[0]
        picture, view, written = render_to_files(composed, like, out, crop, scratch, progress, executor)
        return Rendered(composition=composed.crop(view), picture=picture, written=written)
    image, alpha = composed.image, composed.alpha
    filled, view = composed.filled, Box(0, 0, *composed.shape)
    if alpha is not None and crop == "inside":
        image, view, filled = _cropped_inside(image, alpha, out)
        alpha = None
    elif alpha is not None and out.background is not None:
        image, alpha = on_background(image, alpha, colour_of(out.background)), None
    picture = dataclasses.replace(job.pictures[0], pixels=image, alpha=alpha)
    return Rendered(composition=composed.crop(view), picture=picture, filled=filled)


def _cropped_inside(image: Image, alpha: Image, out: Outputs) -> tuple[Image, Box, float]:
    """Crop to the largest rectangle without holes; small holes near a picture may be filled first.

    Returns the cropped picture, its box, and the fraction of it that was filled.
    """
    shown = alpha >= full_scale(image.dtype)
    reached = shown
    if out.fill_edges is not None and shown.any():
        reached = scipy.ndimage.distance_transform_edt(~shown) <= out.fill_edges
    box = largest_opaque(reached, out)
    image, holes = image[box.slices], ~shown[box.slices]
    if holes.any():
        white = full_scale(image.dtype) if image.dtype.kind == "f" else None
        image = ts.fill(image, holes, data_range=white).image
    return image, box, float(holes.mean())


def write(
    out: Outputs,
    job: PlacedPictures,
    rendered: Rendered,
    documents: Mapping[Path, bytes],
    scratch: Scratch | None,
) -> None:
    """Write all outputs, or none.

    The stored pixels of layers are not read again, so their disk space is freed first.
    """
    composed, picture = rendered.composition, rendered.picture
    drawn = _drawn(rendered, out)  # seams are looked up before the layers' files are emptied
    keep = None
    if job.stored and scratch is not None:
        from toposeam_cli.media.pictures.raw import Stored
        from toposeam_cli.media.pictures.stored import store

        values: list[Any] = [picture.pixels, picture.alpha]
        scratch.empty(path for part in values if isinstance(part, Stored) for path in part.paths)
        keep = partial(store, scratch=scratch)
    with all_or_nothing():
        for path, document in documents.items():
            atomic_write(path, document, out.force)
        for path, pixels in drawn:
            write_picture(path, Picture(pixels=cast(np.ndarray, pixels)), out.force, keep=keep)
        if out.output.suffix.lower() == ".ora":
            from toposeam_cli.media.pictures.openraster import write_ora

            write_ora(out.output, composed, job.pictures, job.layers, out.force)
        elif not rendered.written:
            write_composite(out, picture, keep)


def _drawn(rendered: Rendered, out: Outputs) -> list[tuple[Path, Windows]]:
    """Return the pictures that are drawn beside the joined one, with their files."""
    if out.labels is None and out.overlay is None:
        return []
    from toposeam_cli.stitching.drawn_pictures import LabelPicture, Overlay

    composed, drawn = rendered.composition, list[tuple[Path, Windows]]()
    if out.labels is not None:
        drawn.append((out.labels, LabelPicture(composed)))
    if out.overlay is not None:
        drawn.append((out.overlay, Overlay(composed, rendered.picture.pixels)))
    return drawn
