"""Pixels in a file of raw values, read by windows."""

from __future__ import annotations

import math
import mmap
from pathlib import Path
from typing import Any

import numpy as np

from toposeam.images import Windows


class Stored(Windows):
    """Some bands of an (H, W, bands) file of raw values.

    Parameters
    ----------
    path : Path
    shape : (int, int, int)
        Of the file.
    dtype : dtype
    bands : (int, int)
        The first band, and the one after the last; a single one makes an (H, W) image.
    part : (int, int, int, int), optional
        First row and column, and those after the last, where not the whole file is meant.
    """

    def __init__(
        self,
        path: Path,
        shape: tuple[int, int, int],
        dtype: np.dtype,
        bands: tuple[int, int],
        part: tuple[int, int, int, int] | None = None,
    ) -> None:
        first, stop = bands
        top, left, bottom, right = part or (0, 0, *shape[:2])
        size = bottom - top, right - left
        super().__init__(size if stop - first == 1 else (*size, stop - first), dtype)
        self.path, self.file_shape, self.bands, self.corner = path, shape, bands, (top, left)

    def read(self, rows: slice, columns: slice) -> np.ndarray:
        """Some rows and columns."""
        first, stop = self.bands
        band: Any = first if self.ndim == 2 else slice(first, stop)
        # Mapped for this window only: pages that stay mapped count as memory of the process. NumPy's own maps
        # look up the whole path each time, which takes longer than reading a small window.
        with self.path.open("rb", buffering=0) as file:
            mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        values = np.frombuffer(mapped, self.dtype, math.prod(self.file_shape)).reshape(self.file_shape)
        (top, left), (height, width) = self.corner, self.shape[:2]
        return np.array(values[top : top + height, left : left + width][rows, columns, band])
