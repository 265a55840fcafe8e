"""Large grounds from coarse to fine.

Heat is led over a reduced ground first; on each finer one it only has the strip along what it found on the
one before, and along the shortest way on the grid, which has gaps that the reduction closed.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats, Ints
from toposeam.path.gather import PathIteration, PathOptions, gather
from toposeam.path.trace import trace

Cell = tuple[int, int]

#: Grounds of at most so many px are led over as they are.
WHOLE_PX = 30_000
#: A reduced ground has about so many cells.
_COARSE = 20_000
#: A strip of more cells is not led over again: its way is read off the material of the coarser one.
_LARGEST_STRIP = 60_000
#: On a strip, heat takes this share of the iterations: it is nearly there.
_SHARE = 3


def lead(
    cost: Floats,
    sources: list[Cell],
    sinks: list[Cell],
    options: PathOptions,
    leg: int,
    report: Callable[[float], None],
) -> tuple[Floats, list[PathIteration], list[Floats]]:
    """The material, its history, and a line of pixel centres from every source to its sink."""
    if cost.size <= WHOLE_PX:
        density, records = gather(cost, sources, sinks, options, leg, report)
        return density, records, trace(density, cost, sources, sinks)
    shortest = shortest_ways(cost, sources, sinks)
    fewer = replace(options, gather=-(-options.gather // _SHARE), sharpen=-(-options.sharpen // _SHARE))
    history: list[PathIteration] = []
    lines: list[Floats] = []
    density, before = np.ones((1, 1)), max(cost.shape)
    scales = _scales(cost.size)
    for number, scale in enumerate(scales):
        here, there = ([(y // scale, x // scale) for y, x in points] for points in (sources, sinks))
        if set(here) & set(there):
            continue  # too coarse to tell them apart
        level = reduced(cost, scale, shortest)
        strip = bool(lines) or level.size > WHOLE_PX
        if strip:
            wide = 2 * min(-(-before // scale), 4) + 1
            level = _along([*shortest, *(line[:, ::-1] for line in lines)], level, scale, wide)

        def told(share: float, done: int = number) -> None:
            report((done + share) / len(scales))

        if strip and np.count_nonzero(np.isfinite(level)) > _LARGEST_STRIP:
            finer = np.arange(level.shape[0]) * scale // before, np.arange(level.shape[1]) * scale // before
            known = density[
                np.minimum(finer[0], len(density) - 1)[:, np.newaxis],
                np.minimum(finer[1], density.shape[1] - 1),
            ]
            density = np.where(np.isfinite(level), known, 0.0)
            guide = density * (np.min(level) / level)  # the cheaper the better, where material is alike
        else:
            density, records = gather(
                level, here, there, fewer if strip else options, leg, told, cell_px=scale
            )
            history += records
            guide = density
        lines = [line * scale for line in trace(guide, level, here, there)]
        before = scale
    report(1.0)
    return density, history, [line + 0.0 for line in lines]


def _scales(pixels: int) -> list[int]:
    """By how much the ground is reduced, from coarse to 1."""
    scales = [max(2, int(np.ceil(np.sqrt(pixels / _COARSE))))]
    while scales[-1] > 1:
        scales.append(scales[-1] // 2)
    return scales


def reduced(cost: Floats, scale: int, ways: list[Ints]) -> Floats:
    """The geometric mean of the costs in cells of `scale` px; cells with an obstacle are one, unless one of
    the (row, column) `ways` leads through.
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


def _along(ways: Sequence[Ints | Floats], level: Floats, scale: int, wide: int) -> Floats:
    """A reduced ground with obstacles everywhere but within `wide` cells of the (row, column) ways, px."""
    near = np.zeros(level.shape, np.uint8)
    for way in ways:
        rows, columns = (np.asarray(way) // scale).astype(np.int64).T
        near[np.minimum(rows, level.shape[0] - 1), np.minimum(columns, level.shape[1] - 1)] = 1
    return np.where(ndimage.maximum_filter(near, 2 * wide + 1) > 0, level, np.inf)


def shortest_ways(cost: Floats, sources: list[Cell], sinks: list[Cell]) -> list[Ints]:
    """(n, 2) rows and columns of the pixels between every source and the sink that is nearest along the grid,
    in either direction, over their sides, never between two obstacles that touch at a corner.
    """
    from skimage.graph import MCP_Geometric

    price = np.clip(cost / float(np.median(cost[np.isfinite(cost)])), 1e-6, 1e6)
    search = MCP_Geometric(np.where(np.isfinite(cost), price, -1.0))
    _, steps = search.find_costs(sinks, sources, find_all_ends=True)
    offsets = [(int(down), int(right)) for down, right in search.offsets]
    found = [_over_sides(_back(steps, offsets, source), cost) for source in sources]
    if all(way is not None for way in found):
        return [way for way in found if way is not None]
    lines = trace(1 / price, cost, sources, sinks)  # minds such corners, and takes three times the memory
    ways = [_over_sides(line[:, ::-1].astype(np.int64), cost) for line in lines]
    return [way for way in ways if way is not None]


def _back(steps: npt.NDArray[np.integer], offsets: list[Cell], cell: Cell) -> Ints:
    """(n, 2) rows and columns from where a search began to a cell, by the step that led to each; a list of
    Python's would take ten times the memory.
    """
    row, column = cell
    way = array("q", cell)
    while (step := int(steps[row, column])) >= 0:
        down, right = offsets[step]
        row, column = row - down, column - right
        way.extend((row, column))
    return np.array(way, np.int64).reshape(-1, 2)[::-1]


def _over_sides(way: Ints, cost: Floats) -> Ints | None:
    """A way without diagonal steps; None where one leads between two obstacles."""
    step = np.flatnonzero((np.diff(way, axis=0) != 0).all(axis=1))
    one = np.column_stack([way[step, 0], way[step + 1, 1]])
    other = np.column_stack([way[step + 1, 0], way[step, 1]])
    first, second = (np.isfinite(cost[tuple(cells.T)]) for cells in (one, other))
    if not (first | second).all():
        return None
    return np.insert(way, step + 1, np.where(first[:, np.newaxis], one, other), axis=0)
