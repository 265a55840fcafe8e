"""Pictures of a work placed and joined on a preview, with the options of ``toposeam stitch``."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np
from click.core import ParameterSource

import toposeam as ts
from toposeam.arrays import Floats, Labels
from toposeam.layers.blending.blend import blending_of
from toposeam.layers.canvas.largest_rectangle import largest_full
from toposeam.layers.canvas.layer import Box
from toposeam.layers.composite.seams import steps_along
from toposeam_cli.app.options import taken
from toposeam_cli.app.registry import load
from toposeam_cli.edit.preview import ReducedPictures
from toposeam_cli.edit.strokes import CanvasTransform
from toposeam_cli.edit.work import Work
from toposeam_cli.files.writing import all_or_nothing, atomic_write
from toposeam_cli.media.layouts.layout import Layout, LayoutStroke
from toposeam_cli.stitching.inputs import PlacedPictures, arrange
from toposeam_cli.stitching.joining import join
from toposeam_cli.stitching.outputs import Outputs, box_of_crop
from toposeam_cli.stitching.place_options import FindingOptions, is_fitted, kind_of, with_defaults
from toposeam_cli.stitching.positions import LAYOUTS, Where
from toposeam_cli.stitching.saved_layout import saved_layout, taken_layout
from toposeam_cli.stitching.search_options import Means, SeamOptions, strangers

#: Most pictures that the page shows: each is a texture.
MOST_PICTURES = 100
#: So far, px of the preview, pictures may end elsewhere at full size.
_RIM_PX = 2
#: Settings that change where pictures lie; the others change how they are joined.
PLACING = ("model", "projection", "level")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Opened:
    """A work whose pictures are placed, and joined on the preview."""

    job: PlacedPictures
    joined: ts.layers.Composition
    #: Per picture, from its own pixels to the preview, whose upper left pixel is at 0,0.
    transforms: tuple[CanvasTransform, ...]
    #: Size of the preview ÷ that of the result.
    scale: float
    #: Whether pictures are blended across the seams.
    blends: bool
    warnings: tuple[str, ...]
    #: The layout that was opened.
    layout: Layout | None
    _kind: str
    _context: click.Context

    @property
    def crop(self) -> list[float] | None:
        """Left, top, width and height of the crop that was drawn, px of the preview; None if none was."""
        box = box_of_crop(self._context.params["crop"])
        if box is None:
            return None
        return [self.scale * value for value in (box.left, box.top, box.shape[1], box.shape[0])]

    def crop_to(self, box: Sequence[float]) -> str:
        """Crop the result to left, top, width and height, px of the preview, of a whole turn to its rows;
        return the box as ``toposeam stitch --crop`` takes it. Seams stay as they are.
        """
        left, top, width, height = (round(value / self.scale) for value in box)
        if self.job.wrap is not None:
            left, width = 0, round(self.job.wrap)
        return self.take_crop(f"{left},{top},{max(1, width)},{max(1, height)}")

    def take_crop(self, crop: str) -> str:
        """Crop the result to a box as ``toposeam stitch --crop`` takes it, and return that."""
        self._context.params["crop"] = crop
        self._context.set_parameter_source("crop", ParameterSource.COMMANDLINE)
        return crop

    def inside(self) -> list[int]:
        """Return left, top, width and height of the largest rectangle without holes, px of the preview; of a
        whole turn it has all columns. Warped pictures end a little elsewhere at full size.
        """
        full = self.joined.label_map >= 0
        if self.job.wrap is not None:
            full = np.broadcast_to(full.all(axis=1, keepdims=True), full.shape)
        box = largest_full(full) or Box(0, 0, *self.joined.shape)
        if any(map(self.job.warped, range(len(self.job.layers)))) and min(box.shape) > 8 * _RIM_PX:
            box = box.grown(-_RIM_PX)
        return [box.left, box.top, box.shape[1], box.shape[0]]

    def has_holes(self, box: Sequence[float]) -> bool:
        """Test whether left, top, width and height, px of the preview, hold pixels that no picture has."""
        left, top, width, height = (round(value) for value in box)
        return bool((self.joined.label_map[top : top + height, left : left + width] < 0).any())

    def labels(self) -> Labels | None:
        """Return the label map of the layout; None if there is none of this preview."""
        if self.layout is None or self.layout.labels is None:
            return None
        from toposeam_cli.media.layouts.label_picture import read_labels

        layout, own = self.layout, self.joined.label_map
        try:
            found = read_labels(self.layout.labels.file, layout.numbers, layout.count, ts.MAX_PIXELS)
        except ts.ImageError:
            return None
        fits = found.shape == own.shape and bool(((found < 0) == (own < 0)).all())
        return found.astype(np.int16) if fits else None

    def blended(self, labels: Labels, box: Box) -> np.ndarray:
        """Return the pixels of a box of the preview, joined by a label map and blended."""
        solution = dataclasses.replace(self.joined.solution, labels=labels)
        shown = dataclasses.replace(self.joined, solution=solution)
        if shown.blending.needs_potential:
            shown = dataclasses.replace(shown, blending=blending_of(shown.blending.without_potential, None))
        return np.asarray(shown.window(box.slices[0], box.slices[1])[0])

    def steps(self, labels: Labels, box: Box, pixels: np.ndarray, poor: Floats) -> Floats:
        """Measure how visibly the blended pixels of a box show the seams of a label map: (K, 3), x, y, px of
        the preview, and step or break. `poor` are the places where pictures show something else, as for
        :func:`toposeam.layers.composite.steps_along`.
        """
        here = np.unique(labels[box.slices]).tolist()
        pairs = list(itertools.combinations((one for one in here if one >= 0), 2))
        canvas, places = self.joined.canvas.cut_open(), dict.fromkeys(pairs, poor)
        found = steps_along(canvas, labels, box, lambda *at: pixels[at], places)
        return np.concatenate([np.zeros((0, 3)), *found.values()])

    def write(self, path: Path, strokes: Sequence[LayoutStroke], labels: Labels) -> None:
        """Write the work as a layout for ``toposeam stitch``, and its labels beside it.

        Raises
        ------
        OutputError
            If the disk is full.
        """
        painting: dict[str, Any] = {}
        if strokes:
            left, top = self.joined.canvas.origin
            at = left / self.scale, top / self.scale
            painting = {"strokes": strokes, "preview": (labels, at, 1 / self.scale)}
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with all_or_nothing():
            for each, document in _saved_layout(self._context, self.job, self._kind, path, painting).items():
                atomic_write(each, document, force=True)


def open_work(
    work: Work, progress: Callable[[float], None] | None = None, horizon: str | None = None
) -> Opened:
    """Place the pictures of a work and find their seams.

    Parameters
    ----------
    work : Work
    progress : callable, optional
        Called with the share of the placing done, in [0, 1].
    horizon : str, optional
        A line of a picture that is to lie level, as ``toposeam stitch --horizon`` takes it.

    Raises
    ------
    TopoSeamError
        If they cannot be placed or joined.
    """
    source = work.source()
    context = _stitching(source, work.settings, horizon)
    with context:
        given, layout = dict(context.params), None
        if len(source) == 1 and source[0].suffix.lower() in LAYOUTS:
            layout = taken_layout(source[0], given)
        where, find = taken(Where, given), SeamOptions.taken(given)
        out, finding = taken(Outputs, given), taken(FindingOptions, given)
        fits = partial(is_fitted, finding=finding, out=out)
        preview = ReducedPictures()
        job = arrange(
            source,
            where,
            masks=given["masks"],
            keeps=given["keeps"],
            max_megapixels=find.of_stitch("max_megapixels"),
            progress=progress,
            finding=finding.of(source if layout is None else layout.files),
            lay=preview,
            fits=fits,
        )
        check_count(len(job.layers))
        kind = kind_of(job.transforms, finding, found=job.placement is not None)
        find, out = with_defaults(find, out, kind)
        if job.wrap is not None:
            find = find.with_stitch(wrap=round(job.wrap * preview.scale))
        joined = join(job, find, out, source, Means(None, None, False))
    return Opened(
        job=job,
        joined=joined,
        transforms=tuple(CanvasTransform(one, joined.canvas.origin) for one in preview.transforms),
        scale=preview.scale,
        blends=find.of_stitch("blend") != "none",
        warnings=(*job.skipped, *(strangers(job) if job.placement is not None else ())),
        layout=layout,
        _kind=kind,
        _context=context,
    )


def _stitching(source: Sequence[Path], settings: Mapping[str, str], horizon: str | None) -> click.Context:
    """Return the context of ``toposeam stitch`` for some pictures."""
    command = load("stitch")
    given = source[0].suffix.lower() in (*LAYOUTS, ".ora")
    words = [
        word
        for name, value in settings.items()
        if not (given and name in PLACING)
        for word in _words_of(name, value)
    ]
    words += [] if horizon is None else ["--horizon", horizon]
    return command.make_context("stitch", [*map(str, source), "-o", "joined.png", *words])


def _words_of(name: str, value: str) -> list[str]:
    """Return an option of ``toposeam stitch`` as it is written."""
    if name == "level":
        return [] if value == "yes" else ["--no-level"]
    if name == "tones":
        return ["--no-match-tones", "--no-match-shading"] if value == "none" else [f"--match-{value}"]
    return [f"--{name}", value]


def _saved_layout(
    context: click.Context, job: PlacedPictures, kind: str, path: Path, painting: Mapping[str, Any]
) -> dict[Path, bytes]:
    """Return the layout of a work, with places at full size, and the file of its labels."""
    corner = np.zeros((1, 2))
    at = (transform.to_canvas(corner)[0].round() for transform in job.transforms)
    layers = [
        layer if job.warped(index) else dataclasses.replace(layer, at=(int(x), int(y)))
        for index, (layer, (x, y)) in enumerate(zip(job.layers, at, strict=True))
    ]
    whole = dataclasses.replace(job, layers=tuple(layers))
    with context.scope(cleanup=False):
        return saved_layout(whole, whole, path, kind, painting)


def check_count(count: int) -> None:
    """Refuse more pictures than the page shows.

    Raises
    ------
    OptionError
    """
    if count > MOST_PICTURES:
        raise ts.OptionError(
            f"{count} pictures are more than the page shows, which is {MOST_PICTURES}; join them by toposeam "
            "stitch, or open fewer"
        )
