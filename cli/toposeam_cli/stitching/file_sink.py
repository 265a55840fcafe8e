"""Pictures rendered window by window into files of raw values, and written meanwhile where that can be."""

from __future__ import annotations

import ctypes
import dataclasses
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from contextvars import copy_context
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.arrays import Image, Mask
from toposeam.images import full_scale
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import BLOCK, blocks, new_map
from toposeam.layers.composite.composition import WINDOW_BLOCKS
from toposeam.layers.execution.tasks import Executor
from toposeam_cli.files.interruption import interruptible
from toposeam_cli.files.scratch import Scratch
from toposeam_cli.media.pictures.background import colour_of, on_background
from toposeam_cli.media.pictures.picture import Picture
from toposeam_cli.media.pictures.raw import Coming, Stored
from toposeam_cli.media.pictures.stored import store
from toposeam_cli.stitching.outputs import Outputs, largest_opaque, write_composite

#: Rows of a window that are written at once.
_WRITTEN_ROWS = 64


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


def render_to_files(
    composed: ts.layers.Composition,
    like: Picture,
    out: Outputs,
    crop: str,
    scratch: Scratch,
    progress: Callable[[float], None] | None,
    executor: Executor | None,
) -> tuple[Picture, Box, bool]:
    """Render a composition into files; return the picture `like` the given one, the box of the composition
    that it shows, and whether it is in its output already.
    """
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
                picture = sink.picture(like, None, full=full, coming=coming)
                rows_done.append(block.enter_context(_written(out, picture, coming, scratch)))
                written = True
            rows_done[0](box.bottom if box.right == width else box.top)

        rows_done: list[Callable[[int], None]] = []
        sink.done = done
        half = None if progress is None else lambda share: progress(0.5 + 0.5 * share)
        composed.render(sink, executor=executor, progress=half)
    box = Box(0, 0, height, width) if crop == "outside" else largest_opaque(sink.opaque, out)
    picture = sink.picture(like, box, full=_is_full(sink.opaque, box) if full is None else full)
    return picture, box, written


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
