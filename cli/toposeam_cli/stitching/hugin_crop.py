"""Crop of a composition to a frame, as Hugin asks for it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.layers.canvas.layer import Box
from toposeam.layers.composite.composition import Outline


class Framed:
    """The part of a composition's plane that a frame shows, from 0,0 on; beyond the layers it is empty."""

    def __init__(self, composed: ts.layers.Composition, width: int, height: int) -> None:
        self._composed, self.shape = composed, (height, width)
        self.layers, self.names, self.rounds = composed.layers, composed.names, composed.rounds
        self.divides = False

    def part(self, rows: slice, columns: slice) -> Framed:
        """Return itself: a crop is not divided."""
        return self

    def window(self, rows: slice, columns: slice) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
        """Return the picture and its opacity."""
        here, there = self._common(rows, columns)
        part, opacity = self._composed.window(*there.slices)
        size = rows.stop - rows.start, columns.stop - columns.start
        image, alpha = np.zeros((*size, *part.shape[2:]), part.dtype), np.zeros(size, part.dtype)
        image[here.slices], alpha[here.slices] = part, opacity
        return image, alpha

    def labels(self, rows: slice, columns: slice) -> npt.NDArray[np.int16]:
        """Return the labels of the visible layers."""
        here, there = self._common(rows, columns)
        result = np.full((rows.stop - rows.start, columns.stop - columns.start), -1, np.int16)
        result[here.slices] = self._composed.labels(*there.slices)
        return result

    def outlines(self) -> Iterator[Outline]:
        """Nobody asks for them here."""
        return iter(())

    def _common(self, rows: slice, columns: slice) -> tuple[Box, Box]:
        """Intersect a window with the composition, in the window's and in the composition's coordinates."""
        x, y = self._composed.origin
        window = Box(rows.start, columns.start, rows.stop, columns.stop)
        inside = window.moved(-y, -x).shared(Box(0, 0, *self._composed.shape))
        if not all(inside.shape):
            return Box(0, 0, 0, 0), Box(0, 0, 0, 0)
        return inside.moved(y - window.top, x - window.left), inside
