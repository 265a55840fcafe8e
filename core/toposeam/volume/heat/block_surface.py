"""The first surface between stacks larger than memory, on coarse voxels with costs summed block by block."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np

from toposeam.arrays import Bytes, Floats32, Mask
from toposeam.heat.bricks import along
from toposeam.heat.threads import one_thread
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.seam.problem.overlap import FREE, A, B, Overlap
from toposeam.volume.heat.method import SurfaceOptions, heat_surface
from toposeam.volume.problem.cells import add_prices
from toposeam.volume.problem.posing import face_areas, match_costs
from toposeam.volume.problem.surface_problem import SurfaceProblem

#: Largest number of coarse voxels of the overlap: their grid must fit into memory.
_MAX_COARSE_VOXELS = 2_000_000
#: Share of the work, for the progress, that is done when the coarse surface is found.
COARSE_SHARE = 0.3
#: Options of the coarse surface, of low precision: it only places the slab for the fine one.
_COARSE_OPTIONS = SurfaceOptions(tolerance=1e-2)


def coarse_span(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the voxels per coarse voxel along each axis; the longest axes are reduced first."""
    span = [1, 1, 1]
    while (
        np.prod([-(-length // side) for length, side in zip(shape, span, strict=True)]) > _MAX_COARSE_VOXELS
    ):
        axis = int(np.argmax([length / side for length, side in zip(shape, span, strict=True)]))
        span[axis] *= 2
    return tuple(span)


def coarse_labels(
    a: Any,
    b: Any,
    shape: tuple[int, ...],
    span: tuple[int, ...],
    ground: dict[tuple[int, bool], int],
    cost: MatchCost,
    spacing: Sequence[float],
    block: int,
    data_range: float | None,
    progress: Callable[[float], None] | None,
    cells: Any = None,
) -> Mask:
    """Find the labels of the coarse voxels in the common box of two stacks.

    Parameters
    ----------
    a, b : (D, H, W, C) dask arrays
        The voxels of each stack in the box.
    shape : (int, int, int)
        Shape of the box.
    span : (int, int, int)
        Voxels per coarse voxel along each axis.
    ground : mapping
        The stack, A or B, beyond each face of the box, as for :func:`block_sides`.
    cost, spacing, data_range
        As for :func:`toposeam.volume`.
    block : int
        Side, in voxels, of the blocks that are read at once.
    cells : (D, H, W, K) dask array, optional
        As for :func:`toposeam.volume.problem.cells.add_prices`.
    """
    import dask

    coarse = tuple(-(-length // side) for length, side in zip(shape, span, strict=True))
    costs = tuple(
        np.zeros([length - (place == axis) for place, length in enumerate(coarse)], np.float32)
        for axis in range(3)
    )
    sides = [max(side, block // side * side) for side in span]
    corners = list(product(*(range(0, length, side) for length, side in zip(shape, sides, strict=True))))
    rows: dict[int, list[tuple[int, ...]]] = {}
    for corner in corners:
        rows.setdefault(corner[0], []).append(corner)
    for done, row in enumerate(rows.values()):
        tasks = []
        for corner in row:
            # One voxel below for gradients; above, the next voxel and one for its gradients.
            low = [max(0, first - 1) for first in corner]
            high = [
                min(length, first + side + 2)
                for first, side, length in zip(corner, sides, shape, strict=True)
            ]
            part = tuple(slice(first, last) for first, last in zip(low, high, strict=True))
            inner = tuple(first - before for first, before in zip(corner, low, strict=True))
            tasks.append(
                dask.delayed(_coarse_costs, pure=False)(
                    a[part],
                    b[part],
                    inner,
                    tuple(sides),
                    span,
                    cost,
                    tuple(spacing),
                    data_range,
                    None if cells is None else cells[part],
                )
            )
        for corner, found in zip(row, dask.compute(*tasks), strict=True):
            first = [at // side for at, side in zip(corner, span, strict=True)]
            for axis, values in enumerate(found):
                room = costs[axis][
                    tuple(slice(at, at + n) for at, n in zip(first, values.shape, strict=True))
                ]
                room += values[tuple(slice(n) for n in room.shape)]
        if progress is not None:
            progress(COARSE_SHARE * (done + 1) / len(rows))
    side = block_sides(coarse, ground, (0, 0, 0), coarse)
    problem = SurfaceProblem(Overlap(side, np.ones(coarse, bool), (0, 0, 0), coarse), costs)
    with one_thread():
        solution, _ = heat_surface(problem, _COARSE_OPTIONS)
    return solution.labels


def _coarse_costs(
    a: Any,
    b: Any,
    inner: tuple[int, ...],
    sides: tuple[int, ...],
    span: tuple[int, ...],
    cost: MatchCost,
    spacing: Sequence[float],
    data_range: float | None,
    cells: Any,
) -> tuple[Floats32, ...]:
    """Compute the costs between the coarse voxels of a block, and to their neighbours above it."""
    result = []
    for axis, fine in enumerate(block_costs(a, b, cost, spacing, data_range, cells)):
        box = tuple(slice(first, first + side) for first, side in zip(inner, sides, strict=True))
        faces = fine[box][along(axis, slice(span[axis] - 1, None, span[axis]))]
        across = [1 if place == axis else side for place, side in enumerate(span)]
        for place, side in enumerate(across):
            if side > 1:
                faces = np.add.reduceat(faces, np.arange(0, faces.shape[place], side), axis=place)
        result.append(faces.astype(np.float32))
    return tuple(result)


def block_costs(
    a: Any, b: Any, cost: MatchCost, spacing: Sequence[float], data_range: float | None, cells: Any = None
) -> tuple[Floats32, ...]:
    """Compute the match cost along three axes within a block, weighted by the areas of faces."""
    shape = a.shape[:3]
    everywhere = np.ones(shape, bool)
    overlap = Overlap(np.full(shape, FREE, np.uint8), everywhere, (0, 0, 0), shape)
    costs = match_costs(np.asarray(a), np.asarray(b), overlap, everywhere, everywhere, cost, None, data_range)
    if cells is not None:
        add_prices(costs, np.asarray(cells))
    for part, area in zip(costs, face_areas(spacing), strict=True):
        part *= area
    return costs


def block_sides(
    shape: tuple[int, ...], ground: dict[tuple[int, bool], int], start: Sequence[int], whole: tuple[int, ...]
) -> Bytes:
    """Return the side, `A`, `B` or `FREE`, of every voxel in a part of the common box.

    Parameters
    ----------
    shape : (int, int, int)
        Shape of the part.
    ground : mapping
        The stack, A or B, beyond faces of the box, by axis and whether at the upper end. Voxels at a face
        are fixed to it, unless they also touch the other stack.
    start : three int
        Index of the part's first voxel in the box.
    whole : (int, int, int)
        Shape of the box.
    """
    touches = np.zeros((2, *shape), bool)
    for (axis, upper), label in ground.items():
        at = whole[axis] - 1 - start[axis] if upper else -start[axis]
        if 0 <= at < shape[axis]:
            touches[label][along(axis, slice(at, at + 1))] = True
    side = np.full(shape, FREE, np.uint8)
    side[touches[A] & ~touches[B]], side[touches[B] & ~touches[A]] = A, B
    return side
