"""From coarse to fine: volumes of blocks, and what their heat says about the voxels inside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Mask
from toposeam.heat.bricks import HIGH, LOW, along

#: Grids with at most this many voxels are not made coarser still, ...
COARSEST = 4096
#: ... and axes with fewer voxels keep all of them.
_SHORTEST = 8


@dataclass(frozen=True, slots=True, eq=False)
class VolumeLevel:
    """One grid of the hierarchy."""

    cost: tuple[Floats32, ...]  #: along each axis, as for :class:`toposeam.heat.grid_flow.GridFlow`
    fixed: Mask
    hot: Mask
    #: How many voxels of the next finer grid a voxel spans along each axis; the last ones may stick out.
    span: tuple[int, ...]


def coarser(level: VolumeLevel) -> VolumeLevel | None:
    """Return the grid of blocks of two voxels along each long axis; None where the grid is coarse enough.

    Two blocks are joined by all that joins their voxels. A block that holds fixed voxels of one side is fixed
    to it, and is free when it holds both.
    """
    shape = level.fixed.shape
    span = tuple(2 if length >= _SHORTEST else 1 for length in shape)
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


def refined(values: npt.NDArray[np.generic], span: tuple[int, ...], shape: tuple[int, ...]) -> npt.NDArray:  # type: ignore[type-arg]
    """Return the values of blocks on the voxels inside."""
    for axis, side in enumerate(span):
        if side > 1:
            values = values.repeat(side, axis)
        values = values[along(axis, slice(shape[axis]))]
    return np.ascontiguousarray(values)


def refined_filling(filled: list[Floats32], span: tuple[int, ...], shape: tuple[int, ...]) -> list[Floats32]:
    """Return the shares of capacity used between blocks on the interfaces of voxels: the same share between
    two blocks, the mean of both sides within one.
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
        result.append(refined(fine[along(axis, slice(length))], across, target))
    return result


def _blocks(values: npt.NDArray[np.generic], span: tuple[int, ...]) -> npt.NDArray:  # type: ignore[type-arg]
    """Arrange values in blocks, filled up with zeros: (n, m, …) to (n / span, span, m / span, span, …)."""
    missing = [(0, -length % side) for length, side in zip(values.shape, span, strict=True)]
    if any(more for _, more in missing):
        values = np.pad(values, missing)
    shape = [n for length, side in zip(values.shape, span, strict=True) for n in (length // side, side)]
    return values.reshape(shape)


def _within(ndim: int) -> tuple[int, ...]:
    return tuple(range(1, 2 * ndim, 2))
