"""Sinks take a picture window by window: arrays here; files and displays elsewhere."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from toposeam.arrays import Image
from toposeam.layers.canvas.layer import Box


class Sink(ABC):
    """A target of :meth:`toposeam.layers.Composition.render`, which takes the picture window by window.

    :meth:`open` is called first, :meth:`close` last. Between them each window is passed to :meth:`write`,
    perhaps in another process, and what that returns to :meth:`take` in this process.

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
        """Begin a picture of shape (H, W) or (H, W, C), with an (H, W) opacity, both of `dtype`."""

    @abstractmethod
    def write(self, box: Box, pixels: Image, alpha: Image) -> Any:
        """Take a window of the picture.

        If an executor computes the windows, this is called in its processes, on a copy of the sink.

        Parameters
        ----------
        box : Box
            The window, in px of the picture.
        pixels : (h, w[, C]) array
        alpha : (h, w) array
            Opacity in the dtype of the pixels, from 0 to full scale.

        Returns
        -------
        object
            Passed to :meth:`take`.
        """

    def take(self, box: Box, answer: Any) -> None:  # noqa: B027 - most need none
        """Receive what :meth:`write` returned; called in this process, in the order of the windows."""

    def close(self) -> None:  # noqa: B027 - most need none
        """End the picture."""


class ArraySink(Sink):
    """A sink that collects the picture in two arrays in memory.

    `image` is (H, W) or (H, W, C) and `alpha`, the opacity, (H, W), both in the dtype of the layers; they
    exist from :meth:`open` on.

    Examples
    --------
    >>> import toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 30, 40))
    >>> sink = ts.layers.ArraySink()
    >>> ts.stitch(ts.layers.overlapping(a, b, overlap=10)).render(sink)
    >>> sink.image.shape, sink.alpha.shape, bool((sink.image[:, 60:] == b[:, 30:]).all())
    ((30, 70), (30, 70), True)
    """

    image: Image
    alpha: Image

    def open(self, shape: tuple[int, ...], dtype: np.dtype) -> None:
        """Allocate the picture and its opacity, all zeros."""
        self.image, self.alpha = np.zeros(shape, dtype), np.zeros(shape[:2], dtype)

    def write(self, box: Box, pixels: Image, alpha: Image) -> tuple[Image, Image]:
        """Return the window, for :meth:`take`."""
        return pixels, alpha

    def take(self, box: Box, answer: tuple[Image, Image]) -> None:
        """Copy the window into the picture."""
        self.image[box.slices], self.alpha[box.slices] = answer
