"""Layers and label maps on a round canvas, read from any column on."""

from __future__ import annotations

import dataclasses
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Labels, Mask
from toposeam.errors import OptionError
from toposeam.images import Windows, full_scale
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.canvas.tile_map import made_map, occupied_columns


class Turned(Windows):
    """A window of columns of a source on a round canvas, read on demand.

    Parameters
    ----------
    source : (h, w) or (h, w, C) array, or what reads like one
    place : int
        Column of the round canvas where the source begins.
    period : int
        Width of the round canvas, px; at least w.
    start, width : int
        The window's first column, which may lie beyond the period, and its number of columns.
    missing : int
        The value where the source has none.
    """

    def __init__(
        self, source: Any, place: int, period: int, start: int, width: int, missing: int = 0
    ) -> None:
        super().__init__((source.shape[0], width, *source.shape[2:]), source.dtype)
        self._source, self._first, self._period = source, start - place, period
        self._missing = missing

    def read(self, rows: slice, columns: slice) -> npt.NDArray[Any]:
        """Return some rows and columns, 0 where the source has none."""
        if columns.step != 1:
            return self.read(rows, slice(columns.start, columns.stop, 1))[:, :: columns.step]
        height, width = len(range(*rows.indices(self.shape[0]))), columns.stop - columns.start
        result = np.full((height, width, *self.shape[2:]), self._missing, self.dtype)
        at = columns.start
        while at < columns.stop:
            there = (at + self._first) % self._period
            # Read to the end of the period, of which the source may fill less.
            stop = min(columns.stop, at + self._period - there)
            known = min(max(self._source.shape[1] - there, 0), stop - at)
            if known:
                part = self._source[rows, there : there + known]
                result[:, at - columns.start : at - columns.start + known] = part
            at = stop
        return result


def turned(layer: Layer, period: int, start: int) -> Layer:
    """Return a layer as it lies on a round canvas that is cut open at column `start`, without empty columns.

    Raises
    ------
    OptionError
        When the layer is wider than the canvas.
    """
    height, width = layer.image.shape[:2]
    x, y = layer.at
    if width > period:
        raise OptionError(
            "{name} is {width} px wide, but the panorama {period} px; give a larger width",
            kind="number",
            name=layer.name,
            width=width,
            period=period,
        )
    occupied = np.roll(occupied_on(layer, period, x), -start)
    used = np.flatnonzero(occupied)
    first, stop = (int(used[0]), int(used[-1]) + 1) if len(used) else (0, 1)

    def part(source: Any) -> Any:
        return None if source is None else Turned(source, x, period, start + first, stop - first)

    image, alpha = part(layer.image), part(layer.alpha)
    if layer.alpha is None and not occupied[first:stop].all():
        opaque = np.broadcast_to(np.asarray(full_scale(layer.image.dtype)), (height, width))
        alpha = part(opaque)
    mask, keep = (
        None if given is None else np.asarray(part(np.asarray(given))) for given in (layer.mask, layer.keep)
    )
    return dataclasses.replace(layer, image=image, alpha=alpha, mask=mask, keep=keep, at=(first, y))


def narrowed(layer: Layer, period: int) -> Layer:
    """Return a layer that was cut in two by the canvas's ends as one piece, which reaches beyond the right
    end.
    """
    gaps = np.flatnonzero(~occupied_on(layer, period, layer.at[0]))
    if layer.image.shape[1] < period or not len(gaps):
        return layer
    runs = np.split(gaps, np.flatnonzero(np.diff(gaps) > 1) + 1)
    start = int(max(runs, key=len)[0])
    part = turned(layer, period, start)
    return dataclasses.replace(part, at=(part.at[0] + start, part.at[1]))


def occupied_on(layer: Layer, period: int, left: int) -> Mask:
    """(period,) bool: True at the columns of a round canvas in which a layer that begins at `left` has
    pixels.
    """
    width = layer.image.shape[1]
    found = np.ones(width, bool) if layer.alpha is None else occupied_columns(layer.alpha)
    result = np.zeros(period, bool)
    result[(np.flatnonzero(found) + left) % period] = True
    return result


def turned_map(label_map: Any, period: int, start: int, width: int) -> Labels:
    """Return some columns of a label map of a round canvas, from column `start` on."""
    columns = Turned(label_map, 0, period, start, width, missing=-1)
    return made_map((label_map.shape[0], width), np.int16, lambda box: columns[box.slices])


def unrolled(layer: Layer, period: int, beyond: int) -> Layer:
    """Return a layer as wide as a round canvas that is extended by `beyond` px of the other end on both
    sides.
    """
    height, width = layer.image.shape[:2]
    alpha = layer.alpha
    if alpha is None:
        alpha = np.broadcast_to(np.asarray(full_scale(layer.image.dtype)), (height, width))
    wide = period + 2 * beyond
    return Layer(
        cast("npt.NDArray[Any]", Turned(layer.image, layer.at[0], period, -beyond, wide)),
        alpha=cast("npt.NDArray[Any]", Turned(alpha, layer.at[0], period, -beyond, wide)),
        at=(-beyond, layer.at[1]),
        name=layer.name,
        data_range=layer.data_range,
    )
