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
import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_choice
from toposeam.images import Image, Mask, Windows, check_values, in_dtype
from toposeam.layers.layer import Box, Layer, check_layers, extent_of
from toposeam.layers.shading import field_on
from toposeam.layers.shading import shading as field_coefficients
from toposeam.layers.tasks import Executor, check_executor, results

#: Shares of full scale between which a pixel tells the exposure.
TELLING = (0.04, 0.97)
#: From this share of full scale in all channels on, gains below 1 let go, so that white stays white.
WHITE = 0.9
#: A gain is at most this, and at least its inverse.
LARGEST_GAIN = 4.0
#: Pixels of an overlap that are looked at, and those that are needed.
_SAMPLE, _ENOUGH = 250_000, 16
_ROWS = 256  # worked on at a time
_BURNT = 0.999  # of the pixels stay below white


def tone_gains(
    layers: Sequence[Layer], places: Sequence[Box], executor: Executor | None = None
) -> npt.NDArray[np.float64]:
    """The gain of each layer and channel, (N, C); their geometric mean is 1 per channel, less where
    highlights would burn out.

    Parameters
    ----------
    layers : sequence of Layer
    places : sequence of Box
        Where each lies on the canvas.
    executor : Executor, optional
        Where pairs are compared.
    """
    count = len(layers)
    channels = max(1 if layer.image.ndim == 2 else layer.image.shape[2] for layer in layers)
    logarithm = np.zeros((count, channels))
    later = [[j for j in range(i + 1, count) if all(places[i].shared(places[j]).shape)] for i in range(count)]
    placed = list(zip(layers, places, strict=True))
    items = [(*placed[i], [placed[j] for j in later[i]], channels) for i in range(count)]
    seen = list(results(executor, _compared, items))
    known = {(i, j): ratios for i in range(count) for j, ratios in zip(later[i], seen[i][0], strict=True)}
    for channel in range(channels):
        rows, values = [], []
        for (i, j), ratios in known.items():
            if (found := ratios[channel]) is not None:
                ratio, pixels = found
                row = np.zeros(count)
                row[i], row[j] = -1.0, 1.0
                weight = np.sqrt(pixels)
                rows.append(weight * row)
                values.append(weight * ratio)
        if rows:
            logarithm[:, channel] = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[
                0
            ]  # of least norm: mean 0 where joined
    gains = np.clip(np.exp(logarithm - logarithm.mean(axis=0)), 1 / LARGEST_GAIN, LARGEST_GAIN)
    scaled: npt.NDArray[np.float64] = gains * _headroom([brightest for _, brightest in seen], gains)
    return scaled


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
        (:mod:`toposeam.layers.shading`).
    executor : Executor, optional
        Where pairs are compared (:mod:`toposeam.layers.tasks`).

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
            check_values(layer.image, layer.name, layer.data_range)  # what is white is known
    canvas = extent_of(layers)
    places = [canvas.place(layer) for layer in layers]
    gains = tone_gains(layers, places, executor)
    fields: Sequence[npt.NDArray[np.float64] | None] = [None] * len(layers)
    if shading:
        fields = _fields(layers, places, gains)
        items = [(*one, gains.shape[1]) for one in zip(layers, fields, strict=True)]
        gains *= _headroom(list(results(executor, _brightest, items)), gains)
    toned = [Toned(*one) for one in zip(layers, gains, fields, strict=True)]
    return [
        dataclasses.replace(layer, image=image if isinstance(layer.image, Windows) else image[:, :])
        for layer, image in zip(layers, toned, strict=True)
    ]


def _fields(
    layers: Sequence[Layer], places: Sequence[Box], gains: npt.NDArray[np.float64]
) -> list[npt.NDArray[np.float64]]:
    """The coefficients of each layer's field."""

    def ratios(i: int, j: int, common: Box) -> tuple[npt.NDArray[np.float64], int]:
        planes, step = _both(layers[i], places[i], layers[j], places[j], gains.shape[1])
        logarithms = [
            np.where(
                known, np.log(np.where(known, a, 1) * gain_a) - np.log(np.where(known, b, 1) * gain_b), np.nan
            )
            for (a, b, known), gain_a, gain_b in zip(planes, gains[i], gains[j], strict=True)
        ]
        return np.mean(logarithms, axis=0), step

    return field_coefficients(places, ratios)


class Toned(Windows):
    """A layer's pixels times its gains, computed where they are looked at.

    Integers are rounded, and what is burnt out in all channels stays white.
    """

    def __init__(
        self, layer: Layer, gain: npt.NDArray[np.float64], field: npt.NDArray[np.float64] | None = None
    ) -> None:
        super().__init__(layer.image.shape, layer.image.dtype)
        self._image, self._white = layer.image, layer.white
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

    def _made_tables(self) -> npt.NDArray[Any] | None:
        if self._field is not None or self.dtype not in (np.uint8, np.uint16):
            return None
        share = np.arange(np.iinfo(self.dtype).max + 1) / self._white
        return self._whole(share[:, np.newaxis] * self._factor).T.copy()

    def read(self, rows: slice, columns: slice) -> Image:
        """Some rows and columns."""
        image = self._image[rows, columns]
        planes = image[..., np.newaxis] if self.ndim == 2 else image
        result = np.empty(planes.shape, self.dtype)
        for start in range(0, len(planes), _ROWS):
            part = slice(start, start + _ROWS)
            factor = self._factor
            if self._field is not None:
                at = range(*rows.indices(self.shape[0]))[part], range(*columns.indices(self.shape[1]))
                field = field_on(self._field, self.shape, *at)[..., np.newaxis]
                small = self.dtype.itemsize <= 2
                factor = field.astype(np.float32) * factor.astype(np.float32) if small else field * factor
            if self._tables is not None:
                for channel, table in enumerate(self._tables):
                    result[part, :, channel] = table.take(planes[part, :, channel])
                self._keep_white(planes[part], result[part], factor)
            elif not np.issubdtype(self.dtype, np.integer):
                result[part] = planes[part] * factor
            elif self.dtype.itemsize <= 2:
                result[part] = in_dtype(planes[part] * factor, self.dtype)
                self._keep_white(planes[part], result[part], factor)
            else:
                share = planes[part].astype(np.float64) / self._white
                result[part] = self._whole(share * factor)
                self._keep_white(planes[part], result[part], factor)
        return result.reshape(image.shape)

    def _keep_white(self, planes: Image, result: Image, factor: npt.NDArray[np.float64]) -> None:
        if (factor >= 1).all():
            return
        darkest = functools.reduce(np.minimum, np.moveaxis(planes, 2, 0))
        bright = darkest > WHITE * self._white
        if not bright.any():
            return
        factor = np.broadcast_to(factor, planes.shape)[bright]
        share = planes[bright].astype(np.float64) / self._white
        burnt = np.clip((share.min(axis=1, keepdims=True) - WHITE) / (1 - WHITE), 0, 1)
        burnt *= burnt * (3 - 2 * burnt)
        result[bright] = self._whole(share * factor + np.maximum(0.0, 1 - factor) * burnt)

    def _whole(self, share: npt.NDArray[np.float64]) -> Image:
        return in_dtype(share * self._white, self.dtype)


def _compared(
    item: tuple[Layer, Box, list[tuple[Layer, Box]], int],
) -> tuple[list[list[tuple[float, int] | None]], list[float]]:
    """What :func:`_log_ratios` tells of a placed layer and each of some others, and how bright it is."""
    layer, place, others, channels = item
    ratios = [_log_ratios((layer, place, *other, channels)) for other in others]
    return ratios, _brightest((layer, None, channels))


def _log_ratios(item: tuple[Layer, Box, Layer, Box, int]) -> list[tuple[float, int] | None]:
    """Of two placed layers, per channel, the median of log a - log b over the pixels of both, and how many
    there are.
    """
    a, at_a, b, at_b, channels = item
    if a.image.dtype == b.image.dtype == np.uint8:
        return _log_ratios_of_bytes(a, at_a, b, at_b, channels)
    found: list[tuple[float, int] | None] = []
    planes, step = _both(a, at_a, b, at_b, channels)
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
    shares = [np.arange(256) / white for white in (white_a, white_b)]
    telling = np.logical_and.outer(*((share > TELLING[0]) & (share < TELLING[1]) for share in shares)).ravel()
    logarithms = [np.log(share, out=np.zeros(256), where=share > 0) for share in shares]
    ratios = np.subtract.outer(*logarithms).ravel()[telling]
    order = np.argsort(ratios)
    ranks = np.full(len(telling), len(ratios), np.uint16)
    ranks[np.flatnonzero(telling)[order]] = np.arange(len(order))
    return ranks, ratios[order]


def _both(
    a: Layer, at_a: Box, b: Layer, at_b: Box, channels: int
) -> tuple[list[tuple[npt.NDArray[Any], npt.NDArray[Any], Mask]], int]:
    """Per channel the values of two layers where both have pixels, and where they tell the exposure; every so
    many-th pixel.
    """
    common = at_a.shared(at_b)
    step = _step(common)
    known: Mask = np.ones((1, 1), bool)
    values = []
    for layer, place in ((a, at_a), (b, at_b)):
        part, covered = _seen(layer, place, common, step)
        known = known & covered
        values.append(part / layer.white)
    found = []
    for channel in range(channels):
        both = known
        planes = [part[..., min(channel, part.shape[2] - 1)] for part in values]
        for plane in planes:
            both = (
                both
                & (plane > TELLING[0])
                & (plane < (TELLING[1] if np.issubdtype(a.image.dtype, np.integer) else np.inf))
            )
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


def _headroom(brightest: Sequence[Sequence[float]], gains: npt.NDArray[np.float64]) -> float:
    """By what gains are to be multiplied so that no more than a thousandth of a layer's pixels burns out that
    had not before; 1 where none does.
    """
    most = float((np.array(brightest) * gains).max())
    return min(1.0, 1.0 / most) if most else 1.0


def _brightest(item: tuple[Layer, npt.NDArray[np.float64] | None, int]) -> list[float]:
    """Of each channel of a layer, which a field may raise, the brightest value but for a thousandth of the
    pixels, as a share of white; 0 where nothing can burn out.
    """
    layer, field, channels = item
    if not np.issubdtype(layer.image.dtype, np.integer):
        return [0.0] * channels
    height, width = layer.image.shape[:2]
    step = max(1, int(np.sqrt(height * width / _SAMPLE)))
    image = _every(layer.image, Box(0, 0, height, width), step)
    covered = np.broadcast_to(_covered(layer, Box(0, 0, height, width), step), image.shape[:2])
    raised: Any = 1.0
    if field is not None:
        raised = field_on(field, layer.image.shape, range(0, height, step), range(0, width, step))
        raised = _chosen(raised, covered)
    found = []
    for channel in range(channels):
        values = _chosen(image[..., min(channel, image.shape[2] - 1)], covered)
        if field is None and values.dtype in (np.uint8, np.uint16):
            found.append(_counted(values, layer.white))
            continue
        shares = values / layer.white
        shares = (shares * raised)[(shares > TELLING[0]) & (shares < TELLING[1])]
        found.append(float(np.quantile(shares, _BURNT)) if len(shares) else 0.0)
    return found


def _chosen(values: npt.NDArray[Any], where: Mask) -> npt.NDArray[Any]:
    """(n,) what a mask chooses."""
    return values.ravel() if where.all() else values[where]


def _counted(values: npt.NDArray[Any], white: float) -> float:
    """The quantile above of small integers as shares of white, of those that tell the exposure: counted,
    which takes less than sorting them. 0 where there are none.
    """
    count = np.bincount(values)
    share = np.arange(len(count)) / white
    telling = np.flatnonzero((share > TELLING[0]) & (share < TELLING[1]))
    before = count[telling].cumsum()
    if not len(before) or not before[-1]:
        return 0.0
    at = _BURNT * (before[-1] - 1)
    low, high = (
        share[telling[np.searchsorted(before, np.floor(at) + k, side="right")]] for k in (0, np.ceil(at % 1))
    )
    return float(low + (at % 1) * (high - low))
