"""Images at smaller and smaller sizes, smooth (Burt and Adelson 1983, doi:10.1145/245.247)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats32 = npt.NDArray[np.float32]


def gaussian(planes: Floats32, levels: int) -> list[Floats32]:
    """The Gaussian pyramid, finest first."""
    pyramid = [planes]
    for _ in range(levels):
        pyramid.append(reduce(pyramid[-1]))
    return pyramid


def reduce(planes: Floats32) -> Floats32:
    """Every other pixel of the smoothed image. (C, h, w) to (C, h / 2, w / 2), for even h and w."""
    return _halved(_halved(planes, 1), 2)


def _halved(planes: Floats32, axis: int) -> Floats32:
    """Smoothed by (1, 4, 6, 4, 1) / 16 along one axis, every other value; the ends go on."""
    even, odd = planes[_at(axis, slice(0, None, 2))], planes[_at(axis, slice(1, None, 2))]
    first, last, rest, front = (
        _at(axis, part) for part in (slice(0, 1), slice(-1, None), slice(1, None), slice(0, -1))
    )
    result: Floats32 = even * np.float32(6)
    four = odd * np.float32(4)
    result += four
    result[rest] += four[front]
    result[rest] += even[front]
    result[front] += even[rest]
    result[first] += np.float32(5) * even[first]
    result[last] += odd[last]
    result *= np.float32(1 / 16)
    return result


def expand(planes: Floats32) -> Floats32:
    """The image at twice the size, smooth. (C, h, w) to (C, 2 h, 2 w)."""
    return _doubled(_doubled(planes, 1), 2)


def _doubled(planes: Floats32, axis: int) -> Floats32:
    shape = list(planes.shape)
    shape[axis] *= 2
    result = np.empty(shape, np.float32)
    even, odd = result[_at(axis, slice(0, None, 2))], result[_at(axis, slice(1, None, 2))]
    first, last, rest, front = (
        _at(axis, part) for part in (slice(0, 1), slice(-1, None), slice(1, None), slice(0, -1))
    )
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
    return result


def _at(axis: int, part: slice) -> tuple[slice, ...]:
    return (*(slice(None),) * axis, part)
