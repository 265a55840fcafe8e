"""Panoramas that go all the way round: the right edge of the canvas goes on at the left one.

Such a canvas is a band without ends. It is cut where fewest layers lie beside each other and composed as
usual. Where one does, no seam runs there. Where several do, the canvas is then turned by half, so that the
cut lies in the middle, and what adjoins there is divided anew in a band round the cut while everything else
stays. Blending sees the canvas with some of its other end on both sides.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Labels, Mask
from toposeam.errors import OptionError
from toposeam.images import Windows, full_scale
from toposeam.layers.canvas.layer import Box, Extent, Layer
from toposeam.layers.canvas.tile_map import BLOCK, made_map, occupied_columns
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.search.two_label_band import SeamHeat

#: What adjoins at the cut is opened so far on either side, a share of the width, but no more than this many
#: pixels of the canvas, or this many px.
_BAND, _BAND_PIXELS, _LEAST_BAND = 16, 150_000, 32


class Turned(Windows):
    """Some columns of a source that goes round.

    Parameters
    ----------
    source : (h, w) or (h, w, C) array, or what reads like one
    place : int
        Column of the round canvas where the source begins.
    period : int
        Width of the round canvas, px; at least w.
    start, width : int
        The columns that are wanted: from `start`, which may lie beyond the period.
    """

    def __init__(self, source: Any, place: int, period: int, start: int, width: int) -> None:
        super().__init__((source.shape[0], width, *source.shape[2:]), source.dtype)
        self._source, self._first, self._period = source, start - place, period

    def read(self, rows: slice, columns: slice) -> npt.NDArray[Any]:
        """Some rows and columns, 0 where the source has none."""
        if columns.step != 1:
            return self.read(rows, slice(columns.start, columns.stop, 1))[:, :: columns.step]
        height, width = len(range(*rows.indices(self.shape[0]))), columns.stop - columns.start
        result = np.zeros((height, width, *self.shape[2:]), self.dtype)
        at = columns.start
        while at < columns.stop:
            there = (at + self._first) % self._period
            # Up to the end of the period, and from it to the source's own end.
            stop = min(columns.stop, at + self._period - there)
            known = min(max(self._source.shape[1] - there, 0), stop - at)
            if known:
                part = self._source[rows, there : there + known]
                result[:, at - columns.start : at - columns.start + known] = part
            at = stop
        return result


def turned(layer: Layer, period: int, start: int) -> Layer:
    """A layer on the round canvas as it lies when that is cut at column `start`; as narrow as it can be.

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
    occupied = np.roll(_columns(layer, period), -start)
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
    """A layer on a round canvas in one piece, if that was cut inside of it: it then reaches over the end."""
    gaps = np.flatnonzero(~_columns(layer, period))
    if layer.image.shape[1] < period or not len(gaps):
        return layer
    runs = np.split(gaps, np.flatnonzero(np.diff(gaps) > 1) + 1)
    start = int(max(runs, key=len)[0])
    part = turned(layer, period, start)
    return dataclasses.replace(part, at=(part.at[0] + start, part.at[1]))


def _columns(layer: Layer, period: int) -> npt.NDArray[np.bool_]:
    """(period,) bool: columns of the round canvas in which a layer has pixels."""
    width = layer.image.shape[1]
    found = np.ones(width, bool) if layer.alpha is None else occupied_columns(layer.alpha)
    result = np.zeros(period, bool)
    result[(np.flatnonzero(found) + layer.at[0]) % period] = True
    return result


def best_cut(layers: Sequence[Layer], period: int) -> tuple[int, int]:
    """The column at which fewest layers lie, of several the middle of the widest run; and how many do."""
    count = np.sum([_columns(layer, period) for layer in layers], axis=0)
    fewest = count == count.min()
    if fewest.all():
        return 0, int(count[0])
    start = int(np.flatnonzero(~fewest)[0])
    edges = np.flatnonzero(np.diff(np.append(np.roll(fewest, -start), False).astype(np.int8)))
    first, last = edges[::2] + 1, edges[1::2] + 1
    longest = int(np.argmax(last - first))
    return (start + (int(first[longest]) + int(last[longest])) // 2) % period, int(count.min())


def turned_map(label_map: Any, period: int, start: int, width: int) -> Labels:
    """Some columns of a map of labels on a round canvas, from column `start`."""
    source = _Plus(label_map)
    columns = Turned(source, 0, period, start, width)

    def values(box: Box) -> npt.NDArray[Any]:
        result: npt.NDArray[Any] = columns[box.slices] - np.int16(1)
        return result

    return made_map((label_map.shape[0], width), np.int16, values)


def turned_gathered(
    given: Sequence[tuple[Mapping[Pair, SeamHeat], int]], period: int
) -> dict[Pair, SeamHeat]:
    """The heat along seams of canvases that begin at some columns of the round one, as on that; later label
    potentials count.
    """
    found: dict[Pair, list[SeamHeat]] = {}
    for gathered, start in given:
        for pair, heat in gathered.items():
            rows, columns, values = heat.potential
            moved = rows, (columns + start) % period, values
            found.setdefault(pair, []).append(dataclasses.replace(heat, potential=moved))
    result: dict[Pair, SeamHeat] = {}
    for pair, parts in found.items():
        potentials = zip(*(heat.potential for heat in parts), strict=True)
        rows, columns, values = (np.concatenate(part) for part in potentials)
        result[pair] = dataclasses.replace(parts[0], potential=(rows, columns, values))
    return result


class _Plus(Windows):
    """Labels plus 1, so that 0 is none."""

    def __init__(self, label_map: Any) -> None:
        super().__init__(label_map.shape, np.int16)
        self._map = label_map

    def read(self, rows: slice, columns: slice) -> npt.NDArray[Any]:
        """Some rows and columns."""
        result: npt.NDArray[Any] = self._map[rows, columns] + np.int16(1)
        return result


def band(shape: tuple[int, int]) -> Mask:
    """(H, W) bool: the middle columns of a canvas."""
    half = max(8, min(shape[1] // _BAND, max(_LEAST_BAND, _BAND_PIXELS // (2 * shape[0]))))
    middle = shape[1] // 2

    def values(box: Box) -> Mask:
        columns = np.arange(box.left, box.right)
        return np.broadcast_to(np.abs(columns - middle) < half, box.shape)

    return made_map(shape, bool, values)


def margin(width: int) -> int:
    """How much of the other end blending sees, px."""
    return min(4 * BLOCK, width // BLOCK * BLOCK) or width


def unrolled(layer: Layer, period: int, beyond: int) -> Layer:
    """A layer on the round canvas with some of the other end on both sides, all of it one layer."""
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


def round_canvas(layers: Sequence[Layer], period: int) -> Extent:
    """The canvas: its left edge at 0 where all layers lie right of that, else at the leftmost layer."""
    left = min(layer.at[0] for layer in layers)
    right = max(layer.at[0] + layer.image.shape[1] for layer in layers)
    origin = 0 if left >= 0 and right <= period else left
    top = min(layer.at[1] for layer in layers)
    bottom = max(layer.at[1] + layer.image.shape[0] for layer in layers)
    return Extent(origin=(origin, top), shape=(bottom - top, period))
