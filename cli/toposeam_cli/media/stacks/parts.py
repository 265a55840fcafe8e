"""Voxels in files: read part by part, with one sentence for each failure."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from toposeam.errors import ImageError, MissingPackageError, TopoSeamError


def needs(package: str, path: Path) -> Any:
    """Import an optional package.

    Raises
    ------
    MissingPackageError
    """
    try:
        return importlib.import_module(package)
    except ImportError as error:
        name = package.partition(".")[0]
        wanted = "'dask[array]'" if name == "dask" else name
        raise MissingPackageError(
            f"{path.name} needs {name}; install it with: pip install {wanted}"
        ) from error


@contextmanager
def damage_reported(path: Path) -> Iterator[None]:
    """Turn any error of a reader on a damaged file into one sentence.

    Raises
    ------
    ImageError
    """
    try:
        yield
    except (TopoSeamError, MemoryError):
        raise
    except Exception as error:  # readers raise errors of all kinds
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise ImageError(
            f"{path} cannot be read as a stack ({reason}): it is damaged or cut short; copy or save it again"
        ) from error


def check_voxels(path: Path, shape: Sequence[Any], most: float) -> None:
    """Refuse a stack of too many voxels, before memory is allocated.

    Raises
    ------
    ImageError
    """
    if math.prod(map(int, shape)) > most:
        raise ImageError(
            f"{path} has {'×'.join(map(str, shape))} voxels, more than the {most:.6g} allowed; raise "
            "--max-voxels if the file is trusted"
        )


class Mapped:
    """An array in a file, mapped anew for every part that is read, so that parts do not stay in memory."""

    def __init__(self, path: Path, opened: Callable[[], np.ndarray]) -> None:
        voxels = opened()
        self.shape, self.dtype, self.ndim = voxels.shape, voxels.dtype, voxels.ndim
        self._path, self._opened = path, opened

    def __getitem__(self, key: Any) -> np.ndarray:
        with damage_reported(self._path):
            return np.array(self._opened()[key])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self[...], dtype)

    def squeeze(self, axes: tuple[int, ...]) -> Mapped:
        """Return the array without axes of length 1."""
        return Mapped(self._path, lambda: self._opened().squeeze(axes))

    def transpose(self, order: list[int]) -> Mapped:
        """Return the array with its axes in another order."""
        return Mapped(self._path, lambda: self._opened().transpose(order))


def ordered(voxels: Any, axes: str, kept: list[str], path: Path) -> Any:
    """Return voxels as (z, y, x) or (z, y, x, channels).

    Raises
    ------
    ImageError
        For further axes.
    """
    singles = tuple(place for place, axis in enumerate(axes) if axis not in kept)
    voxels = voxels.squeeze(singles) if singles else voxels
    named = "".join(kept).replace("I", "Z").replace("Q", "Z")
    channels = [axis for axis in named if axis in "CS"]
    others = [axis for axis in named if axis not in "CSYX"]
    if len(others) != 1 or len(channels) > 1 or not {"Y", "X"} <= set(named):
        raise ImageError(
            f"{path} has axes {''.join(kept)}; give one stack of slices: Z, Y, X and perhaps channels"
        )
    order = [
        named.index(others[0]),
        named.index("Y"),
        named.index("X"),
        *(named.index(axis) for axis in channels),
    ]
    return voxels.transpose(order)
