"""Multiply the light of layers, window by window: highlights roll off and white stays white.

Values are taken for encoded as sRGB, which most pictures are, and others nearly. In light, 1 is white. All
layers share one shoulder: up to :data:`KNEE` light stays as it is, from there to the brightest light of any
layer it approaches white. The shoulder bends the least and the greatest of a pixel's channels; the others
keep their place between them, so that hues stay. A pixel near white in all channels stays white whatever the
gain.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from toposeam.arrays import AnyFloats, Floats, Image, Indices, Mask
from toposeam.images import Windows, in_dtype
from toposeam.layers.canvas.layer import Box, Layer

#: Light up to which nothing rolls off: a value of 0.8.
KNEE = 0.6
#: Value up to which sRGB's encoding is a straight line, and its light.
STRAIGHT, _STRAIGHT_LIGHT = 0.04045, 0.0031308
#: Share of full scale from which on, in all channels, gains fade out, so that white stays white.
WHITE = 0.9
#: Pixels of a window that are multiplied at once: their planes fit a processor's cache.
_PIXELS_AT_ONCE = 1 << 15
#: Cells of a field of gain along a side, and the quadratic B-splines over them.
_CELLS = 3
SPLINES = _CELLS + 2


def decoded(shares: npt.ArrayLike) -> AnyFloats:
    """Decode values to light, both as shares of white.

    Examples
    --------
    >>> decoded([0.0, 0.5, 1.0]).round(3).tolist()
    [0.0, 0.214, 1.0]
    """
    shares = np.asarray(shares, None if hasattr(shares, "dtype") else float)
    curved = (np.maximum(shares, STRAIGHT) + 0.055) / 1.055
    result: AnyFloats = np.where(shares <= STRAIGHT, shares / 12.92, curved**2.4)
    return result


def encoded(light: npt.ArrayLike) -> AnyFloats:
    """Encode light to values, both as shares of white.

    Examples
    --------
    >>> encoded([0.0, 0.214, 1.0]).round(3).tolist()
    [0.0, 0.5, 1.0]
    """
    light = np.asarray(light, None if hasattr(light, "dtype") else float)
    curved = 1.055 * np.maximum(light, _STRAIGHT_LIGHT) ** (1 / 2.4) - 0.055
    result: AnyFloats = np.where(light <= _STRAIGHT_LIGHT, 12.92 * light, curved)
    return result


def rolled(light: AnyFloats, top: float) -> AnyFloats:
    """Roll off light between the knee and `top`: the same up to the knee, with its slope, 1 from `top` on.

    Examples
    --------
    >>> rolled(np.array([0.5, 0.6, 0.8, 1.5, 2.0]), 1.5).round(3).tolist()
    [0.5, 0.6, 0.747, 1.0, 1.0]
    >>> rolled(np.array([0.5, 2.0]), 1.0).tolist()
    [0.5, 2.0]
    """
    if top <= 1:
        return light
    most = (top - KNEE) / (1 - KNEE)
    over = np.clip((light - KNEE) / (1 - KNEE), 0, most)
    bent = over * (1 + over / most**2) / (1 + over)
    return np.where(light > KNEE, KNEE + (1 - KNEE) * bent, light).astype(light.dtype, copy=False)


def bent(shares: AnyFloats, top: float) -> AnyFloats:
    """Roll off the light of values, which are shares of white, by a table."""
    if top <= 1:
        return shares
    table, first, scale = _bending(top)
    at = np.clip((shares - first) * scale, 0, len(table) - 1).astype(np.int32)
    return np.where(shares > first, table.take(at), shares).astype(shares.dtype, copy=False)


def finished(shares: AnyFloats, raised: AnyFloats, whites: AnyFloats, top: float, white: float) -> AnyFloats:
    """Finish values whose light was multiplied: roll them off, and bring pixels that were lighter than
    `white` in all channels to 1. No value exceeds 1 that did not before.

    Parameters
    ----------
    shares, raised : (C, n)
        Values as shares of white, before and after.
    whites : (C, n) or (C, 1)
        The values that 1 was raised to.
    top : float
        The brightest light to show; it becomes 1.
    white : float
        A share of white.

    Returns
    -------
    (C, n) array
    """
    result = raised
    if top > 1:
        low, high = (functools.reduce(extreme, raised) for extreme in (np.minimum, np.maximum))
        least = bent(low, top)
        slope = bent(high, top) - least
        slope /= np.where(high > low, high - low, 1)
        result = (raised - low) * slope
        result += least
    darkest = functools.reduce(np.minimum, shares)
    near = np.flatnonzero(darkest > white)
    if len(near):
        burnt = np.minimum((darkest[near] - white) / (1 - white), 1)
        burnt *= burnt * (3 - 2 * burnt)
        short = np.maximum(0, 1 - bent(np.broadcast_to(whites, shares.shape).take(near, axis=1), top))
        result = result.copy() if result is raised else result
        _put(result, near, result.take(near, axis=1) + short * burnt)
    bounded: AnyFloats = np.minimum(result, np.maximum(shares, 1))
    return bounded


def light_of(values: Image, white: float) -> AnyFloats:
    """Decode the values of a picture to light; by a table where they are uint8 or uint16."""
    if values.dtype in (np.uint8, np.uint16):
        light: AnyFloats = _decoding(values.dtype, white).take(values)
        return light
    shares: AnyFloats = values / (values.dtype.type(white) if values.dtype.kind == "f" else white)
    return decoded(shares)


def multiplied(shares: AnyFloats, root: npt.NDArray[Any]) -> AnyFloats:
    """Multiply the light of values, which are shares of white, by gains given as their 2.4-th roots.

    Only for values that are above :data:`STRAIGHT` before and after: there a gain of light is a gain of
    values, with an offset.

    Examples
    --------
    >>> multiplied(np.array([0.5]), np.array([2.0]) ** (1 / 2.4)).round(3)
    array([0.686])
    >>> encoded(2 * decoded([0.5])).round(3)
    array([0.686])
    """
    result: AnyFloats = shares + shares.dtype.type(0.055)
    result = result * root
    result -= shares.dtype.type(0.055)
    return result


def weights_along(length: int, at: npt.ArrayLike) -> Floats:
    """Evaluate the quadratic B-splines along a side.

    Parameters
    ----------
    length : int
        Of the side, px.
    at : (n,) array_like
        Pixels; beyond the side the splines go on as at its ends.

    Returns
    -------
    (n, 5) array
    """
    places = np.clip((np.asarray(at, float) + 0.5) / length, 0, 1) * _CELLS
    cell = np.minimum(places.astype(int), _CELLS - 1)
    share = places - cell
    result = np.zeros((len(places), SPLINES))
    rows = np.arange(len(places))
    for step, value in enumerate(((1 - share) ** 2 / 2, 0.5 + share * (1 - share), share**2 / 2)):
        result[rows, cell + step] = value
    return result


class Field(NamedTuple):
    """A layer's field of gain."""

    #: (5, 5), of the splines down and across.
    coefficients: Floats
    #: Where it spans in the layer; beyond, it goes on as at the edge.
    box: Box

    def along(self, rows: range) -> Floats:
        """Evaluate the splines at some rows of the layer, (n, 5)."""
        top, _, bottom, _ = self.box
        return weights_along(max(bottom - top, 0), np.asarray(rows) - top)

    def across(self, columns: range) -> Floats:
        """Evaluate the coefficients of rows' splines at some columns of the layer, (5, n)."""
        _, left, _, right = self.box
        return self.coefficients @ weights_along(max(right - left, 0), np.asarray(columns) - left).T

    def logarithm(self, rows: range, columns: range) -> Floats:
        """Compute the logarithm of the gain at some rows and columns of the layer, (n, m)."""
        return self.along(rows) @ self.across(columns)

    def at(self, rows: Floats, columns: Floats) -> Floats:
        """Compute the logarithm of the gain at points of the layer, all arrays (n,)."""
        (top, left, _, _), (height, width) = self.box, self.box.shape
        down, across = weights_along(height, rows - top), weights_along(width, columns - left)
        return np.asarray(((down @ self.coefficients) * across).sum(axis=1))


class Toned(Windows):
    """A layer's light times its gains, encoded again, computed window by window.

    Without `top` values are light, and only multiplied.
    """

    def __init__(
        self,
        layer: Layer,
        gain: Floats,
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
        self._tables = self._make_tables()

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_tables"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._tables = self._make_tables()

    def _make_tables(self) -> npt.NDArray[np.float32] | None:
        """Tabulate what every value becomes in each channel before highlights roll off, a share of white."""
        if self._field is not None or self._top is None or self.dtype not in (np.uint8, np.uint16):
            return None
        light = decoded(np.arange(np.iinfo(self.dtype).max + 1) / self._white)
        return encoded(light * self._factor[:, np.newaxis]).astype(np.float32)

    def read(self, rows: slice, columns: slice) -> Image:
        """Multiply some rows and columns."""
        image = self._image[rows, columns]
        if self._field is None and (self._factor == 1).all() and self._top in (None, 1.0):
            return image.copy()
        planes = image[..., np.newaxis] if self.ndim == 2 else image
        result = np.empty(planes.shape, self.dtype)
        rounded = None if self._tables is None else in_dtype(self._tables * self._white, self.dtype)
        down, right = (
            range(*one.indices(size)) for one, size in zip((rows, columns), self.shape[:2], strict=True)
        )
        along = across = None
        if self._field is not None:
            along, across = self._field.along(down), self._field.across(right)
        step = max(1, _PIXELS_AT_ONCE // max(1, len(right)))
        for start in range(0, len(planes), step):
            part = slice(start, start + step)
            block = planes[part]
            logarithm = np.zeros((1, 1)) if along is None or across is None else along[part] @ across
            if self._top is None:
                result[part] = block * (np.exp(logarithm)[..., np.newaxis] * self._factor)
            elif rounded is None:
                multiplied_block = in_dtype(self._multiply(block, logarithm) * self._white, self.dtype)
                for channel, plane in enumerate(multiplied_block):
                    result[part, :, channel] = plane.reshape(block.shape[:2])
            else:
                for channel, table in enumerate(rounded):
                    result[part, :, channel] = table.take(block[..., channel])
                self._finish(block, result[part])
        return result.reshape(image.shape)

    def _finish(self, block: Image, result: Image) -> None:
        """Mend the pixels whose channels depend on each other, which tables of one channel cannot know."""
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

    def _multiply(self, block: Image, field: Floats) -> npt.NDArray[Any]:
        """Multiply a block without tables.

        Parameters
        ----------
        block : (h, w, C) array
        field : (h, w) or (1, 1) array
            Logarithm of the field of gain.

        Returns
        -------
        (C, h w) array
            Shares of white.
        """
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
            light = decoded(shares.take(dark, axis=1)) * np.exp(logarithm[dark])
            _put(raised, dark, encoded(light * factor))
        bright = np.flatnonzero(self._bright(darkest, raised.max(axis=0), 1.0))
        if len(bright):
            # Taken, channels lie one after the other; indexed, pixels do, and all that follows takes longer.
            before, after, roots = (one.take(bright, axis=1) for one in (shares, raised, root))
            whites = multiplied(np.ones((1, 1), kind), roots)
            _put(raised, bright, finished(before, after, whites, self._top or 1.0, WHITE))
        return raised

    def _bright(self, darkest: npt.NDArray[Any], lightest: npt.NDArray[Any], white: float) -> Mask:
        """Find the pixels whose channels depend on each other: all almost white, or one beyond the knee."""
        found: Mask = darkest > WHITE * white
        if self._top != 1.0:
            # The value of the knee, less what may be rounded to below it.
            found |= lightest > (float(encoded(KNEE)) - 0.5 / 255) * white
        return found


def _put(planes: npt.NDArray[Any], places: Indices, values: npt.NDArray[Any]) -> None:
    """Put (C, n) values at places of (C, N) planes."""
    for plane, own in zip(planes, values, strict=True):
        plane[places] = own


def _over_channels(function: np.ufunc, planes: Image) -> Image:
    """Reduce (h, w, C) planes to (h, w): faster than along the last axis."""
    extremes: Image = functools.reduce(function, np.moveaxis(planes, -1, 0))
    return extremes


@functools.lru_cache(maxsize=4)
def _decoding(dtype: np.dtype[Any], white: float) -> npt.NDArray[np.float32]:
    """Return the light of every value of an integer type."""
    light: npt.NDArray[np.float32] = decoded(np.arange(np.iinfo(dtype).max + 1) / white).astype(np.float32)
    return light


@functools.lru_cache(maxsize=4)
def _bending(top: float) -> tuple[npt.NDArray[np.float32], float, float]:
    """Tabulate what values from the knee to `top` are bent to.

    Returns
    -------
    table : (K,) float32 array
    first : float
        The value of the first entry.
    scale : float
        Entries per unit of value.
    """
    first, last = (float(encoded(end)) for end in (KNEE, top))
    table = encoded(rolled(decoded(np.linspace(first, last, 1 << 16)), top)).astype(np.float32)
    return table, first, (len(table) - 1) / (last - first)
