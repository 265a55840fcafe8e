"""Gaussian pyramids of images (Burt and Adelson 1983, doi:10.1145/245.247)."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from toposeam.arrays import Floats32

#: Pixels, about, of the planes that are processed together: more would not fit the caches.
_PIXELS_TOGETHER = 1 << 19


def in_runs(count: int, size: int) -> Iterator[slice]:
    """Divide `count` planes of `size` pixels each into runs that are processed together."""
    step = max(1, _PIXELS_TOGETHER // max(size, 1))
    for first in range(0, count, step):
        yield slice(first, min(first + step, count))


def gaussian(planes: Floats32, levels: int) -> list[Floats32]:
    """Compute the Gaussian pyramid, finest level first."""
    pyramid = [planes]
    for _ in range(levels):
        pyramid.append(reduce(pyramid[-1]))
    return pyramid


def reduce(planes: Floats32) -> Floats32:
    """Smooth an image and keep every other pixel. (C, h, w) to (C, h / 2, w / 2), for even h and w."""
    count, height, width = planes.shape
    result = np.empty((count, height // 2, width // 2), np.float32)
    for run in in_runs(count, height * width):
        rows = _halved(planes[run, ::2], planes[run, 1::2], 1)
        # Even and odd columns are copied out, so that strided rows are read only once.
        even, odd = np.ascontiguousarray(rows[..., ::2]), np.ascontiguousarray(rows[..., 1::2])
        np.multiply(_halved(even, odd, 2), np.float32(1 / 256), out=result[run])
    return result


def _halved(even: Floats32, odd: Floats32, axis: int) -> Floats32:
    """Smooth by (1, 4, 6, 4, 1) along one axis, and keep every other value; the ends are repeated."""
    first, last, rest, front = _parts(axis)
    result: Floats32 = even * np.float32(6)
    four = odd * np.float32(4)
    result += four
    result[rest] += four[front]
    result[rest] += even[front]
    result[front] += even[rest]
    result[first] += np.float32(5) * even[first]
    result[last] += odd[last]
    return result


def expand(planes: Floats32) -> Floats32:
    """Interpolate an image to twice the size. (C, h, w) to (C, 2 h, 2 w)."""
    channels, height, width = planes.shape
    result = np.empty((channels, 2 * height, 2 * width), np.float32)
    for run in in_runs(channels, 4 * height * width):
        wide = np.empty((run.stop - run.start, height, 2 * width), np.float32)
        # Strided rows are written only once.
        wide[..., ::2], wide[..., 1::2] = _between(planes[run], 2)
        _between(wide, 1, (result[run, ::2], result[run, 1::2]))
    return result


def expand_part(planes: Floats32, rows: slice, columns: slice) -> Floats32:
    """Compute some rows and columns of :func:`expand`, in whole pairs."""
    wide = [slice(max(part.start // 2 - 1, 0), part.stop // 2 + 1) for part in (rows, columns)]
    inside = [
        slice(part.start - 2 * around.start, part.stop - 2 * around.start)
        for part, around in zip((rows, columns), wide, strict=True)
    ]
    return expand(planes[:, wide[0], wide[1]])[:, inside[0], inside[1]]


def _between(
    planes: Floats32, axis: int, onto: tuple[Floats32, Floats32] | None = None
) -> tuple[Floats32, Floats32]:
    """Interpolate to twice as many values along one axis: the even and the odd ones, into `onto` if given."""
    even, odd = (np.empty_like(planes) for _ in range(2)) if onto is None else onto
    first, last, rest, front = _parts(axis)
    part = planes * np.float32(0.5)
    np.copyto(odd, part)
    odd[front] += part[rest]
    odd[last] += part[last]
    part *= np.float32(0.25)
    np.multiply(planes, np.float32(0.75), out=even)
    even[rest] += part[front]
    even[first] += part[first]
    even[front] += part[rest]
    even[last] += part[last]
    return even, odd


@cache
def _parts(axis: int) -> list[tuple[slice, ...]]:
    """Return indices along an axis: of the first value, the last, all but the first, and all but the last."""
    parts = slice(0, 1), slice(-1, None), slice(1, None), slice(0, -1)
    return [(*(slice(None),) * axis, part) for part in parts]
