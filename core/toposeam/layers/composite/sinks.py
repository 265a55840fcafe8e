"""Where the windows of a picture go: arrays here; files, and what draws on a screen, are sinks of others."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from toposeam.arrays import Image
from toposeam.layers.canvas.layer import Box


class Sink(ABC):
    """What takes a picture window by window, as :meth:`toposeam.layers.Composition.render` gives it.

    Examples
    --------
    >>> import toposeam as ts
    >>> class Brightest(ts.layers.Sink):
    ...     found = 0.0
    ...     def write(self, box, pixels, alpha):
    ...         return float(pixels.max())
    ...     def take(self, box, answer):
    ...         self.found = max(self.found, answer)
    >>> a, b = np.zeros((2, 30, 40)); b[3, 30] = 0.75
    >>> sink = Brightest()
    >>> ts.stitch(ts.layers.overlapping(a, b, overlap=10)).render(sink)
    >>> sink.found
    0.75
    """

    def open(self, shape: tuple[int, ...], dtype: np.dtype) -> None:  # noqa: B027 - most need none
        """Begin a picture of (H, W) or (H, W, C) and its (H, W) opacity, both of one dtype."""

    @abstractmethod
    def write(self, box: Box, pixels: Image, alpha: Image) -> Any:
        """Take a window.

        Where an executor computes windows this is called in its processes, on a copy of the sink.

        Parameters
        ----------
        box : Box
            On the picture.
        pixels : (h, w[, C]) array
        alpha : (h, w) array
            Opacity, up to full scale.

        Returns
        -------
        object
            What :meth:`take` is to know.
        """

    def take(self, box: Box, answer: Any) -> None:  # noqa: B027 - most need none
        """Take note, in this process and in the order of the windows, of what writing one has returned."""

    def close(self) -> None:  # noqa: B027 - most need none
        """End the picture."""


class ArraySink(Sink):
    """Keeps the picture as arrays."""

    image: Image
    alpha: Image

    def open(self, shape: tuple[int, ...], dtype: np.dtype) -> None:
        """Begin with zeros."""
        self.image, self.alpha = np.zeros(shape, dtype), np.zeros(shape[:2], dtype)

    def write(self, box: Box, pixels: Image, alpha: Image) -> tuple[Image, Image]:
        """Hand the window on, from wherever it was computed."""
        return pixels, alpha

    def take(self, box: Box, answer: tuple[Image, Image]) -> None:
        """Keep it."""
        self.image[box.slices], self.alpha[box.slices] = answer
