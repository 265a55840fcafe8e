"""Composites larger than memory: made window by window, kept in a file of raw values, written by libvips."""

from __future__ import annotations

import ctypes
import dataclasses
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from contextvars import copy_context
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.images import full_scale
from toposeam.layers.canvas.largest_rectangle import largest_full
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import BLOCK, blocks, new_map, part_of
from toposeam.layers.composite.composition import Outline
from toposeam.layers.composite.stitch import seams_svg
from toposeam.layers.execution.tasks import Executor, results
from toposeam.sentence import counted
from toposeam_cli.files.interruption import interruptible
from toposeam_cli.files.scratch import Scratch
from toposeam_cli.files.writing import all_or_nothing, atomic_write
from toposeam_cli.media.pictures.background import colour_of, on_background
from toposeam_cli.media.pictures.picture import Picture, write_picture
from toposeam_cli.media.pictures.raw import Coming, Stored
from toposeam_cli.media.pictures.stored import store
from toposeam_cli.stitching.hugin_crop import Framed
from toposeam_cli.stitching.inputs import PlacedPictures
from toposeam_cli.stitching.outputs import Outputs, write_composite
from toposeam_cli.stitching.report import Crop, crop_at, summary_inside, worst_inside

#: How wide windows are that are computed at once, px.
_COLUMNS = 4 * BLOCK
#: Rows of a window that are written at once.
_ROWS = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Large:
    """A composite in files, and facts for the report."""

    picture: Picture
    labels: Picture | None
    overlay: Picture | None
    #: Made on request.
    seams: tuple[Outline, ...]
    #: Pixels that each layer shows.
    shown: tuple[int, ...]
    #: Where the picture begins that was cropped.
    at: tuple[int, int] | None
    #: Whether it is in its output already.
    written: bool

    @property
    def crop(self) -> Crop | None:
        """What of the canvas it shows, where it was cropped."""
        return crop_at(self.at, self.picture.pixels.shape)


@dataclass(frozen=True, slots=True)
class _Files:
    """Raw values of the canvas: colours, opacity, which layer shows, the picture with its seams; a file for
    each column of windows: processes that write to one file wait for each other, row by row.
    """

    colours: tuple[Path, ...]
    opacity: tuple[Path, ...]
    labels: tuple[Path, ...]
    drawn: tuple[Path, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Window:
    """A window of the canvas that is to be computed into files."""

    composed: ts.layers.Composition | Framed
    box: Box
    files: _Files
    #: Whether it is kept which layer shows.
    labels: bool
    #: Where seams are drawn, if they are.
    marks: npt.NDArray[np.uint8] | None
    background: str | None


@dataclass(frozen=True, slots=True, eq=False)
class _Painted:
    """Facts about a painted window."""

    #: (H, W) bool map.
    opaque: npt.NDArray[np.bool_]
    #: Pixels that show no layer, and each layer.
    shown: npt.NDArray[np.int64]
    #: Channels.
    bands: int


def make(
    composed: ts.layers.Composition | Framed,
    job: PlacedPictures,
    out: Outputs,
    crop: str,
    scratch: Scratch,
    progress: Callable[[float], None] | None = None,
    executor: Executor | None = None,
) -> Large:
    """Compute a composite into files, window by window, here or where an executor does so. Where it is known
    from the first window on what the picture will be, it is written meanwhile; to be called in the block of
    outputs that :func:`write_large` is called in.

    Raises
    ------
    ImageError
        When it cannot be cropped.
    OutputError
        When the disk is full.
    """
    _give_back_memory()
    height, width = composed.shape
    asked = out.as_json or (out.overlay, out.seam, out.report) != (None,) * 3
    seams = tuple(composed.outlines()) if asked else ()
    marks = _marks(seams, composed.shape) if out.overlay is not None else None
    dtype = composed.layers[0].image.dtype
    opaque = new_map((height, width), False, bool)
    shown = np.zeros(len(composed.names) + 1, np.int64)
    wanted = True, True, out.labels is not None, marks is not None
    new = [tuple(scratch.new() for _ in range(0, width if each else 0, _COLUMNS)) for each in wanted]
    bands, files = 1, _Files(*new)
    handed = executor if composed.divides else None
    windows = list(_windows(height, width))
    items = (
        _Window(
            composed=composed if handed is None else composed.part(*box.slices),
            box=box,
            files=files,
            labels=out.labels is not None,
            marks=None if marks is None else part_of(marks, box),
            background=out.background,
        )
        for box in windows
    )
    early, full = None, None
    with ExitStack() as block, scratch.failures_told():
        done = results(handed, _painted, items)
        if crop == "outside":
            full = True if out.background is not None else _known_full(composed)
        for number, (box, painted) in enumerate(zip(windows, done, strict=True), start=1):
            opaque[box.slices] = painted.opaque[box.slices]
            shown += painted.shown
            bands = painted.bands
            if early is None and full is not None:
                coming = Coming()
                picture = _picture(job, files, (height, width, bands), dtype, full=full, coming=coming)
                early = block.enter_context(_written(out, picture, coming, scratch))
            if early is not None:
                early(box.bottom if box.right == width else box.top)
            if progress is not None:
                progress(0.5 + 0.5 * number / len(windows))
    box = Box(0, 0, height, width)
    if crop == "inside":
        found = largest_full(opaque)
        if found is None:
            raise ts.ImageError(f"'{out.output}' cannot be cropped: no pixel is opaque; use .png or .tif")
        box = found
    if full is None:
        full = _is_full(opaque, box)
    return Large(
        picture=_picture(job, files, (height, width, bands), dtype, box, full=full),
        labels=None if out.labels is None else _byte_picture(files.labels, (height, width, 1), box),
        overlay=None if marks is None else _byte_picture(files.drawn, (height, width, 3), box),
        seams=seams,
        shown=tuple(shown[1:].tolist()),
        at=None if box == (0, 0, height, width) else (box.left, box.top),
        written=early is not None,
    )


def _known_full(composed: ts.layers.Composition | Framed) -> bool | None:
    """Test whether all of it is opaque; None where only painting shows it, as layers are partly
    transparent.
    """
    if any((composed.labels(*box.slices) < 0).any() for box in blocks(Box(0, 0, *composed.shape))):
        return False
    return True if all(layer.alpha is None for layer in composed.layers) else None


def _picture(
    job: PlacedPictures,
    files: _Files,
    shape: tuple[int, int, int],
    dtype: np.dtype,
    part: Box | None = None,
    *,
    full: bool,
    coming: Coming | None = None,
) -> Picture:
    """Return the picture, or part of it, with its opacity where it is not `full`."""
    height, width, bands = shape
    pixels = Stored(files.colours, shape, dtype, (0, bands), part, _COLUMNS, coming)
    opacity = Stored(files.opacity, (height, width, 1), dtype, (0, 1), part, _COLUMNS, coming)
    if coming is not None:
        pixels.lengthen()
        opacity.lengthen()
    return dataclasses.replace(
        job.pictures[0],
        pixels=cast(np.ndarray, pixels),
        alpha=None if full else cast(np.ndarray, opacity),
    )


@contextmanager
def _written(
    out: Outputs, picture: Picture, coming: Coming, scratch: Scratch
) -> Iterator[Callable[[int], None]]:
    """Write a picture while its rows come: the block reports the number of rows, after which all is written.

    Packing takes one processor, and as long as painting on many; so it must not wait for that.
    """
    with ThreadPoolExecutor(1, "writing") as thread:
        try:
            # What it writes belongs to the outputs of the block we are in.
            write = partial(copy_context().run, write_composite, out, picture)
            writing = thread.submit(write, partial(store, scratch=scratch))

            def told(rows: int) -> None:
                if writing.done():  # too early, so it failed
                    writing.result()
                coming.up_to(rows)

            yield told
            interruptible(writing.result, coming.give_up)
        except BaseException:
            coming.give_up()
            raise


def _windows(height: int, width: int) -> Iterator[Box]:
    for top in range(0, height, BLOCK):
        for left in range(0, width, _COLUMNS):
            yield Box(top, left, min(top + BLOCK, height), min(left + _COLUMNS, width))


def _painted(window: _Window) -> _Painted:
    """Compute a window into files."""
    composed, box, files = window.composed, window.box, window.files
    column, count = box.left // _COLUMNS, len(composed.names)
    image, alpha = composed.window(*box.slices)
    white, bands = full_scale(image.dtype), 1
    opaque, shown = new_map(composed.shape, False, bool), np.zeros(count + 1, np.int64)
    opaque[box.slices] = True if window.background is not None else alpha >= white
    grays = np.append(np.rint(np.linspace(0, 255, count)).astype(np.uint8), np.uint8(0))
    for first in range(box.top, box.bottom, _ROWS):  # so that copies are small
        strip = Box(first, box.left, min(first + _ROWS, box.bottom), box.right)
        here = slice(strip.top - box.top, strip.bottom - box.top)
        part, opacity = image[here], alpha[here]
        if window.background is not None:
            part = on_background(part, opacity, colour_of(window.background))
            opacity[:] = white
        planes = part if part.ndim == 3 else part[..., np.newaxis]
        bands = planes.shape[2]
        _write(files.colours[column], planes, strip.top)
        _write(files.opacity[column], opacity, strip.top)
        shows = composed.labels(*strip.slices)
        shown += np.bincount(shows.ravel() + 1, minlength=len(shown))
        if window.labels:
            _write(files.labels[column], grays[shows], strip.top)
        if window.marks is not None:
            _write(files.drawn[column], _drawn(planes, window.marks[strip.slices]), strip.top)
    return _Painted(opaque, shown, bands)


def _write(path: Path, values: npt.NDArray[Any], top: int) -> None:
    """Write rows into a file of raw values that is as wide as they are."""
    with path.open("r+b") as file:
        file.seek(top * values[0].nbytes)
        file.write(np.ascontiguousarray(values).data)


def _give_back_memory() -> None:
    """Let the C library return to the system what finding the seams took and is free again; glibc keeps it,
    which is a gigabyte of a gigapixel.
    """
    with suppress(OSError, AttributeError, TypeError):  # other libraries, other systems
        ctypes.CDLL(None).malloc_trim(0)


def write_large(
    out: Outputs,
    composed: ts.layers.Composition | Framed,
    large: Large,
    documents: Sequence[tuple[Path, bytes]],
    scratch: Scratch,
) -> None:
    """Write all outputs, or none. The layers themselves are not looked at again: what they take in a folder
    is given back meanwhile.
    """
    written = [picture for picture in (large.picture, large.labels, large.overlay) if picture is not None]
    values: list[Any] = [part for picture in written for part in (picture.pixels, picture.alpha)]
    scratch.empty(path for part in values if isinstance(part, Stored) for path in part.paths)
    keep = partial(store, scratch=scratch)
    with all_or_nothing():
        for path, document in documents:
            atomic_write(path, document, out.force)
        for target, picture in ((out.labels, large.labels), (out.overlay, large.overlay)):
            if target is not None and picture is not None:
                write_picture(target, picture, out.force, keep=keep)
        if out.seam is not None:
            between = [(seam.pair, seam) for seam in large.seams]
            text = seams_svg(between, composed.names, composed.shape, composed.rounds)
            atomic_write(out.seam, text, out.force)
        if not large.written:
            write_composite(out, large.picture, keep)


def describe_totals(
    composed: ts.layers.Composition, executor: Executor | None = None, crop: Crop | None = None
) -> str:
    """Return one line about the seams for people, of a picture that may be cropped."""
    if not composed.pairs:
        return f"{len(composed.names)} layers without a seam"
    totals, rounds = composed.totals(executor), composed.rounds
    verdict = worst_inside(totals.verdicts, crop)
    return (
        f"{len(composed.names)} layers, {counted(len(composed.pairs), 'seam')} of {round(totals.length)} px "
        f"in all by {totals.method}, {counted(rounds, 'round')}, cost {totals.cost:.4g}, "
        f"{totals.seconds:.2f} s{'' if verdict is None else f': {verdict}'}"
    )


def summary_of_large(composed: ts.layers.Composition, large: Large) -> dict[str, Any]:
    """Summarise a large result for ``--json``; without optima, which take longer than the seams."""
    layers = [
        {"name": layer.name, "at": list(layer.at), "shown_px": shown}
        for layer, shown in zip(composed.layers, large.shown, strict=True)
    ]
    seams = [
        {
            "between": [composed.names[index] for index in seam.pair],
            "method": seam.method,
            "cost": seam.cost,
            "iterations": seam.iterations,
            "termination": str(seam.termination),
            "paths": len(seam.paths),
            "length_px": round(seam.length),
            "seconds": round(seam.seconds, 6),
            **summary_inside([seam.verdict], large.crop),
        }
        for seam in large.seams
    ]
    cost = sum(seam.cost for seam in large.seams)
    likeness = summary_inside([seam.verdict for seam in large.seams], large.crop)
    return {"cost": cost, "rounds": composed.rounds, **likeness, "layers": layers, "seams": seams}


def _byte_picture(paths: Sequence[Path], shape: tuple[int, int, int], box: Box) -> Picture:
    pixels = Stored(paths, shape, np.dtype(np.uint8), (0, shape[2]), box, _COLUMNS)
    return Picture(pixels=cast(np.ndarray, pixels))


def _is_full(mask: npt.NDArray[np.bool_], box: Box) -> bool:
    return all(
        bool(mask[top : min(top + BLOCK, box.bottom), box.left : box.right].all())
        for top in range(box.top, box.bottom, BLOCK)
    )


def _marks(seams: Sequence[Outline], shape: tuple[int, int]) -> npt.NDArray[np.uint8]:
    """(H, W) map: 2 on seams, 1 beside them."""
    height, width = shape
    radius = max(1, round(min(shape) / 500))
    marks = new_map(shape, 0, np.uint8)
    for value, reach in ((1, 2 * radius), (2, radius)):
        for seam in seams:
            for path in seam.paths:
                for x, y in np.floor(path.outline).astype(int).tolist():
                    rows = slice(max(y - reach, 0), min(y + reach + 1, height))
                    columns = slice(max(x - reach, 0), min(x + reach + 1, width))
                    marks[rows, columns] = value
    return marks


def _drawn(planes: npt.NDArray[Any], marks: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """(h, w, 3): the picture with its seams in red on white."""
    share = planes / float(full_scale(planes.dtype)) * 255
    drawn = np.repeat(share, 3 // planes.shape[2], axis=2).clip(0, 255).astype(np.uint8)
    drawn[marks == 1], drawn[marks == 2] = 255, (230, 30, 40)
    return drawn
