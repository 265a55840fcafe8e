"""Hierarchy of grids: volumes of blocks, and the transfer of potentials from blocks to their voxels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Mask
from toposeam.heat.bricks import HIGH, LOW, along

#: Size, in voxels, up to which a grid is not made coarser.
COARSEST = 4096
#: Least length, in voxels, of an axis that is halved.
_MIN_HALVED = 8


@dataclass(frozen=True, slots=True, eq=False)
class VolumeLevel:
    """One grid of the hierarchy."""

    cost: tuple[Floats32, ...]  #: along each axis, as for :class:`toposeam.heat.grid_flow.GridFlow`
    fixed: Mask
    hot: Mask
    #: Voxels of the next finer grid in one voxel along each axis; the last voxels may reach beyond that grid.
    span: tuple[int, ...]


def coarsen(level: VolumeLevel) -> VolumeLevel | None:
    """Return the grid of blocks of two voxels along each long axis; None if the grid is coarse enough.

    The cost between two blocks is the sum of the costs between their voxels. A block with fixed voxels of one
    side is fixed to it; with fixed voxels of both sides it is free.
    """
    shape = level.fixed.shape
    span = tuple(2 if length >= _MIN_HALVED else 1 for length in shape)
    if level.fixed.size <= COARSEST or set(span) == {1}:
        return None
    cost = []
    for axis, part in enumerate(level.cost):
        between = part[along(axis, slice(span[axis] - 1, None, span[axis]))]
        across = tuple(1 if place == axis else side for place, side in enumerate(span))
        cost.append(_blocks(between, across).sum(axis=_within(between.ndim), dtype=np.float32))
    cold: Mask = _blocks(level.fixed & ~level.hot, span).max(axis=_within(len(shape)))
    hot: Mask = _blocks(level.fixed & level.hot, span).max(axis=_within(len(shape)))
    return VolumeLevel(tuple(cost), cold ^ hot, hot & ~cold, span)


def refine(values: npt.NDArray[np.generic], span: tuple[int, ...], shape: tuple[int, ...]) -> npt.NDArray:  # type: ignore[type-arg]
    """Repeat the values of blocks on the voxels inside."""
    for axis, side in enumerate(span):
        if side > 1:
            values = values.repeat(side, axis)
        values = values[along(axis, slice(shape[axis]))]
    return np.ascontiguousarray(values)


def refine_filling(filled: list[Floats32], span: tuple[int, ...], shape: tuple[int, ...]) -> list[Floats32]:
    """Transfer the used shares of capacity from interfaces of blocks to interfaces of voxels.

    Interfaces between two blocks keep their share; those within a block get the mean of both its sides.
    """
    result = []
    for axis, part in enumerate(filled):
        across = tuple(1 if place == axis else side for place, side in enumerate(span))
        length = shape[axis] - 1
        if span[axis] == 1:
            fine = part
        else:
            fine = np.zeros(
                (*part.shape[:axis], 2 * part.shape[axis] + 1, *part.shape[axis + 1 :]), np.float32
            )
            fine[along(axis, slice(1, None, 2))] = part
            inside = fine[along(axis, slice(None, None, 2))]
            inside[along(axis, LOW)] += part
            inside[along(axis, HIGH)] += part
            inside[along(axis, slice(1, -1))] *= np.float32(0.5)
        target = (*shape[:axis], length, *shape[axis + 1 :])
        result.append(refine(fine[along(axis, slice(length))], across, target))
    return result


def _blocks(values: npt.NDArray[np.generic], span: tuple[int, ...]) -> npt.NDArray:  # type: ignore[type-arg]
    """Reshape values to blocks, padded with zeros: (n, m, …) to (n / span, span, m / span, span, …)."""
    missing = [(0, -length % side) for length, side in zip(values.shape, span, strict=True)]
    if any(more for _, more in missing):
        values = np.pad(values, missing)
    shape = [n for length, side in zip(values.shape, span, strict=True) for n in (length // side, side)]
    return values.reshape(shape)


def _within(ndim: int) -> tuple[int, ...]:
    return tuple(range(1, 2 * ndim, 2))
