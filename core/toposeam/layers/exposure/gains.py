"""Tones: one gain per layer and channel, so that overlapping layers agree.

Gains are about light, where a change of exposure is one. Integers, and floats that hardly go beyond white,
are taken for encoded as sRGB: they are decoded, multiplied and encoded again
(:mod:`toposeam.layers.exposure.linear_light`). When of any layer's floats more than a thousandth lie well
beyond white, the floats of all are taken for light itself and only multiplied.

For each pair of overlapping layers and each channel the median of log a - log b over the pixels that both
have, neither in the dark nor burnt out, is one equation log g_b - log g_a = median; the gains g solve all of
them in the least-squares sense, weighted by pixels. The medians do not see what differs between the pictures
themselves, as long as that is less than half of the overlap. Weighted by the layers' pixels the gains'
geometric mean is 1, so that the whole keeps its brightness. Where an overlap is all dark or burnt out, the
exposures that the layers state are compared instead. What would go beyond white rolls off, in all
layers alike, so that they still agree; what is burnt out stays white: scaled down, it would turn gray.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Image, Mask
from toposeam.checks import check_choice
from toposeam.images import Windows, check_values
from toposeam.layers.canvas.canvas import extent_of
from toposeam.layers.canvas.layer import Box, Layer, check_layers
from toposeam.layers.execution.tasks import Executor, check_executor, results
from toposeam.layers.exposure.linear_light import decoded, light_of
from toposeam.layers.exposure.scaled_layers import Field, Toned
from toposeam.layers.exposure.shading import shading as field_coefficients

#: Light between which a pixel tells the exposure: that of shares 0.04 and 0.97 of full scale.
TELLING = float(decoded(0.04)), float(decoded(0.97))
#: And between which it is something bright that is to show, and not burnt out.
_SHOWING = TELLING[0], float(decoded(0.995))
#: A gain is at most this, and at least its inverse: four stops.
LARGEST_GAIN = 16.0
#: Floats are light itself when more than so large a share of a layer's lies beyond so many times white.
_BEYOND, _MUCH = 0.001, 1.05
#: Pixels of an overlap that are looked at, and those that are needed.
_SAMPLE, _ENOUGH = 250_000, 16
_BURNT = 0.999  # of the pixels stay below white


class Sight(NamedTuple):
    """What is seen of a layer by itself."""

    #: Of each channel the brightest light but for a thousandth.
    brightest: list[float]
    #: Pixels that may show, about.
    pixels: int
    #: The part of the canvas that they fill, about.
    box: Box


def tone_gains(
    layers: Sequence[Layer], places: Sequence[Box], executor: Executor | None = None, linear: bool = False
) -> tuple[npt.NDArray[np.float64], list[Sight]]:
    """The gain of each layer and channel, (N, C), of geometric mean 1 per channel, weighted by the layers'
    pixels; and how the layers look.

    Parameters
    ----------
    layers : sequence of Layer
    places : sequence of Box
        Where each lies on the canvas.
    executor : Executor, optional
        Where pairs are compared.
    linear : bool
        Whether values are light itself.
    """
    count = len(layers)
    channels = max(1 if layer.image.ndim == 2 else layer.image.shape[2] for layer in layers)
    logarithm = np.zeros((count, channels))
    later = [[j for j in range(i + 1, count) if all(places[i].shared(places[j]).shape)] for i in range(count)]
    placed = list(zip(layers, places, strict=True))
    items = [(*placed[i], [placed[j] for j in later[i]], channels, linear) for i in range(count)]
    seen = list(results(executor, _compared, items))
    known = {(i, j): ratios for i in range(count) for j, ratios in zip(later[i], seen[i][0], strict=True)}
    looks = [look for _, look in seen]
    share = np.sqrt([max(1, look.pixels) for look in looks])
    for channel in range(channels):
        rows, values = [], []
        for (i, j), ratios in known.items():
            if (found := ratios[channel] or _stated(layers[i], layers[j])) is not None:
                ratio, pixels = found
                row = np.zeros(count)
                row[i], row[j] = -1.0, 1.0
                weight = np.sqrt(pixels)
                rows.append(weight * row / share)
                values.append(weight * ratio)
        if rows:  # of least norm: each joined group's weighted mean is 0
            logarithm[:, channel] = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0] / share
    return np.clip(np.exp(logarithm), 1 / LARGEST_GAIN, LARGEST_GAIN), looks


def match_tones(
    layers: Sequence[Layer], *, shading: bool = False, executor: Executor | None = None
) -> list[Layer]:
    """The layers with one gain per channel each, so that they agree where they overlap.

    Parameters
    ----------
    layers : sequence of Layer
        At least two, placed.
    shading : bool
        Also give each layer a smooth field of gain, against lenses that darken towards the corners
        (:mod:`toposeam.layers.exposure.shading`).
    executor : Executor, optional
        Where pairs are compared (:mod:`toposeam.layers.execution.tasks`).

    Returns
    -------
    list of Layer
        Values are rounded and kept within their range; masks and places stay.

    Raises
    ------
    ImageError
        Where nobody says which value is white: for integers but uint8 and uint16, and floats like those in
        0..255.

    Examples
    --------
    >>> dark, light = np.full((20, 30), 100, np.uint8), np.full((20, 30), 121, np.uint8)
    >>> first, second = match_tones([Layer(dark), Layer(light, at=(20, 0))])
    >>> int(first.image[0, 0]), int(second.image[0, 0])
    (110, 110)
    """
    layers = check_layers(layers)
    check_choice("shading", shading, (True, False))
    check_executor(executor)
    for layer in layers:
        if not isinstance(layer.image, Windows):
            check_values(layer.image, layer.title, layer.data_range)  # what is white is known
    canvas = extent_of(layers)
    places = [canvas.place(layer) for layer in layers]
    floats = [layer for layer in layers if np.issubdtype(layer.image.dtype, np.floating)]
    linear = any(list(results(executor, _beyond_white, floats)))
    gains, looks = tone_gains(layers, places, executor, linear)
    brightest = [look.brightest for look in looks]
    fields: Sequence[Field | None] = [None] * len(layers)
    if shading:
        fields = _fields(layers, places, [look.box for look in looks], gains, linear)
        items = [(*one, gains.shape[1]) for one in zip(layers, fields, strict=True)]
        brightest = [look.brightest for look in results(executor, _look, items)]
    top = None if linear else max(1.0, float((np.array(brightest) * gains).max()))
    toned = [Toned(*one, top) for one in zip(layers, gains, fields, strict=True)]
    return [
        dataclasses.replace(layer, image=image if isinstance(layer.image, Windows) else image[:, :])
        for layer, image in zip(layers, toned, strict=True)
    ]


def _fields(
    layers: Sequence[Layer],
    places: Sequence[Box],
    filled: Sequence[Box],
    gains: npt.NDArray[np.float64],
    linear: bool,
) -> list[Field]:
    """Each layer's field, on the part that it fills: canvases of warped pictures are mostly empty."""

    def ratios(i: int, j: int, common: Box) -> tuple[npt.NDArray[np.float64], int]:
        planes, step = _both((layers[i], places[i]), (layers[j], places[j]), common, gains.shape[1], linear)
        logarithms = [
            np.where(
                known, np.log(np.where(known, a, 1) * gain_a) - np.log(np.where(known, b, 1) * gain_b), np.nan
            )
            for (a, b, known), gain_a, gain_b in zip(planes, gains[i], gains[j], strict=True)
        ]
        return np.mean(logarithms, axis=0), step

    return [
        Field(coefficients, box.moved(-place.top, -place.left))
        for coefficients, box, place in zip(field_coefficients(filled, ratios), filled, places, strict=True)
    ]


def _stated(a: Layer, b: Layer) -> tuple[float, int] | None:
    """What the exposures of two layers say in place of :func:`_log_ratios`, with little weight."""
    if a.exposure is None or b.exposure is None:
        return None
    return float(np.log(a.exposure) - np.log(b.exposure)), _ENOUGH


def _compared(
    item: tuple[Layer, Box, list[tuple[Layer, Box]], int, bool],
) -> tuple[list[list[tuple[float, int] | None]], Sight]:
    """What :func:`_log_ratios` tells of a placed layer and each of some others, and how it looks."""
    layer, place, others, channels, linear = item
    ratios = [_log_ratios((layer, place, *other, channels, linear)) for other in others]
    look = _look((layer, None, channels))
    return ratios, look._replace(box=look.box.moved(place.top, place.left))


def _log_ratios(item: tuple[Layer, Box, Layer, Box, int, bool]) -> list[tuple[float, int] | None]:
    """Of two placed layers, per channel, the median of log a - log b over the pixels of both, and how many
    there are.
    """
    a, at_a, b, at_b, channels, linear = item
    if a.image.dtype == b.image.dtype == np.uint8:
        return _log_ratios_of_bytes(a, at_a, b, at_b, channels)
    found: list[tuple[float, int] | None] = []
    planes, step = _both((a, at_a), (b, at_b), at_a.shared(at_b), channels, linear)
    for one, other, both in planes:
        number = int(np.count_nonzero(both))
        ratio = None if number < _ENOUGH else float(np.median(np.log(one[both]) - np.log(other[both])))
        found.append(None if ratio is None else (ratio, number * step**2))
    return found


def _log_ratios_of_bytes(
    a: Layer, at_a: Box, b: Layer, at_b: Box, channels: int
) -> list[tuple[float, int] | None]:
    """The same where there are 256 values: their pairs are ranked once for all, and the ranks sorted, which
    takes less than a logarithm of each and sorting these.
    """
    step = _step(at_a.shared(at_b))
    (one, on_a), (other, on_b) = (_seen(*layer, at_a.shared(at_b), step) for layer in ((a, at_a), (b, at_b)))
    known = np.broadcast_to(on_a & on_b, one.shape[:2])
    ranks, ratios = _ranked(a.white, b.white)
    found: list[tuple[float, int] | None] = []
    for channel in range(channels):
        first, second = (part[..., min(channel, part.shape[2] - 1)] for part in (one, other))
        codes = first.astype(np.uint16)
        codes <<= 8
        codes |= second
        order = np.sort(ranks.take(_chosen(codes, known)), kind="stable")
        number = int(np.searchsorted(order, np.uint16(len(ratios))))
        middle = order[[(number - 1) // 2, number // 2]] if number >= _ENOUGH else None
        found.append(None if middle is None else (float(ratios[middle].mean()), number * step**2))
    return found


@functools.lru_cache(maxsize=8)
def _ranked(white_a: float, white_b: float) -> tuple[npt.NDArray[np.uint16], npt.NDArray[np.float64]]:
    """Of all pairs of bytes, 256 a + b, the rank of log a - log b among those that tell the exposure, more
    than there are for the others; and these, in order.
    """
    shares = [decoded(np.arange(256) / white) for white in (white_a, white_b)]
    telling = np.logical_and.outer(*((share > TELLING[0]) & (share < TELLING[1]) for share in shares)).ravel()
    logarithms = [np.log(share, out=np.zeros(256), where=share > 0) for share in shares]
    ratios = np.subtract.outer(*logarithms).ravel()[telling]
    order = np.argsort(ratios)
    ranks = np.full(len(telling), len(ratios), np.uint16)
    ranks[np.flatnonzero(telling)[order]] = np.arange(len(order))
    return ranks, ratios[order]


def _both(
    a: tuple[Layer, Box], b: tuple[Layer, Box], common: Box, channels: int, linear: bool
) -> tuple[list[tuple[npt.NDArray[Any], npt.NDArray[Any], Mask]], int]:
    """Per channel the light of two placed layers where both have pixels, and where it tells the exposure;
    every so many-th pixel.
    """
    step = _step(common)
    known: Mask = np.ones((1, 1), bool)
    values = []
    for layer, place in (a, b):
        part, covered = _seen(layer, place, common, step)
        known = known & covered
        values.append(part / layer.white if linear else light_of(part, layer.white))
    found = []
    for channel in range(channels):
        both = known
        planes = [part[..., min(channel, part.shape[2] - 1)] for part in values]
        for plane in planes:
            both = both & (plane > TELLING[0]) & (plane < (np.inf if linear else TELLING[1]))
        found.append((planes[0], planes[1], both))
    return found, step


def _step(common: Box) -> int:
    """Every so many-th pixel of an overlap is looked at."""
    return max(1, int(np.sqrt(common.shape[0] * common.shape[1] / _SAMPLE)))


def _seen(layer: Layer, place: Box, common: Box, step: int) -> tuple[Image, Mask]:
    """What is looked at of a placed layer, and where it may show."""
    inside = common.moved(-place.top, -place.left)
    return _every(layer.image, inside, step), _covered(layer, inside, step)


def _every(image: Image, box: Box, step: int) -> Image:
    """Every so many-th pixel of a window, (h, w, C)."""
    part = image[box.top : box.bottom : step, box.left : box.right : step]
    return part[..., np.newaxis] if part.ndim == 2 else part


def _covered(layer: Layer, box: Box, step: int) -> Mask:
    """Where every so many-th pixel of a window may show."""
    key = slice(box.top, box.bottom, step), slice(box.left, box.right, step)
    covered = np.ones((1, 1), bool) if layer.alpha is None else layer.alpha[key] > 0
    return covered if layer.mask is None else covered & np.asarray(layer.mask)[key]


def _beyond_white(layer: Layer) -> bool:
    """Whether more than a few of a layer's values lie well beyond white."""
    image, covered, _ = _sampled(layer)
    return bool((_chosen(image, covered) > _MUCH * layer.white).mean() > _BEYOND) if covered.any() else False


def _look(item: tuple[Layer, Field | None, int]) -> Sight:
    """How a layer, which a field may raise, looks: channels' brightest light is 0 where nothing tells it, and
    the box lies in the layer.
    """
    layer, field, channels = item
    image, covered, step = _sampled(layer)
    height, width = layer.image.shape[:2]
    found = []
    for channel in range(channels):
        values = _chosen(image[..., min(channel, image.shape[2] - 1)], covered)
        if field is None and values.dtype in (np.uint8, np.uint16):
            found.append(_counted(values, layer.white))
            continue
        light = light_of(values, layer.white)
        telling = (light > _SHOWING[0]) & (light < _SHOWING[1])
        if field is not None:
            across = field.across(range(0, width, step))
            light = light * _chosen(np.exp(field.logarithm(range(0, height, step), across)), covered)
        found.append(float(np.quantile(light[telling], _BURNT)) if telling.any() else 0.0)
    box = Box(0, 0, height, width)
    if not covered.all() and covered.any():
        rows, columns = (np.flatnonzero(covered.any(axis=axis)) * step for axis in (1, 0))
        box = box.shared(Box(int(rows[0]), int(columns[0]), int(rows[-1]) + step, int(columns[-1]) + step))
    return Sight(found, int(np.count_nonzero(covered)) * step**2, box)


def _sampled(layer: Layer) -> tuple[Image, Mask, int]:
    """Every so many-th pixel of a layer, whether it may show, and that step."""
    box = Box(0, 0, *layer.image.shape[:2])
    step = _step(box)
    image = _every(layer.image, box, step)
    return image, np.broadcast_to(_covered(layer, box, step), image.shape[:2]), step


def _chosen(values: npt.NDArray[Any], where: Mask) -> npt.NDArray[Any]:
    """(n,) what a mask chooses."""
    return values.ravel() if where.all() else values[where]


def _counted(values: npt.NDArray[Any], white: float) -> float:
    """The light of the quantile above of small integers, of those that may show: counted, which takes less
    than sorting them. 0 where there are none.
    """
    count = np.bincount(values)
    light = decoded(np.arange(len(count)) / white)
    telling = np.flatnonzero((light > _SHOWING[0]) & (light < _SHOWING[1]))
    before = count[telling].cumsum()
    if not len(before) or not before[-1]:
        return 0.0
    at = _BURNT * (before[-1] - 1)
    low, high = (
        light[telling[np.searchsorted(before, np.floor(at) + k, side="right")]] for k in (0, np.ceil(at % 1))
    )
    return float(low + (at % 1) * (high - low))
