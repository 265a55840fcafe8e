"""Tones: one gain per layer and channel, and a smooth field of gain, so that overlapping layers agree.

Gains are about light, where a change of exposure is one. Integers, and floats that hardly go beyond white,
are taken for encoded as sRGB: they are decoded, multiplied and encoded again
(:mod:`toposeam.layers.exposure.linear_light`). When of any layer's floats more than a thousandth lie well
beyond white, the floats of all are taken for light itself and only multiplied.

For each pair of overlapping layers and each channel the median of log a - log b over the pixels that both
have, neither in the dark nor burnt out, is one equation log g_b - log g_a = median; the gains g solve all of
them in the least-squares sense, weighted by pixels. The medians do not see what differs between the pictures
themselves, as long as that is less than half of the overlap. The whole keeps the brightness that most of it
has: Huber's location of the logarithms of the gains, weighted by the layers' pixels, is 0. It is their mean
where exposures are alike, and a dark picture among bright ones hardly darkens them. Where an overlap is all
dark or burnt out, the exposures that the layers state are compared instead. What would go beyond white rolls
off, in all layers alike, so that they still agree; what is burnt out stays white: scaled down, it would turn
gray.

**Shading.** Lenses darken towards corners. A layer's field is the exponential of quadratic B-splines over
3 × 3 cells, the same in all channels. It is the sum of three parts: the darkening round the middle of the
picture (powers of the distance), which all layers share, as they share the lens; a small part that they
share; and a small part of the layer's own. In blocks of every overlap the median of log a - log b in light,
after the layers' gains, is one equation between the two fields at the block's middle; all of them are solved
by least squares. All but the darkening round the middle is kept small: along a row of pictures no overlap
tells how the lens differs from top to bottom, and no overlap sees what darkens all layers alike at a place of
the canvas. Blocks that differ by something else than light, as where things moved, count less and less in
rounds of reweighting (Cauchy).
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import linalg

from toposeam.arrays import Floats, Image, Mask
from toposeam.checks import check_choice
from toposeam.images import Windows, check_values
from toposeam.layers.canvas.canvas import extent_of, groups
from toposeam.layers.canvas.layer import Box, Layer, check_layers
from toposeam.layers.canvas.transforms import Transform
from toposeam.layers.execution.tasks import Executor, check_executor, results
from toposeam.layers.exposure.linear_light import SPLINES, Field, Toned, decoded, light_of, weights_along

#: Light between which a pixel tells the exposure: that of shares 0.04 and 0.97 of full scale.
TELLING = float(decoded(0.04)), float(decoded(0.97))
#: Light between which a pixel is something bright to show, and not burnt out.
_SHOWING = TELLING[0], float(decoded(0.995))
#: Largest gain, and the inverse of the least one: four stops.
LARGEST_GAIN = 16.0
#: Logarithms of gains that differ by less from the location of all are alike; rounds in which it is found.
_ALIKE, _LOCATION_ROUNDS = 0.2, 30
#: Floats are light itself when a larger share of a layer's pixels than the first lies beyond the second, in
#: times white.
_LINEAR_SHARE, _BEYOND_WHITE = 0.001, 1.05
#: Pixels of an overlap that are compared at most, and at least.
_SAMPLE, _LEAST_PIXELS = 250_000, 16
#: A value that counts as burnt out, as a share of white; share of an overlap that is burnt out in one of two
#: layers, and the logarithm of their ratio in any channel, above which gains alone leave a step there.
_BURNT, _BURNT_SHARE, _APART = 0.98, 0.2, 0.1
#: Share of a layer's pixels that are to stay below white.
_BELOW_WHITE = 0.999

#: Logarithms of two layers' ratio at regular steps in a box, NaN where they tell nothing, and the step, px.
Ratios = Callable[[int, int, Box], tuple[Floats, int]]
#: Side of a block in which fields are compared, as a share of the smaller layer's side.
_BLOCK = 1 / 12
#: Samples that a block needs: more than an overlap, as every block gives an equation.
_LEAST_BLOCK_SAMPLES = 24
#: One standard deviation of the logarithm by which blocks differ for other reasons than light.
_NOISE = 0.02
#: Powers of the distance of which the darkening round the middle is made, and one standard deviation of the
#: logarithm of each in the corners.
_POWERS, _ROUND_SIZE = (2, 4), 1.0
#: One standard deviation of the coefficients and of their second differences: of the part that all layers
#: share, and of a layer's own.
_SHARED_SIZES, _OWN_SIZES = (0.1, 0.05), (0.04, 0.02)
#: Places along a side to which the splines of a field are fitted.
_SAMPLES = 16
#: Unknowns at most whose equations are dense: sparse ones take several times as long to build.
_DENSE = 256
#: Rounds of reweighting, and the residual, a logarithm, at which a block counts half.
_ROUNDS, _HALF_WEIGHT = 6, 0.07


class ToneSample(NamedTuple):
    """Brightness and extent of a layer by itself."""

    #: The brightest light of each channel but for a thousandth; 0 where nothing tells it.
    brightest: list[float]
    #: Pixels that may show, about.
    pixels: int
    #: The part of the canvas, or of the layer, that they fill, about.
    box: Box


def tone_gains(
    layers: Sequence[Layer], places: Sequence[Box], executor: Executor | None = None, linear: bool = False
) -> tuple[Floats, list[ToneSample]]:
    """Find the gain of each layer and channel, after which the whole is as bright as most of its layers.

    Parameters
    ----------
    layers : sequence of Layer
    places : sequence of Box
        Where each lies on the canvas.
    executor : Executor, optional
        Where pairs are compared.
    linear : bool
        Whether values are light itself.

    Returns
    -------
    gains : (N, C) array
    samples : list of ToneSample
        Of each layer.
    """
    count = len(layers)
    channels = _most_channels(layers)
    logarithm = np.zeros((count, channels))
    later = [[j for j in range(i + 1, count) if all(places[i].shared(places[j]).shape)] for i in range(count)]
    placed = list(zip(layers, places, strict=True))
    items = [(*placed[i], [placed[j] for j in later[i]], channels, linear) for i in range(count)]
    compared = list(results(executor, _compare, items))
    known = {(i, j): ratios for i in range(count) for j, ratios in zip(later[i], compared[i][0], strict=True)}
    samples = [sample for _, sample in compared]
    share = np.sqrt([max(1, sample.pixels) for sample in samples])
    joined = list[tuple[int, int]]()
    for channel in range(channels):
        rows, values = [], []
        for (i, j), ratios in known.items():
            if (measured := ratios[channel] or _stated_ratio(layers[i], layers[j])) is not None:
                ratio, pixels = measured
                row = np.zeros(count)
                row[i], row[j] = -1.0, 1.0
                weight = np.sqrt(pixels)
                rows.append(weight * row / share)
                joined.append((i, j))
                values.append(weight * ratio)
        if rows:  # of least norm: each joined group's weighted mean is 0
            logarithm[:, channel] = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0] / share
    group, bright = groups(count, joined), logarithm.mean(axis=1)
    for members in (group == number for number in range(group.max() + 1)):
        logarithm[members] -= _location(bright[members], share[members] ** 2)
    return np.clip(np.exp(logarithm), 1 / LARGEST_GAIN, LARGEST_GAIN), samples


def _location(values: Floats, weights: Floats) -> float:
    """Return Huber's location of weighted values: their mean, but that outliers count less."""
    location = 0.0
    for _ in range(_LOCATION_ROUNDS):
        counted = weights * np.minimum(1, _ALIKE / np.maximum(np.abs(values - location), 1e-12))
        location = float(np.average(values, weights=counted))
    return location


def burnt_apart(layers: Sequence[Layer], places: Sequence[Box]) -> bool:
    """Test whether much of an overlap is burnt out in one of two layers, whose exposures differ.

    What is burnt out has lost its light and its hue, so that no gain makes such layers agree there.
    """
    channels = _most_channels(layers)
    placed = list(zip(layers, places, strict=True))
    for a, b in itertools.combinations(placed, 2):
        common = a[1].shared(b[1])
        if not all(common.shape):
            continue
        windows = [_window(*one, common, _step(common)) for one in (a, b)]
        known = np.broadcast_to(windows[0][1] & windows[1][1], windows[0][0].shape[:2])
        burnt = np.zeros(known.shape, bool)
        for (values, _), (layer, _) in zip(windows, (a, b), strict=True):
            burnt |= values.max(axis=2) >= _BURNT * layer.white
        if known.any() and burnt[known].mean() > _BURNT_SHARE:
            ratios = _log_ratios((*a, *b, channels, False))
            if any(ratio is not None and abs(ratio[0]) > _APART for ratio in ratios):
                return True
    return False


def _most_channels(layers: Sequence[Layer]) -> int:
    return max(1 if layer.image.ndim == 2 else layer.image.shape[2] for layer in layers)


def match_tones(
    layers: Sequence[Layer],
    *,
    shading: bool = False,
    gray: bool = False,
    executor: Executor | None = None,
) -> list[Layer]:
    """Give layers one gain per channel each, so that they agree where they overlap.

    Parameters
    ----------
    layers : sequence of Layer
        At least two, placed.
    shading : bool
        Also give each layer a smooth field of gain, against lenses that darken towards the corners
        (:mod:`toposeam.layers.exposure.gains`).
    gray : bool
        Give all channels of a layer the same gain, so that hues stay.
    executor : Executor, optional
        Where pairs are compared (:mod:`toposeam.layers.execution.tasks`).

    Returns
    -------
    list of Layer
        Values are rounded and kept within their range; masks and places stay.

    Raises
    ------
    ImageError
        Where `data_range` is missing: for integers but uint8 and uint16, and floats like those in 0..255.

    Examples
    --------
    >>> dark, light = np.full((20, 30), 100, np.uint8), np.full((20, 30), 121, np.uint8)
    >>> first, second = match_tones([Layer(dark), Layer(light, at=(20, 0))])
    >>> int(first.image[0, 0]), int(second.image[0, 0])
    (110, 110)
    """
    layers = check_layers(layers)
    check_choice("shading", shading, (True, False))
    check_choice("gray", gray, (True, False))
    check_executor(executor)
    return [
        dataclasses.replace(layer, image=image if isinstance(layer.image, Windows) else image[:, :])
        for layer, tones in zip(layers, _tones(layers, shading, gray, executor), strict=True)
        for image in [Toned(layer, *tones)]
    ]


def toned_as(
    pictures: Sequence[Layer], transforms: Sequence[Transform], placed: Sequence[Layer]
) -> list[Layer]:
    """Give pictures gains and fields by which their copies on a canvas agree.

    Parameters
    ----------
    pictures : sequence of Layer
        Where they lie is ignored.
    transforms : sequence of Transform
        From their pixels to the canvas.
    placed : sequence of Layer
        The pictures on the canvas.

    Raises
    ------
    ImageError
        As :func:`match_tones`.
    """
    found = []
    for picture, transform, layer, (gain, own, top) in zip(
        pictures, transforms, placed, _tones(placed, shading=True), strict=True
    ):
        height, width = picture.image.shape[:2]
        places = ((np.arange(_SAMPLES) + 0.5) / _SAMPLES * side - 0.5 for side in (width, height))
        at = transform.to_canvas(np.stack(np.meshgrid(*places), axis=-1).reshape(-1, 2))
        right, below = np.nan_to_num(at - np.array(layer.at)).T
        values = np.zeros(len(at)) if own is None else own.at(below, right)
        fit = _fit_of_samples()
        coefficients = fit @ values.reshape(_SAMPLES, _SAMPLES) @ fit.T
        toned = Toned(picture, gain, Field(coefficients, Box(0, 0, height, width)), top)
        found.append(dataclasses.replace(picture, image=toned[:, :]))
    return found


def _tones(
    layers: Sequence[Layer], shading: bool, gray: bool = False, executor: Executor | None = None
) -> list[tuple[Floats, Field | None, float | None]]:
    """Find the tones of layers as :func:`match_tones` does: what :class:`Toned` takes besides each."""
    for layer in layers:
        if not isinstance(layer.image, Windows):
            check_values(layer.image, layer.title, layer.data_range)  # what is white is known
    canvas = extent_of(layers)
    places = [canvas.place(layer) for layer in layers]
    floats = [layer for layer in layers if np.issubdtype(layer.image.dtype, np.floating)]
    linear = any(list(results(executor, _beyond_white, floats)))
    gains, samples = tone_gains(layers, places, executor, linear)
    if gray:
        gains = np.repeat(np.exp(np.log(gains).mean(axis=1, keepdims=True)), gains.shape[1], axis=1)
    fields: Sequence[Field | None] = [None] * len(layers)
    if shading:
        fields = _find_fields(layers, places, [sample.box for sample in samples], gains, linear)
        items = [(*one, gains.shape[1]) for one in zip(layers, fields, strict=True)]
        samples = list(results(executor, _sample_tones, items))
    brightest = [sample.brightest for sample in samples]
    top = None if linear else max(1.0, float((np.array(brightest) * gains).max()))
    return [(*one, top) for one in zip(gains, fields, strict=True)]


def _find_fields(
    layers: Sequence[Layer],
    places: Sequence[Box],
    filled: Sequence[Box],
    gains: Floats,
    linear: bool,
) -> list[Field]:
    """Find each layer's field, on the part that it fills: canvases of warped pictures are mostly empty."""

    def ratios(i: int, j: int, common: Box) -> tuple[Floats, int]:
        planes, step = _common_light(
            (layers[i], places[i]), (layers[j], places[j]), common, gains.shape[1], linear
        )
        logarithms = [
            np.where(
                known, np.log(np.where(known, a, 1) * gain_a) - np.log(np.where(known, b, 1) * gain_b), np.nan
            )
            for (a, b, known), gain_a, gain_b in zip(planes, gains[i], gains[j], strict=True)
        ]
        return np.mean(logarithms, axis=0), step

    return [
        Field(coefficients, box.moved(-place.top, -place.left))
        for coefficients, box, place in zip(fit_fields(filled, ratios), filled, places, strict=True)
    ]


def fit_fields(places: Sequence[Box], ratios: Ratios) -> list[Floats]:
    """Fit the fields of gain of all layers to their overlaps.

    Parameters
    ----------
    places : sequence of Box
        Where each layer lies on the canvas.
    ratios : callable
        See :data:`Ratios`.

    Returns
    -------
    list of (5, 5) arrays
        Coefficients of the logarithm of each layer's field.
    """
    found = [
        block
        for i in range(len(places))
        for j in range(i + 1, len(places))
        if all(places[i].shared(places[j]).shape)
        for block in _blocks(i, j, places, ratios)
    ]
    if not found:
        return [np.zeros((SPLINES, SPLINES)) for _ in places]
    rows = np.repeat(np.arange(len(found)), 2 * SPLINES**2)
    columns, values = (np.concatenate([block[k] for block in found]) for k in (0, 1))
    each = sparse.csr_array((values, (rows, columns)), shape=(len(found), len(places) * SPLINES**2))
    wanted, trust = (np.array([block[k] for block in found]) for k in (2, 3))
    parts = _parts(places)
    matrix: Any = each @ parts
    prior: Any = _prior(len(places))
    dense = parts.shape[1] <= _DENSE
    if dense:
        matrix, prior = matrix.toarray(), prior.toarray()
    solution = np.zeros(parts.shape[1])
    for _ in range(_ROUNDS):
        residual = (matrix @ solution - wanted) / _HALF_WEIGHT
        weighted = matrix.T @ sparse.diags_array(trust / (1 + residual**2) / _NOISE**2)
        system, right = weighted @ matrix + prior, weighted @ wanted
        solution = np.linalg.solve(system, right) if dense else linalg.spsolve(system.tocsc(), right)
    return list((parts @ solution).reshape(-1, SPLINES, SPLINES))


def _parts(places: Sequence[Box]) -> sparse.csr_array:
    """Return the (25 N, unknowns) matrix that adds up the layers' coefficients, one layer after the other,
    from powers of the distance to a layer's middle, which are 1 in its corners, a shared part, and each
    layer's own.
    """
    one = sparse.eye_array(SPLINES**2)
    return sparse.csr_array(
        sparse.hstack(
            [
                np.concatenate([_round_the_middle(place.shape) for place in places]),
                sparse.vstack([one] * len(places)),
                sparse.eye_array(SPLINES**2 * len(places)),
            ]
        )
    )


def _round_the_middle(shape: tuple[int, int]) -> Floats:
    """Fit splines to powers of the distance from the middle: (25, powers) coefficients."""
    at = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5
    distance = np.hypot.outer(at * shape[0], at * shape[1]) / (np.hypot(*shape) / 2)
    fit = _fit_of_samples()
    return np.stack([(fit @ distance**power @ fit.T).ravel() for power in _POWERS], axis=1)


def _fit_of_samples() -> Floats:
    """Return the (5, samples) matrix that fits splines to values at the middles of equal parts of a side."""
    return np.asarray(np.linalg.pinv(weights_along(_SAMPLES, np.arange(_SAMPLES))), float)


def _blocks(
    i: int, j: int, places: Sequence[Box], ratios: Ratios
) -> list[tuple[npt.NDArray[np.intp], Floats, float, float]]:
    """Compare two layers in the blocks of their overlap.

    Returns
    -------
    list of (unknowns, factors, ratio, weight)
        Of each block the (50,) unknowns, their factors, the logarithm that they are to add up to, and the
        share of a whole block that it has.
    """
    common = places[i].shared(places[j])
    values, step = ratios(i, j, common)
    shapes = places[i].shape, places[j].shape
    side = max(1.0, _BLOCK * min(*shapes[0], *shapes[1]) / step)
    cuts = [
        np.linspace(0, length, max(1, round(length / side)) + 1).round().astype(int)
        for length in values.shape
    ]
    rows, columns = (
        start + step * (cut[:-1] + cut[1:]) / 2
        for start, cut in zip((common.top, common.left), cuts, strict=True)
    )
    factors = np.concatenate(
        [
            sign
            * np.einsum(
                "ra,cb->rcab",
                weights_along(shape[0], rows - places[layer].top),
                weights_along(shape[1], columns - places[layer].left),
            ).reshape(len(rows), len(columns), -1)
            for layer, shape, sign in ((i, shapes[0], -1.0), (j, shapes[1], 1.0))
        ],
        axis=2,
    )
    unknowns = np.concatenate([layer * SPLINES**2 + np.arange(SPLINES**2) for layer in (i, j)])
    whole = min(height * width for height, width in shapes) * _BLOCK**2
    found = []
    for row, (top, bottom) in enumerate(zip(cuts[0], cuts[0][1:], strict=False)):
        for column, (left, right) in enumerate(zip(cuts[1], cuts[1][1:], strict=False)):
            block = values[top:bottom, left:right]
            known = block[np.isfinite(block)]
            if len(known) >= _LEAST_BLOCK_SAMPLES:
                weight = min(1.0, len(known) * step**2 / whole)
                found.append((unknowns, factors[row, column], _median(known), weight))
    return found


def _median(values: Floats) -> float:
    """Return the median of some hundred values; what np.median checks besides takes ten times as long."""
    low, high = (len(values) - 1) // 2, len(values) // 2
    ordered = np.partition(values, high if low == high else (low, high))
    return float(ordered[low] + ordered[high]) / 2


def _prior(count: int) -> sparse.csr_array:
    """Return the quadratic form that keeps the parts of :func:`_parts` small and even."""
    second = np.diff(np.eye(SPLINES), 2, axis=0)
    one = np.eye(SPLINES)
    curved = np.concatenate([np.kron(second, one), np.kron(one, second)])
    shared, own = (
        sparse.coo_array(np.eye(SPLINES**2) / size**2 + curved.T @ curved / bend**2)
        for size, bend in (_SHARED_SIZES, _OWN_SIZES)
    )
    powers = sparse.eye_array(len(_POWERS)) / _ROUND_SIZE**2
    return sparse.csr_array(sparse.block_diag([powers, shared] + [own] * count))


def _stated_ratio(a: Layer, b: Layer) -> tuple[float, int] | None:
    """Return the ratio of the exposures that two layers state, with little weight (:func:`_log_ratios`)."""
    if a.exposure is None or b.exposure is None:
        return None
    return float(np.log(a.exposure) - np.log(b.exposure)), _LEAST_PIXELS


def _compare(
    item: tuple[Layer, Box, list[tuple[Layer, Box]], int, bool],
) -> tuple[list[list[tuple[float, int] | None]], ToneSample]:
    """Compare a placed layer with each of some others by :func:`_log_ratios`, and sample its own tones."""
    layer, place, others, channels, linear = item
    ratios = [_log_ratios((layer, place, *other, channels, linear)) for other in others]
    sample = _sample_tones((layer, None, channels))
    return ratios, sample._replace(box=sample.box.moved(place.top, place.left))


def _log_ratios(item: tuple[Layer, Box, Layer, Box, int, bool]) -> list[tuple[float, int] | None]:
    """Compute by channel the median of log a - log b of two placed layers, and the number of pixels."""
    a, at_a, b, at_b, channels, linear = item
    if a.image.dtype == b.image.dtype == np.uint8:
        return _log_ratios_of_bytes(a, at_a, b, at_b, channels)
    found: list[tuple[float, int] | None] = []
    planes, step = _common_light((a, at_a), (b, at_b), at_a.shared(at_b), channels, linear)
    for one, other, both in planes:
        number = int(np.count_nonzero(both))
        ratio = None if number < _LEAST_PIXELS else float(np.median(np.log(one[both]) - np.log(other[both])))
        found.append(None if ratio is None else (ratio, number * step**2))
    return found


def _log_ratios_of_bytes(
    a: Layer, at_a: Box, b: Layer, at_b: Box, channels: int
) -> list[tuple[float, int] | None]:
    """Do as :func:`_log_ratios` for bytes: rank the pairs of 256 values once for all, and sort ranks, which
    is faster than to take logarithms and to sort these.
    """
    common = at_a.shared(at_b)
    step = _step(common)
    (one, on_a), (other, on_b) = (_window(*layer, common, step) for layer in ((a, at_a), (b, at_b)))
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
        middle = order[[(number - 1) // 2, number // 2]] if number >= _LEAST_PIXELS else None
        found.append(None if middle is None else (float(ratios[middle].mean()), number * step**2))
    return found


@functools.lru_cache(maxsize=8)
def _ranked(white_a: float, white_b: float) -> tuple[npt.NDArray[np.uint16], Floats]:
    """Rank all pairs of bytes, 256 a + b, by log a - log b.

    Returns
    -------
    ranks : (65536,) uint16 array
        Among the pairs that tell the exposure; of other pairs their number, which is more.
    ratios : (K,) array
        The logarithms in order.
    """
    shares = [decoded(np.arange(256) / white) for white in (white_a, white_b)]
    telling = np.logical_and.outer(*((share > TELLING[0]) & (share < TELLING[1]) for share in shares)).ravel()
    logarithms = [np.log(share, out=np.zeros(256), where=share > 0) for share in shares]
    ratios = np.subtract.outer(*logarithms).ravel()[telling]
    order = np.argsort(ratios)
    ranks = np.full(len(telling), len(ratios), np.uint16)
    ranks[np.flatnonzero(telling)[order]] = np.arange(len(order))
    return ranks, ratios[order]


def _common_light(
    a: tuple[Layer, Box], b: tuple[Layer, Box], common: Box, channels: int, linear: bool
) -> tuple[list[tuple[npt.NDArray[Any], npt.NDArray[Any], Mask]], int]:
    """Sample the light of two placed layers in their overlap, by channel.

    Returns
    -------
    channels : list of (light of a, light of b, mask)
        The mask is where both have pixels that tell the exposure.
    step : int
        Of the samples, px.
    """
    step = _step(common)
    known: Mask = np.ones((1, 1), bool)
    values = []
    for layer, place in (a, b):
        part, covered = _window(layer, place, common, step)
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
    """Return the step, px, at which an overlap is sampled."""
    rows, columns = common.shape
    return max(1, int(np.sqrt(rows * columns / _SAMPLE)))


def _window(layer: Layer, place: Box, common: Box, step: int) -> tuple[Image, Mask]:
    """Sample a placed layer in a box of the canvas, (h, w, C), and where it may show."""
    inside = common.moved(-place.top, -place.left)
    return _every(layer.image, inside, step), _covered(layer, inside, step)


def _every(image: Image, box: Box, step: int) -> Image:
    """Take pixels of a window at a step, (h, w, C)."""
    part = image[box.top : box.bottom : step, box.left : box.right : step]
    return part[..., np.newaxis] if part.ndim == 2 else part


def _covered(layer: Layer, box: Box, step: int) -> Mask:
    """Test which pixels of a window, at a step, may show."""
    key = slice(box.top, box.bottom, step), slice(box.left, box.right, step)
    covered = np.ones((1, 1), bool) if layer.alpha is None else layer.alpha[key] > 0
    return covered if layer.mask is None else covered & np.asarray(layer.mask)[key]


def _beyond_white(layer: Layer) -> bool:
    """Test whether more than a few of a layer's values lie well beyond white."""
    image, covered, _ = _sampled(layer)
    return (
        bool((_chosen(image, covered) > _BEYOND_WHITE * layer.white).mean() > _LINEAR_SHARE)
        if covered.any()
        else False
    )


def _sample_tones(item: tuple[Layer, Field | None, int]) -> ToneSample:
    """Sample the tones of a layer, which a field may raise; the box lies in the layer."""
    layer, field, channels = item
    image, covered, step = _sampled(layer)
    height, width = layer.image.shape[:2]
    found, white, gain = [], layer.white, None
    if field is not None:
        gain = _chosen(np.exp(field.logarithm(range(0, height, step), range(0, width, step))), covered)
    for channel in range(channels):
        values = _chosen(image[..., min(channel, image.shape[2] - 1)], covered)
        if gain is None and values.dtype in (np.uint8, np.uint16):
            found.append(_brightest_by_counting(values, white))
            continue
        light = light_of(values, white)
        telling = (light > _SHOWING[0]) & (light < _SHOWING[1])
        light = light if gain is None else light * gain
        found.append(float(np.quantile(light[telling], _BELOW_WHITE)) if telling.any() else 0.0)
    box = Box(0, 0, height, width)
    if not covered.all() and covered.any():
        rows, columns = (np.flatnonzero(covered.any(axis=axis)) * step for axis in (1, 0))
        box = box.shared(Box(int(rows[0]), int(columns[0]), int(rows[-1]) + step, int(columns[-1]) + step))
    return ToneSample(found, int(np.count_nonzero(covered)) * step**2, box)


def _sampled(layer: Layer) -> tuple[Image, Mask, int]:
    """Sample a layer, (h, w, C), and where it may show, (h, w), at a step, px."""
    box = Box(0, 0, *layer.image.shape[:2])
    step = _step(box)
    image = _every(layer.image, box, step)
    return image, np.broadcast_to(_covered(layer, box, step), image.shape[:2]), step


def _chosen(values: npt.NDArray[Any], where: Mask) -> npt.NDArray[Any]:
    """Return the (n,) values where a mask is true."""
    return values.ravel() if where.all() else values[where]


def _brightest_by_counting(values: npt.NDArray[Any], white: float) -> float:
    """Return the brightest light of small integers but for a thousandth: counting is faster than sorting.

    0 where none of them may show.
    """
    count = np.bincount(values)
    light = decoded(np.arange(len(count)) / white)
    telling = np.flatnonzero((light > _SHOWING[0]) & (light < _SHOWING[1]))
    before = count[telling].cumsum()
    if not len(before) or not before[-1]:
        return 0.0
    at = _BELOW_WHITE * (before[-1] - 1)
    low, high = (
        light[telling[np.searchsorted(before, np.floor(at) + k, side="right")]] for k in (0, np.ceil(at % 1))
    )
    return float(low + (at % 1) * (high - low))
