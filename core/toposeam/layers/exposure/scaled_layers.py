"""Layers whose light is multiplied, window by window."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Image, Mask
from toposeam.images import Windows, in_dtype
from toposeam.layers.canvas.layer import Box, Layer
from toposeam.layers.exposure.linear_light import KNEE, STRAIGHT, decoded, encoded, finished, multiplied
from toposeam.layers.exposure.shading import weights_along

#: From this share of full scale in all channels on, gains let go, so that white stays white.
WHITE = 0.9
#: From this share of full scale on values may roll off: that of the knee, or what is rounded to below it.
_ROLLING = float(encoded(KNEE)) - 0.5 / 255
_ROWS = 16  # worked on at a time


class Field(NamedTuple):
    """A layer's field of gain."""

    coefficients: npt.NDArray[np.float64]
    #: Where it spans in the layer; beyond, it goes on as at the edge.
    box: Box

    def across(self, columns: range) -> npt.NDArray[np.float64]:
        """What rows' weights are multiplied by at some columns of the layer, (5, n)."""
        width = self.box.shape[1]
        return self.coefficients @ weights_along(width, np.asarray(columns) - self.box.left).T

    def logarithm(self, rows: range, across: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """The logarithm of the gain at some rows of the layer, and columns of which :meth:`across` tells."""
        return weights_along(self.box.shape[0], np.asarray(rows) - self.box.top) @ across


class Toned(Windows):
    """A layer's light times its gains, encoded again, computed where it is looked at.

    Without `top` values are light, and only multiplied.
    """

    def __init__(
        self,
        layer: Layer,
        gain: npt.NDArray[np.float64],
        field: Field | None = None,
        top: float | None = 1.0,
    ) -> None:
        super().__init__(layer.image.shape, layer.image.dtype)
        self._image, self._white, self._top = layer.image, layer.white, top
        count = 1 if self.ndim == 2 else self.shape[2]
        self._factor = (
            gain.mean(keepdims=True) if count == 1 else gain[np.minimum(np.arange(count), len(gain) - 1)]
        )
        self._field = field
        self._tables = self._made_tables()

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_tables"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._tables = self._made_tables()

    def _made_tables(self) -> npt.NDArray[np.float32] | None:
        """What every value becomes in each channel before highlights roll off, as a share of white."""
        if self._field is not None or self._top is None or self.dtype not in (np.uint8, np.uint16):
            return None
        light = decoded(np.arange(np.iinfo(self.dtype).max + 1) / self._white)
        return encoded(light * self._factor[:, np.newaxis]).astype(np.float32)

    def read(self, rows: slice, columns: slice) -> Image:
        """Some rows and columns."""
        image = self._image[rows, columns]
        if self._field is None and (self._factor == 1).all() and self._top in (None, 1.0):
            return image.copy()
        planes = image[..., np.newaxis] if self.ndim == 2 else image
        result = np.empty(planes.shape, self.dtype)
        rounded = None if self._tables is None else in_dtype(self._tables * self._white, self.dtype)
        down, right = (
            range(*one.indices(size)) for one, size in zip((rows, columns), self.shape[:2], strict=True)
        )
        across = None if self._field is None else self._field.across(right)
        for start in range(0, len(planes), _ROWS):
            part = slice(start, start + _ROWS)
            block = planes[part]
            field = np.zeros((1, 1))
            if self._field is not None and across is not None:
                field = self._field.logarithm(down[part], across)
            if self._top is None:
                result[part] = block * (np.exp(field)[..., np.newaxis] * self._factor)
            elif rounded is None:
                reckoned = in_dtype(self._reckoned(block, field) * self._white, self.dtype)
                for channel, plane in enumerate(reckoned):
                    result[part, :, channel] = plane.reshape(block.shape[:2])
            else:
                for channel, table in enumerate(rounded):
                    result[part, :, channel] = table.take(block[..., channel])
                self._finish(block, result[part])
        return result.reshape(image.shape)

    def _finish(self, block: Image, result: Image) -> None:
        """Mend what tables of one channel cannot know."""
        darkest, lightest = _over_channels(np.minimum, block), _over_channels(np.maximum, result)
        bright = self._bright(darkest, lightest, self._white)
        if self._tables is None or not bright.any():
            return
        chosen = [block[..., channel][bright] for channel in range(len(self._tables))]
        raised = np.stack([table.take(one) for table, one in zip(self._tables, chosen, strict=True)])
        shares = np.stack(chosen) / np.float32(self._white)
        whites = encoded(self._factor[:, np.newaxis]).astype(np.float32)
        done = in_dtype(finished(shares, raised, whites, self._top or 1.0, WHITE) * self._white, self.dtype)
        for channel, plane in enumerate(done):
            result[..., channel][bright] = plane

    def _reckoned(self, block: Image, field: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
        """(C, h w) what becomes of values without tables, as shares of white; a field's logarithm."""
        kind = np.dtype(np.float32 if self.dtype.itemsize <= 4 else np.float64).type
        count = block.shape[2]
        shares = np.empty((count, block.shape[0] * block.shape[1]), kind)  # one channel after the other
        for plane, one in zip(shares, np.moveaxis(block, 2, 0), strict=True):
            np.divide(one, kind(self._white), out=plane.reshape(one.shape))
        logarithm = np.broadcast_to(field, block.shape[:2]).ravel().astype(kind)
        factor = self._factor[:, np.newaxis].astype(kind)
        root = np.exp(logarithm * kind(1 / 2.4)) * factor ** kind(1 / 2.4)
        raised = multiplied(shares, root)
        darkest = shares.min(axis=0)
        dark = np.flatnonzero(np.minimum(darkest, raised.min(axis=0)) < STRAIGHT)
        if len(dark):
            raised[:, dark] = encoded(decoded(shares[:, dark]) * np.exp(logarithm[dark]) * factor)
        bright = np.flatnonzero(self._bright(darkest, raised.max(axis=0), 1.0))
        if len(bright):
            whites = multiplied(np.ones((1, 1), kind), root[:, bright])
            raised[:, bright] = finished(
                shares[:, bright], raised[:, bright], whites, self._top or 1.0, WHITE
            )
        return raised

    def _bright(self, darkest: npt.NDArray[Any], lightest: npt.NDArray[Any], white: float) -> Mask:
        """Where channels depend on each other: where all are almost white or one is beyond the knee."""
        found: Mask = darkest > WHITE * white
        if self._top != 1.0:
            found |= lightest > _ROLLING * white
        return found


def _over_channels(function: np.ufunc, planes: Image) -> Image:
    """(h, w): faster than along the last axis."""
    extremes: Image = functools.reduce(function, np.moveaxis(planes, -1, 0))
    return extremes
