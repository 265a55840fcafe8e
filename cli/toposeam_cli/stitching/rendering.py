"""Render a composition in memory, or window by window into files, and crop it."""

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
import scipy

import toposeam as ts
from toposeam.arrays import Bytes, Floats, Image, Mask
from toposeam.images import Windows, full_scale
from toposeam.layers.canvas.largest_rectangle import largest_full
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import BLOCK, blocks, new_map
from toposeam.layers.composite.composition import WINDOW_BLOCKS
from toposeam.layers.execution.tasks import Executor
from toposeam_cli.files.interruption import interruptible
from toposeam_cli.files.scratch import Scratch
from toposeam_cli.files.writing import all_or_nothing, atomic_write
from toposeam_cli.media.pictures.background import colour_of, on_background
from toposeam_cli.media.pictures.openraster import write_ora
from toposeam_cli.media.pictures.picture import Picture, write_picture
from toposeam_cli.media.pictures.raw import Coming, Stored
from toposeam_cli.media.pictures.stored import store
from toposeam_cli.stitching.inputs import PlacedPictures
from toposeam_cli.stitching.outputs import Outputs, write_composite

#: Number of rows of a window that are written at once: keeps copies small.
_WRITTEN_ROWS = 64


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
        view = self.composition.view
        return None if view == self.composition.canvas.box else (view.left, view.top)


def render(
    composed: ts.layers.Composition,
    job: PlacedPictures,
    out: Outputs,
    crop: str,
    scratch: Scratch,
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
    if job.stored:
        return _rendered_to_files(composed, job, out, crop, scratch, progress, executor)
    image, alpha = composed.image, composed.alpha
    filled, view = 0.0, Box(0, 0, *composed.shape)
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
    box = _largest(reached, out)
    image, holes = image[box.slices], ~shown[box.slices]
    if holes.any():
        white = full_scale(image.dtype) if image.dtype.kind == "f" else None
        image = ts.fill(image, holes, data_range=white).image
    return image, box, float(holes.mean())


def _largest(opaque: Mask, out: Outputs) -> Box:
    box = largest_full(opaque)
    if box is None:
        raise ts.ImageError(f"'{out.output}' cannot be cropped: no pixel is opaque; use .png or .tif")
    return box


def write(
    out: Outputs,
    job: PlacedPictures,
    rendered: Rendered,
    documents: Sequence[tuple[Path, bytes]],
    scratch: Scratch,
) -> None:
    """Write all outputs, or none.

    The stored pixels of layers are not read again, so their disk space is freed first.
    """
    composed, picture = rendered.composition, rendered.picture
    kinds = ((out.labels, LabelPicture), (out.overlay, Overlay))
    # Seams are looked up for the overlay before the layers' files are emptied.
    drawn = [(target, cast(np.ndarray, kind(rendered))) for target, kind in kinds if target is not None]
    keep = None
    if job.stored:
        values: list[Any] = [picture.pixels, picture.alpha]
        scratch.empty(path for part in values if isinstance(part, Stored) for path in part.paths)
        keep = partial(store, scratch=scratch)
    with all_or_nothing():
        for path, document in documents:
            atomic_write(path, document, out.force)
        for target, pixels in drawn:
            write_picture(target, Picture(pixels=pixels), out.force, keep=keep)
        if out.output.suffix.lower() == ".ora":
            write_ora(out.output, composed, job.pictures, job.layers, out.force)
        elif not rendered.written:
            write_composite(out, picture, keep)


class FileSink(ts.layers.Sink):
    """Keeps a picture in files of raw values, over a background if one is given.

    Each column of windows has one file for colours and one for opacity, since processes that write to the
    same file wait for each other.
    """

    def __init__(self, scratch: Scratch, background: str | None) -> None:
        self._scratch, self._background = scratch, background
        #: Called with the box of each window that was written.
        self.done: Callable[[Box], None] = lambda box: None

    def open(self, shape: tuple[int, ...], dtype: np.dtype) -> None:
        """Create the files."""
        height, width = shape[:2]
        self.shape = height, width, 1 if len(shape) == 2 else shape[2]
        self.dtype, self._column = dtype, WINDOW_BLOCKS * BLOCK
        new = (tuple(self._scratch.new() for _ in range(0, width, self._column)) for _ in range(2))
        self._colours, self._opacity = new
        #: (H, W) bool map of opaque pixels.
        self.opaque = new_map((height, width), False, bool)

    def __getstate__(self) -> dict[str, Any]:
        here = ("_scratch", "done", "opaque")
        return {name: value for name, value in self.__dict__.items() if name not in here}

    def write(self, box: Box, pixels: Image, alpha: Image) -> Mask:
        """Write a window; return the (H, W) bool map of its opaque pixels."""
        white, column = full_scale(pixels.dtype), box.left // self._column
        opaque = new_map(self.shape[:2], False, bool)
        opaque[box.slices] = True if self._background is not None else alpha >= white
        for first in range(0, box.shape[0], _WRITTEN_ROWS):  # so that copies are small
            part, opacity = pixels[first : first + _WRITTEN_ROWS], alpha[first : first + _WRITTEN_ROWS]
            if self._background is not None:
                part = on_background(part, opacity, colour_of(self._background))
                opacity = np.full_like(opacity, white)
            planes = part if part.ndim == 3 else part[..., np.newaxis]
            _write(self._colours[column], planes, box.top + first)
            _write(self._opacity[column], opacity, box.top + first)
        return opaque

    def take(self, box: Box, answer: Mask) -> None:
        """Record the opaque pixels of a window."""
        self.opaque[box.slices] = answer[box.slices]
        self.done(box)

    def picture(
        self, like: Picture, part: Box | None, *, full: bool, coming: Coming | None = None
    ) -> Picture:
        """Return the picture, or a part of it, with its opacity unless it is `full`."""
        height, width, bands = self.shape
        pixels = Stored(self._colours, self.shape, self.dtype, (0, bands), part, self._column, coming)
        opacity = Stored(self._opacity, (height, width, 1), self.dtype, (0, 1), part, self._column, coming)
        if coming is not None:
            pixels.lengthen()
            opacity.lengthen()
        return dataclasses.replace(
            like,
            pixels=cast(np.ndarray, pixels),
            alpha=None if full else cast(np.ndarray, opacity),
        )


def _rendered_to_files(
    composed: ts.layers.Composition,
    job: PlacedPictures,
    out: Outputs,
    crop: str,
    scratch: Scratch,
    progress: Callable[[float], None] | None,
    executor: Executor | None,
) -> Rendered:
    _give_back_memory()
    height, width = composed.shape
    sink = FileSink(scratch, out.background)
    full: bool | None = None
    if crop == "outside":
        full = True if out.background is not None else _known_full(composed)
    written = False
    with ExitStack() as block, scratch.failures_told():

        def done(box: Box) -> None:
            """Begin to write the picture with its first window, and continue with each further one."""
            nonlocal written
            if full is None:
                return
            if not written:
                coming = Coming()
                picture = sink.picture(job.pictures[0], None, full=full, coming=coming)
                rows_done.append(block.enter_context(_written(out, picture, coming, scratch)))
                written = True
            rows_done[0](box.bottom if box.right == width else box.top)

        rows_done: list[Callable[[int], None]] = []
        sink.done = done
        half = None if progress is None else lambda share: progress(0.5 + 0.5 * share)
        composed.render(sink, executor=executor, progress=half)
    box = Box(0, 0, height, width) if crop == "outside" else _largest(sink.opaque, out)
    picture = sink.picture(job.pictures[0], box, full=_is_full(sink.opaque, box) if full is None else full)
    return Rendered(composition=composed.crop(box), picture=picture, written=written)


def _known_full(composed: ts.layers.Composition) -> bool | None:
    """Test whether every pixel is opaque; None if this is not known before painting, as layers are partly
    transparent.
    """
    if any((composed.labels(*box.slices) < 0).any() for box in blocks(Box(0, 0, *composed.shape))):
        return False
    return True if all(layer.alpha is None for layer in composed.layers) else None


@contextmanager
def _written(
    out: Outputs, picture: Picture, coming: Coming, scratch: Scratch
) -> Iterator[Callable[[int], None]]:
    """Write a picture while its rows are rendered; the block reports the number of rows that are complete.

    Compression uses one processor and takes as long as rendering on many, so both must overlap.
    """
    with ThreadPoolExecutor(1, "writing") as thread:
        try:
            # The thread writes to the outputs of the current block.
            write = partial(copy_context().run, write_composite, out, picture)
            writing = thread.submit(write, partial(store, scratch=scratch))

            def come(rows: int) -> None:
                if writing.done():  # before the last row: it failed
                    writing.result()
                coming.up_to(rows)

            yield come
            interruptible(writing.result, coming.give_up)
        except BaseException:
            coming.give_up()
            raise


def _write(path: Path, values: npt.NDArray[Any], top: int) -> None:
    """Write whole rows into a file of raw values."""
    with path.open("r+b") as file:
        file.seek(top * values[0].nbytes)
        file.write(np.ascontiguousarray(values).data)


def _give_back_memory() -> None:
    """Return freed memory of the search to the system.

    glibc would keep it, about a gigabyte for a gigapixel.
    """
    with suppress(OSError, AttributeError, TypeError):  # other libraries, other systems
        ctypes.CDLL(None).malloc_trim(0)


def _is_full(mask: Mask, box: Box) -> bool:
    return all(
        bool(mask[top : min(top + BLOCK, box.bottom), box.left : box.right].all())
        for top in range(box.top, box.bottom, BLOCK)
    )


class LabelPicture(Windows):
    """The label map in grays: black for the first layer to white for the last, black where none shows."""

    def __init__(self, rendered: Rendered) -> None:
        self._composed = composed = rendered.composition
        super().__init__(composed.shape, np.uint8)
        grays = np.rint(np.linspace(0, 255, len(composed.names))).astype(np.uint8)
        self._grays = np.append(grays, np.uint8(0))

    def read(self, rows: slice, columns: slice) -> Bytes:
        """Return some rows and columns."""
        found: Bytes = self._grays[self._composed.labels(rows, columns)]
        return found


class Overlay(Windows):
    """A picture with its seams in red, bordered in white."""

    def __init__(self, rendered: Rendered) -> None:
        pixels = rendered.picture.pixels
        super().__init__((*pixels.shape[:2], 3), np.uint8)
        self._pixels = pixels
        self._marks = _marks(rendered.composition)

    def read(self, rows: slice, columns: slice) -> Bytes:
        """Return some rows and columns."""
        part, marks = np.asarray(self._pixels[rows, columns]), self._marks[rows, columns]
        planes = part if part.ndim == 3 else part[..., np.newaxis]
        share = planes / float(full_scale(planes.dtype)) * 255
        drawn = np.repeat(share, 3 // planes.shape[2], axis=2).clip(0, 255).astype(np.uint8)
        drawn[marks == 1], drawn[marks == 2] = 255, (230, 30, 40)
        return drawn


def _marks(composed: ts.layers.Composition) -> Bytes:
    """(H, W) map: 2 on seams, 1 on their border."""
    height, width = composed.shape
    radius = max(1, round(min(composed.shape) / 500))
    corner = np.array([composed.view.left, composed.view.top])
    marks: Bytes = new_map(composed.shape, 0, np.uint8)
    for value, reach in ((1, 2 * radius), (2, radius)):
        for seam in composed.outlines:
            for path in seam.paths:
                for x, y in (np.floor(_each_pixel(path.outline)).astype(int) - corner).tolist():
                    rows = slice(max(y - reach, 0), min(y + reach + 1, height))
                    columns = slice(max(x - reach, 0), min(x + reach + 1, width))
                    if rows.start < rows.stop and columns.start < columns.stop:
                        marks[rows, columns] = value
    return marks


def _each_pixel(outline: Floats) -> Floats:
    """(K, 2): points of a line at most 1 px apart in x and in y, its ends among them."""
    along = np.append(0.0, np.cumsum(np.abs(np.diff(outline, axis=0)).max(axis=1)))
    at = np.append(np.arange(along[-1]), along[-1])
    return np.column_stack([np.interp(at, along, outline[:, axis]) for axis in (0, 1)])
