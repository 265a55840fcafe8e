"""Pixels in files of raw values, read by windows, also while they are still written from the top down."""

from __future__ import annotations

import math
import mmap
import os
from collections.abc import Sequence
from pathlib import Path
from threading import Condition
from typing import Any

import numpy as np

from toposeam.images import Windows


class Coming:
    """The number of rows of a picture that are written so far."""

    def __init__(self) -> None:
        self._rows, self._ends = 0, False
        self._changed = Condition()

    def up_to(self, rows: int) -> None:
        """Set the number of written rows."""
        with self._changed:
            self._rows = rows
            self._changed.notify_all()

    def give_up(self) -> None:
        """Let all readers fail, as no more rows will be written."""
        with self._changed:
            self._ends = True
            self._changed.notify_all()

    def wait(self, rows: int) -> None:
        """Wait until `rows` rows are written.

        Raises
        ------
        EOFError
            When they will not be written.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._ends or self._rows >= rows)
            if self._ends:
                raise EOFError("the picture was given up")


class Stored(Windows):
    """Some bands of an (H, W, bands) file of raw values, or of several side by side.

    Parameters
    ----------
    paths : sequence of Path
        Files from left to right.
    shape : (int, int, int)
        (H, W, bands) of the files together.
    dtype : dtype
    bands : (int, int)
        The first band, and the one after the last; a single one makes an (H, W) image.
    part : (int, int, int, int), optional
        A part of the picture: first row and column, and those after the last.
    column : int, optional
        Width of each file but the last, px; needed for several files.
    coming : Coming, optional
        The rows that are written so far; readers wait for others.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        shape: tuple[int, int, int],
        dtype: np.dtype,
        bands: tuple[int, int],
        part: tuple[int, int, int, int] | None = None,
        column: int | None = None,
        coming: Coming | None = None,
    ) -> None:
        first, stop = bands
        top, left, bottom, right = part or (0, 0, *shape[:2])
        size = bottom - top, right - left
        super().__init__(size if stop - first == 1 else (*size, stop - first), dtype)
        self.paths, self.file_shape, self.bands, self.corner = tuple(paths), shape, bands, (top, left)
        self.column = shape[1] if column is None else column
        self._coming = coming

    @property
    def widths(self) -> list[int]:
        """Widths of the files, px."""
        starts = (number * self.column for number in range(len(self.paths)))
        return [min(self.column, self.file_shape[1] - start) for start in starts]

    def lengthen(self) -> None:
        """Extend the files to their final lengths, so that written rows can be mapped.

        Raises
        ------
        OSError
        """
        height, _, bands = self.file_shape
        for path, width in zip(self.paths, self.widths, strict=True):
            os.truncate(path, height * width * bands * self.dtype.itemsize)

    def read(self, rows: slice, columns: slice) -> np.ndarray:
        """Return some rows and columns."""
        if self._coming is not None:
            self._coming.wait(self.corner[0] + rows.indices(self.shape[0])[1])
        first, stop, step = columns.indices(self.shape[1])
        parts, left = [], -self.corner[1]
        for path, width in zip(self.paths, self.widths, strict=True):
            begin = first + max(0, -(-(left - first) // step)) * step
            own = slice(begin - left, max(min(stop, left + width) - left, begin - left), step)
            left += width
            if begin < min(stop, left):
                parts.append(self._read(path, width, rows, own))
        if not parts:
            return self._read(self.paths[0], self.widths[0], rows, slice(0))
        return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)

    def _read(self, path: Path, width: int, rows: slice, columns: slice) -> np.ndarray:
        """Return some rows, and columns of one file."""
        first, stop = self.bands
        band: Any = first if self.ndim == 2 else slice(first, stop)
        # Mapped for this window only, as pages that stay mapped count as memory of the process. NumPy's
        # memmap resolves the whole path each time, which takes longer than reading a small window.
        with path.open("rb", buffering=0) as file:
            mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        shape = self.file_shape[0], width, self.file_shape[2]
        values = np.frombuffer(mapped, self.dtype, math.prod(shape)).reshape(shape)
        top = self.corner[0]
        return np.array(values[top : top + self.shape[0]][rows, columns, band])
