"""Tones: one gain per layer and channel, so that overlapping layers agree.

For each pair of overlapping layers and each channel the median of log a - log b over the pixels that both
have, neither in the dark nor burnt out, is one equation log g_b - log g_a = median; the gains g solve all of
them in the least-squares sense, weighted by pixels. The medians do not see what differs between the pictures
themselves, as long as that is less than half of the overlap. Gains are applied to the values as they are
encoded: for the tone curves in use (a power of light, near enough) a change of exposure is a gain there too.
Integers near full scale in all channels are let off: scaled down, burnt-out whites would turn gray.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from toposeam.images import Image
from toposeam.layers.layer import Box, Layer, check_layers, extent_of

#: Shares of full scale between which a pixel tells the exposure.
TELLING = (0.04, 0.97)
#: From this share of full scale in all channels on, gains below 1 let go, so that white stays white.
WHITE = 0.9
#: A gain is at most this, and at least its inverse.
LARGEST_GAIN = 4.0
#: Pixels of an overlap that are looked at, and those that are needed.
_SAMPLE, _ENOUGH = 250_000, 16
_ROWS = 256  # worked on at a time


def tone_gains(layers: Sequence[Layer], places: Sequence[Box]) -> npt.NDArray[np.float64]:
    """The gain of each layer and channel, (N, C); their geometric mean is 1 per channel, less where
    highlights would burn out.

    Parameters
    ----------
    layers : sequence of Layer
    places : sequence of Box
        Where each lies on the canvas.
    """
    count = len(layers)
    channels = max(1 if layer.image.ndim == 2 else layer.image.shape[2] for layer in layers)
    logarithm = np.zeros((count, channels))
    for channel in range(channels):
        rows, values = [], []
        for i in range(count):
            for j in range(i + 1, count):
                known = _log_ratio(layers[i], places[i], layers[j], places[j], channel)
                if known is not None:
                    row = np.zeros(count)
                    row[i], row[j] = -1.0, 1.0
                    weight = np.sqrt(known[1])
                    rows.append(weight * row)
                    values.append(weight * known[0])
        if rows:
            logarithm[:, channel] = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[
                0
            ]  # of least norm: mean 0 where joined
    gains = np.clip(np.exp(logarithm - logarithm.mean(axis=0)), 1 / LARGEST_GAIN, LARGEST_GAIN)
    room = min(_headroom(layer, gain) for layer, gain in zip(layers, gains, strict=True))
    scaled: npt.NDArray[np.float64] = gains * min(1.0, room)
    return scaled


def match_tones(layers: Sequence[Layer]) -> list[Layer]:
    """The layers with one gain per channel each, so that they agree where they overlap.

    Parameters
    ----------
    layers : sequence of Layer
        At least two, placed.

    Returns
    -------
    list of Layer
        Values are rounded and kept within their range; masks and places stay.

    Examples
    --------
    >>> dark, light = np.full((20, 30), 100, np.uint8), np.full((20, 30), 121, np.uint8)
    >>> first, second = match_tones([Layer(dark), Layer(light, at=(20, 0))])
    >>> int(first.image[0, 0]), int(second.image[0, 0])
    (110, 110)
    """
    layers = check_layers(layers)
    canvas = extent_of(layers)
    gains = tone_gains(layers, [canvas.place(layer) for layer in layers])
    return [
        dataclasses.replace(layer, image=_applied(layer, gain))
        for layer, gain in zip(layers, gains, strict=True)
    ]


def _plane(image: Image, channel: int) -> Image:
    if image.ndim == 2:
        return image
    return image[..., min(channel, image.shape[2] - 1)]


def _log_ratio(a: Layer, at_a: Box, b: Layer, at_b: Box, channel: int) -> tuple[float, int] | None:
    """The median of log a - log b over the pixels of both, and how many there are."""
    common = at_a.shared(at_b)
    if not all(common.shape):
        return None
    step = max(1, int(np.sqrt(common.shape[0] * common.shape[1] / _SAMPLE)))
    both = a.covered[common.within(at_a)][::step, ::step] & b.covered[common.within(at_b)][::step, ::step]
    values = []
    for layer, place in ((a, at_a), (b, at_b)):
        part = _plane(layer.image, channel)[common.within(place)][::step, ::step] / layer.white
        both &= (part > TELLING[0]) & (
            part < (TELLING[1] if np.issubdtype(layer.image.dtype, np.integer) else np.inf)
        )
        values.append(part)
    number = int(np.count_nonzero(both))
    if number < _ENOUGH:
        return None
    return float(np.median(np.log(values[0][both]) - np.log(values[1][both]))), number * step**2


def _headroom(layer: Layer, gain: npt.NDArray[np.float64]) -> float:
    """By what a layer's gains may be multiplied before more than a thousandth of its pixels burns out that
    had not before.
    """
    if not np.issubdtype(layer.image.dtype, np.integer):
        return np.inf
    room = np.inf
    step = max(1, int(np.sqrt(layer.covered.size / _SAMPLE)))
    covered = layer.covered[::step, ::step]
    for channel, factor in enumerate(gain):
        values = _plane(layer.image, channel)[::step, ::step][covered] / layer.white
        values = values[(values > TELLING[0]) & (values < TELLING[1])]
        if len(values):
            room = min(room, 1.0 / (float(np.quantile(values, 0.999)) * factor))
    return room


def _applied(layer: Layer, gain: npt.NDArray[np.float64]) -> Image:
    """The image times its gains; integers are rounded, and what is burnt out in all channels stays white."""
    image = layer.image
    count = 1 if image.ndim == 2 else image.shape[2]
    factor = np.asarray(gain.mean() if count == 1 else gain[np.minimum(np.arange(count), len(gain) - 1)])
    result = np.empty_like(image)
    for start in range(0, len(image), _ROWS):
        rows = slice(start, start + _ROWS)
        if not np.issubdtype(image.dtype, np.integer):
            result[rows] = image[rows] * factor
            continue
        limits = np.iinfo(image.dtype)
        share = image[rows].astype(np.float64) / layer.white
        darkest = share if image.ndim == 2 else share.min(axis=2, keepdims=True)
        burnt = np.clip((darkest - WHITE) / (1 - WHITE), 0, 1)
        burnt *= burnt * (3 - 2 * burnt)
        share = share * factor + np.maximum(0.0, 1 - factor) * burnt
        result[rows] = np.clip(np.rint(share * layer.white), limits.min, limits.max)
    return result
