"""Values of which many in a row are alike, packed."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

#: How often each comes that differs from the one before, and which it is; whether both are as they are, not
#: compressed.
Packed = tuple[bytes, bytes, bool]

#: So many runs are worth compressing.
_MANY = 64


def packed(values: npt.NDArray[Any]) -> Packed:
    """(N,) values by the runs of those that are alike, N > 0. Telling that takes a quarter of the time that
    compressing the values themselves does, and is smaller.

    Examples
    --------
    >>> runs = packed(np.repeat(np.array([3, 5], np.int16), [1000, 2000]))
    >>> sum(map(len, runs[:2])), unpacked(runs, np.int16)[998:1002].tolist()
    (12, [3, 3, 5, 5])
    """
    changes = np.flatnonzero(values[1:] != values[:-1])
    bounds = np.empty(len(changes) + 2, np.int32)
    bounds[0], bounds[1:-1], bounds[-1] = -1, changes, len(values) - 1
    often, which = np.diff(bounds).tobytes(), values[bounds[1:]].tobytes()
    if len(changes) < _MANY:
        return often, which, True
    return zlib.compress(often, 1), zlib.compress(which, 1), False


def unpacked(runs: Packed, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """What was packed."""
    often, which, plain = runs
    if not plain:
        often, which = zlib.decompress(often), zlib.decompress(which)
    return np.frombuffer(which, dtype).repeat(np.frombuffer(often, np.int32))
