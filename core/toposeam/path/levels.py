"""Planning on large grounds from coarse to fine.

The material is first optimised on a reduced ground. On each finer ground only a strip is free, along the way
found on the coarser one and along the shortest way on the full grid. The latter keeps gaps open that the
reduction closed.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats, Ints
from toposeam.path.gather import PathIteration, PathOptions, optimise_material
from toposeam.path.trace import trace

Cell = tuple[int, int]

#: Largest ground, px, that is optimised at full size.
WHOLE_PX = 30_000
#: Size, in cells, of the coarsest ground, about.
_COARSEST_CELLS = 20_000
#: Largest strip, in cells, that is optimised; on larger ones the material of the coarser ground is traced.
_MAX_STRIP_CELLS = 60_000
#: The iterations are divided by this on a strip, as its material starts near the optimum.
_FEWER_ITERATIONS = 3


def plan_coarse_to_fine(
    cost: Floats,
    sources: list[Cell],
    sinks: list[Cell],
    options: PathOptions,
    leg: int,
    report: Callable[[float], None],
) -> tuple[Floats, list[PathIteration], list[Floats]]:
    """Plan ways from sources to sinks, on large grounds from coarse to fine.

    Parameters
    ----------
    cost : (H, W) float array
        Cost of every pixel; infinite on obstacles.
    sources, sinks : list of (row, column)
    options : PathOptions
    leg : int
        Number of the leg, for the history.
    report : callable
        Called with the share of the work done, in [0, 1].

    Returns
    -------
    density : (H, W) float array in [0, 1]
        The material.
    history : list of PathIteration
    lines : list of (n, 2) float arrays
        x and y of pixel centres, from every source to its sink.
    """
    if cost.size <= WHOLE_PX:
        density, records = optimise_material(cost, sources, sinks, options, leg, report)
        return density, records, trace(density, cost, sources, sinks)
    shortest = shortest_ways(cost, sources, sinks)
    fewer = replace(
        options,
        gather=-(-options.gather // _FEWER_ITERATIONS),
        sharpen=-(-options.sharpen // _FEWER_ITERATIONS),
    )
    history: list[PathIteration] = []
    lines: list[Floats] = []
    density, before = np.ones((1, 1)), max(cost.shape)
    scales = _scales(cost.size)
    for number, scale in enumerate(scales):
        here, there = ([(y // scale, x // scale) for y, x in points] for points in (sources, sinks))
        if set(here) & set(there):
            continue  # a source and a sink share a cell of this ground
        level = reduce_ground(cost, scale, shortest)
        strip = bool(lines) or level.size > WHOLE_PX
        if strip:
            wide = 2 * min(-(-before // scale), 4) + 1
            level = _strip_along([*shortest, *(line[:, ::-1] for line in lines)], level, scale, wide)

        def report_level(share: float, done: int = number) -> None:
            report((done + share) / len(scales))

        if strip and np.count_nonzero(np.isfinite(level)) > _MAX_STRIP_CELLS:
            finer = np.arange(level.shape[0]) * scale // before, np.arange(level.shape[1]) * scale // before
            known = density[
                np.minimum(finer[0], len(density) - 1)[:, np.newaxis],
                np.minimum(finer[1], density.shape[1] - 1),
            ]
            density = np.where(np.isfinite(level), known, 0.0)
            guide = density * (np.min(level) / level)  # prefers cheap ground where the material is equal
        else:
            density, records = optimise_material(
                level, here, there, fewer if strip else options, leg, report_level, cell_px=scale
            )
            history += records
            guide = density
        lines = [line * scale for line in trace(guide, level, here, there)]
        before = scale
    report(1.0)
    return density, history, [line + 0.0 for line in lines]


def _scales(pixels: int) -> list[int]:
    """Return the factors by which the ground is reduced, from the coarsest to 1."""
    scales = [max(2, int(np.ceil(np.sqrt(pixels / _COARSEST_CELLS))))]
    while scales[-1] > 1:
        scales.append(scales[-1] // 2)
    return scales


def reduce_ground(cost: Floats, scale: int, ways: list[Ints]) -> Floats:
    """Reduce a ground to cells of `scale` px, with the geometric mean of their costs.

    A cell with an obstacle is an obstacle, unless one of the (row, column) `ways` leads through it.
    """
    if scale == 1:
        return cost.copy()
    height, width = (-(-side // scale) for side in cost.shape)
    free = np.isfinite(cost)

    def cells(values: npt.NDArray[np.generic], beyond: float) -> Floats:
        padded = np.full((height * scale, width * scale), beyond)
        padded[: cost.shape[0], : cost.shape[1]] = values
        total: Floats = padded.reshape(height, scale, width, scale).sum(axis=(1, 3))
        return total

    count = cells(free, 0.0)
    mean = np.exp(cells(np.log(np.where(free, cost, 1.0)), 0.0) / np.maximum(count, 1.0))
    open_ = cells(~free, 0.0) == 0
    for way in ways:
        open_[way[:, 0] // scale, way[:, 1] // scale] = True
    return np.where(open_, mean, np.inf)


def _strip_along(ways: Sequence[Ints | Floats], level: Floats, scale: int, wide: int) -> Floats:
    """Restrict a reduced ground to a strip: beyond `wide` cells from the (row, column) ways, px, all is
    obstacle.
    """
    near = np.zeros(level.shape, np.uint8)
    for way in ways:
        rows, columns = (np.asarray(way) // scale).astype(np.int64).T
        near[np.minimum(rows, level.shape[0] - 1), np.minimum(columns, level.shape[1] - 1)] = 1
    return np.where(ndimage.maximum_filter(near, 2 * wide + 1) > 0, level, np.inf)


def shortest_ways(cost: Floats, sources: list[Cell], sinks: list[Cell]) -> list[Ints]:
    """Find the cheapest way on the grid from every source to a sink, as (n, 2) rows and columns of pixels.

    Successive pixels share a side. No way leads between two obstacles that touch at a corner. The direction
    of a way is not defined.
    """
    from skimage.graph import MCP_Geometric

    price = np.clip(cost / float(np.median(cost[np.isfinite(cost)])), 1e-6, 1e6)
    search = MCP_Geometric(np.where(np.isfinite(cost), price, -1.0))
    _, steps = search.find_costs(sinks, sources, find_all_ends=True)
    offsets = [(int(down), int(right)) for down, right in search.offsets]
    found = [_without_diagonals(_followed_back(steps, offsets, source), cost) for source in sources]
    if all(way is not None for way in found):
        return [way for way in found if way is not None]
    lines = trace(1 / price, cost, sources, sinks)  # respects such corners, with three times the memory
    ways = [_without_diagonals(line[:, ::-1].astype(np.int64), cost) for line in lines]
    return [way for way in ways if way is not None]


def _followed_back(steps: npt.NDArray[np.integer], offsets: list[Cell], cell: Cell) -> Ints:
    """Follow the steps of a search back from a cell: (n, 2) rows and columns, from the search's start on."""
    row, column = cell
    way = array("q", cell)  # takes a tenth of a list's memory
    while (step := int(steps[row, column])) >= 0:
        down, right = offsets[step]
        row, column = row - down, column - right
        way.extend((row, column))
    return np.array(way, np.int64).reshape(-1, 2)[::-1]


def _without_diagonals(way: Ints, cost: Floats) -> Ints | None:
    """Replace every diagonal step by two over a free pixel; None if one leads between two obstacles."""
    step = np.flatnonzero((np.diff(way, axis=0) != 0).all(axis=1))
    one = np.column_stack([way[step, 0], way[step + 1, 1]])
    other = np.column_stack([way[step + 1, 0], way[step, 1]])
    first, second = (np.isfinite(cost[tuple(cells.T)]) for cells in (one, other))
    if not (first | second).all():
        return None
    return np.insert(way, step + 1, np.where(first[:, np.newaxis], one, other), axis=0)
