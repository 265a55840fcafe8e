"""Patch search in the exemplars: the weighted sum of squared differences at every place, by FFT.

For a window of known pixels T with weights w, and exemplar pixels E that count where M is 1, the mean squared
difference at place o is

    D(o) = Σ w(m) M(o + m) |E(o + m) - T(m)|² / Σ w(m) M(o + m)
         = (w ⋆ M|E|² - 2 Σ_c w T_c ⋆ M E_c + w|T|² ⋆ M) / (w ⋆ M),

⋆ being the correlation. The transforms on the exemplars' side never change; per patch there is one transform
for each channel of T, two for the weights, and one back. Where channels say nearly the same, as in pictures
of few colours, their principal components stand for them, without those that hardly matter. Large exemplars
are searched at a half, a quarter … of their size first and then at full size round the best places.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy.fft as sf

from toposeam.arrays import Complexes32, Floats32, Indices, Mask
from toposeam.texture.exemplar.atlas import Atlas

#: Least share of a window's weight that meets usable pixels.
_LEAST_SHARE = 0.25
#: Number of pixels, about, by which places near those that the reduced search found are compared.
_COMPARED_PIXELS = 1000
#: Number of rows that are reduced at a time, which bounds the memory.
_ROWS_AT_ONCE = 256
#: Number of windows, the last ones of unlike weights, whose terms are kept: patches in rows have few
#: different weights; those that mend seams never have the same twice.
_KEPT_WINDOWS = 16
#: Least extent of a principal component that counts, as a share of the first one's.
_LEAST_COMPONENT = 0.01


class PatchSearch:
    """Finds where patches fit.

    Parameters
    ----------
    atlas : Atlas
    features : (AH, AW, F) float32 array
        The values that are compared, 0 where the atlas is not usable.
    """

    def __init__(self, atlas: Atlas, features: Floats32) -> None:
        self.atlas, self.features = atlas, features
        self.factor = atlas.factor
        features, present = reduced(features, atlas.usable.astype(np.float32), self.factor)
        self._mean: Floats32 = (features * present[..., np.newaxis]).sum((0, 1), dtype=np.float64) / max(
            present.sum(dtype=np.float64), 1.0
        )
        self._mean = self._mean.astype(np.float32)
        planes = np.moveaxis((features - self._mean) * (present[..., np.newaxis] > 0), 2, 0)
        self._axes = _components(planes)
        if self._axes is not None:
            planes = _along(self._axes, planes)
        self._grid = present.shape
        # Nothing lies in the margins, so that one of them stands for both.
        rows, columns = (length - atlas.margin // self.factor for length in present.shape)
        self._size = sf.next_fast_len(rows), sf.next_fast_len(columns, real=True)
        channels = [present, *planes * present, np.square(planes).sum(axis=0) * present]
        found = np.conj(self._spectra(np.stack(channels)))
        self._present, self._square = found[0], found[-1]
        self._channels = np.concatenate([np.complex64(-2) * found[1:-1], found[:1]])
        self._kept: dict[tuple[bytes, tuple[int, int]], _Known] = {}
        self._rooms: dict[tuple[int, int], Mask] = {}
        self._wholes: dict[tuple[int, int], Mask] = {}

    def room(self, shape: tuple[int, int]) -> Mask:
        """Find where a patch of that shape may be copied: (AH - h + 1, AW - w + 1) bool."""
        if shape not in self._rooms:
            self._rooms[shape] = whole(self.atlas.copied, shape)
        return self._rooms[shape]

    def fit(
        self, values: Floats32, weight: Floats32, margin: tuple[int, int], patch: tuple[int, int]
    ) -> Floats32:
        """Compute the mean squared difference at every place where the patch has room.

        Parameters
        ----------
        values : (h, w, F) float32 array
            The window: the patch and a margin round it.
        weight : (h, w) float32 array
            How much each pixel of the window counts; 0 where nothing is known.
        margin : (int, int)
            Rows above and columns left of the patch in the window, multiples of the factor and no more than
            the atlas's margin.
        patch : (int, int)
            Height and width of the patch.

        Returns
        -------
        (n, m) float32 array
            inf where the patch cannot lie. Row i, column j: the patch's first pixel at atlas row and column
            margin + factor * (i, j).
        """
        f = self.factor
        window, mass = reduced(values, weight, f)
        known = self._known(mass, margin, patch)
        rows, columns = known.blocked.shape
        planes = np.empty((len(self._channels), *mass.shape), np.float32)
        seen = planes[:-1] if self._axes is None else np.empty((window.shape[2], *mass.shape), np.float32)
        seen[...] = np.moveaxis(window, 2, 0)  # at once would go channel by channel, three times as slowly
        seen -= self._mean[:, np.newaxis, np.newaxis]
        if self._axes is not None:
            _along(self._axes, seen, out=planes[:-1])
        np.einsum("cyx,cyx->yx", planes[:-1], planes[:-1], out=planes[-1])
        planes *= mass
        total = known.squares.copy()
        for spectrum, one in zip(self._spectra(planes), self._channels, strict=True):
            spectrum *= one
            total += spectrum
        error = self._back(total, rows, columns)
        np.maximum(error, np.float32(0), out=error)
        error *= known.share
        np.copyto(error, np.float32(np.inf), where=known.blocked)
        return error

    def sample(self, values: Floats32, weight: Floats32, margin: tuple[int, int]) -> Compared:
        """Select the pixels by which places are compared at full size; of large windows a part. Arguments as
        for :meth:`fit`.
        """
        known = np.flatnonzero(weight)
        known = known[:: max(1, len(known) // _COMPARED_PIXELS)]
        y, x = np.divmod(known, weight.shape[1])
        offset = (y - margin[0]) * self.atlas.width + x - margin[1]
        shape = weight.shape[0], weight.shape[1]
        return Compared(offset, values.reshape(-1, values.shape[2])[known], weight.ravel()[known], shape)

    def around(
        self,
        rows: Indices,
        columns: Indices,
        step: int,
        sample: Compared,
        margin: tuple[int, int],
        patch: tuple[int, int],
    ) -> tuple[Indices, Indices, Floats32]:
        """Compute the nine places at and round each of some, at full size, and the mean squared difference
        there: (n, 9) each.

        Parameters
        ----------
        rows, columns : (n,) int array
            Atlas places of the patch's first pixel.
        step : int
            Distance between neighbouring places, px.
        sample : Compared
            Pixels of the window that is looked for.
        margin, patch
            As for :meth:`fit`.
        """
        room = self.room(patch)
        down, right = np.divmod(np.arange(9), 3)
        rows, columns = (
            np.clip(line[:, np.newaxis] + step * (moved - 1), first, limit - 1 - first)
            for line, moved, first, limit in zip(
                (rows, columns), (down, right), margin, room.shape, strict=True
            )
        )
        pixels = (rows * self.atlas.width + columns).reshape(-1, 1) + sample.offset
        channels = sample.values.shape[1]
        apart = self.features.reshape(-1, channels).take(pixels, axis=0)
        apart -= sample.values
        np.square(apart, out=apart)
        error: Floats32 = np.einsum("kn,n->k", apart.reshape(len(apart), -1), sample.weight.repeat(channels))
        error /= sample.weight.sum()
        part = np.flatnonzero(~self._whole(sample.shape)[rows - margin[0], columns - margin[1]])
        if len(part):  # the window meets pixels without a value
            share = self.atlas.usable.ravel().take(pixels.take(part, axis=0)) * sample.weight
            error[part] = np.einsum("knc,kn->k", apart.take(part, axis=0), share)
            error[part] /= np.maximum(share.sum(axis=1), np.float32(1e-9))
        error = error.reshape(rows.shape)
        error[~room[rows, columns]] = np.inf
        return rows, columns, error

    def _whole(self, shape: tuple[int, int]) -> Mask:
        """Find where a window of that shape meets pixels with a value only."""
        if shape not in self._wholes:
            self._wholes[shape] = whole(self.atlas.usable, shape)
        return self._wholes[shape]

    def _known(self, mass: Floats32, margin: tuple[int, int], patch: tuple[int, int]) -> _Known:
        """Compute the terms that depend on the weights alone, or take those kept of the same weights."""
        key = mass.tobytes() + bytes(f"{mass.shape} {margin}", "ascii"), patch
        found = self._kept.pop(key, None)
        if found is None:
            spectrum = self._spectra(mass[np.newaxis])[0]
            room = self.room(patch)[margin[0] :: self.factor, margin[1] :: self.factor]
            # Places farther down or right lie in a margin, where there is no room.
            rows, columns = (
                min(grid - length + 1, fits, size)
                for grid, length, fits, size in zip(
                    self._grid, mass.shape, room.shape, self._size, strict=True
                )
            )
            below = self._back(spectrum * self._present, rows, columns)
            blocked = (below < _LEAST_SHARE * mass.sum()) | ~room[:rows, :columns]
            share: Floats32 = np.reciprocal(np.maximum(below, np.float32(1e-9)))
            found = _Known(spectrum * self._square, share, blocked)
            if len(self._kept) >= _KEPT_WINDOWS:
                del self._kept[next(iter(self._kept))]
        self._kept[key] = found
        return found

    def _spectra(self, planes: Floats32) -> Complexes32:
        """Transform (n, h, w) planes on the common size; rows beyond them are zero and need no transform of
        their own.
        """
        lines = sf.rfft(planes, self._size[1], axis=2)
        result: Complexes32 = sf.fft(lines, self._size[0], axis=1)
        return result

    def _back(self, conjugate: Complexes32, rows: int, columns: int) -> Floats32:
        """Compute the first rows and columns of the plane with the conjugate of a spectrum, which is
        overwritten.
        """
        np.conj(conjugate, out=conjugate)
        lines = sf.ifft(conjugate, axis=0, overwrite_x=True)[:rows]
        result: Floats32 = sf.irfft(lines, self._size[1], axis=1)[:, :columns]
        return np.ascontiguousarray(result)


class Compared(NamedTuple):
    """Pixels of a window by which places are compared."""

    #: (n,) flat index on the atlas, counted from the patch's first pixel.
    offset: Indices
    #: (n, F) and (n,) float32.
    values: Floats32
    weight: Floats32
    #: Height and width of the window.
    shape: tuple[int, int]


class _Known(NamedTuple):
    """The terms of the weights alone: the conjugate spectrum of the first term, one over the weight that
    meets pixels with a value at every place, and the invalid places.
    """

    squares: Complexes32
    share: Floats32
    blocked: Mask


def _components(planes: Floats32) -> Floats32 | None:
    """Find the principal components of (n, h, w) planes of mean 0 that count, (k, n); None where all do."""
    values = planes.reshape(len(planes), -1).astype(float)
    _, directions = np.linalg.eigh(values @ values.T)
    farthest = np.abs(directions.T @ values).max(axis=1)[::-1]
    count = max(1, int(np.count_nonzero(farthest > _LEAST_COMPONENT * farthest[0])))
    if count == len(planes):
        return None
    axes: Floats32 = directions.T[::-1][:count].astype(np.float32)
    return axes


def _along(axes: Floats32, planes: Floats32, out: Floats32 | None = None) -> Floats32:
    """Sum (n, h, w) planes by (k, n) factors, in the planes' order: products of matrices would be rounded
    differently on other machines.
    """
    total = np.empty((len(axes), *planes.shape[1:]), np.float32) if out is None else out
    np.multiply(axes[:, :1, np.newaxis], planes[0], out=total)
    for factors, plane in zip(axes.T[1:], planes[1:], strict=True):
        total += factors[:, np.newaxis, np.newaxis] * plane
    return total


def box_sum(values: npt.NDArray[Any], shape: tuple[int, int]) -> npt.NDArray[np.int32]:
    """Sum every h × w box of an (H, W) array of whole numbers: (H - h + 1, W - w + 1)."""
    (h, w), rows = shape, len(values)
    across = np.zeros((rows, values.shape[1] + 1), np.int32)
    np.cumsum(values, axis=1, dtype=np.int32, out=across[:, 1:])
    sums: npt.NDArray[np.int32] = across[:, w:] - across[:, :-w]
    # Sums of 1, 2, 4 … rows make that of h; running sums down the columns take three times as long.
    left, done, bit = max(rows - h + 1, 0), 0, 1
    total = np.zeros((left, sums.shape[1]), np.int32)
    while left and bit <= h:
        if h & bit:
            total += sums[done : done + left]
            done += bit
        sums = sums[:-bit] + sums[bit:]
        bit *= 2
    return total


def whole(mask: Mask, shape: tuple[int, int]) -> Mask:
    """Test whether every h × w box of an (H, W) mask is full: (H - h + 1, W - w + 1)."""
    left = tuple(max(n - m + 1, 0) for n, m in zip(mask.shape, shape, strict=True))
    if 0 in left:
        return np.zeros(left, bool)
    for axis, length in enumerate(shape):
        done = 1
        while done < length:  # boxes of twice the length, or less, are two boxes
            step = min(done, length - done)
            first, second = (slice(None, -step), slice(step, None))
            mask = mask[first] & mask[second] if axis == 0 else mask[:, first] & mask[:, second]
            done += step
    return mask


def reduced(values: Floats32, weight: Floats32, factor: int) -> tuple[Floats32, Floats32]:
    """Compute weighted means over blocks of factor × factor pixels, and the blocks' weight; what does not
    fill a block counts with weight 0.
    """
    if factor == 1:
        return values.copy(), weight
    mass = _summed(weight[..., np.newaxis], factor)
    total = np.empty((*mass.shape[:2], values.shape[2]), np.float32)
    lines = max(_ROWS_AT_ONCE // factor, 1)
    for first in range(0, len(total), lines):
        rows = slice(factor * first, factor * (first + lines))
        total[first : first + lines] = _summed(values[rows] * weight[rows, :, np.newaxis], factor)
    total /= np.maximum(mass, np.float32(1e-9))
    return total, mass[..., 0] / np.float32(factor**2)


def _summed(values: Floats32, factor: int) -> Floats32:
    """Sum an (H, W, C) array over blocks of factor × factor pixels: rows first, which are long."""
    h, w, channels = (-(-values.shape[0] // factor), -(-values.shape[1] // factor), values.shape[2])
    padding = (0, h * factor - values.shape[0]), (0, w * factor - values.shape[1]), (0, 0)
    if padding[0][1] or padding[1][1]:
        values = np.pad(values, padding)
    rows = values.reshape(h, factor, w * factor * channels).sum(axis=1)
    result: Floats32 = rows.reshape(h, w, factor, channels).sum(axis=2)
    return result


def refined(
    compared: Sequence[tuple[PatchSearch, Compared, float]],
    rows: Indices,
    columns: Indices,
    margin: tuple[int, int],
    patch: tuple[int, int],
) -> tuple[Indices, Indices, Floats32]:
    """Refine the best places of a reduced search at full size, in ever smaller steps, and compute their
    errors.

    Parameters
    ----------
    compared : sequence of (PatchSearch, Compared, float)
        The searches, one at least and alike in their factor, each with its window and its strength.
    rows, columns : (n,) int array
        Atlas places of the patch's first pixel.
    margin, patch : (int, int)
        As for :meth:`PatchSearch.fit`.
    """
    step, each = compared[0][0].factor // 2, np.arange(len(rows))
    least = np.zeros(len(rows), np.float32)
    while step:
        near_rows = near_columns = np.zeros((len(rows), 9), np.intp)
        error = np.zeros((len(rows), 9), np.float32)
        for search, sample, strength in compared:
            near_rows, near_columns, part = search.around(rows, columns, step, sample, margin, patch)
            error = error + strength * part
        found = each, error.argmin(axis=1)
        rows, columns, least = near_rows[found], near_columns[found], error[found]
        step //= 2
    return rows, columns, least
