"""Divide two layers anew in the band of pixels beside their seam.

Beside a seam of a few thousand pixels, in an overlap of millions, only a band may change. Its pixels become a
list of nodes, and the interfaces between them elements. The layers that show around the band, one of the two
or a third one, become terminals. Nothing as large as the overlap is computed: match costs are evaluated tile
by tile along the band. Bands that do not touch may be divided in other processes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from toposeam.arrays import Floats, Indices, Labels, Mask
from toposeam.heat.threads import one_thread
from toposeam.layers.canvas.layer import Box, cut
from toposeam.layers.canvas.tile_map import TILE, uniform
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.labelling.problem import Labelling, PairCost
from toposeam.seam.cut_solver import CutSolver
from toposeam.seam.exact.expansion import LEAST_GAIN, BinaryCut

#: Rows and columns of pixels of the canvas.
Pixels = tuple[Indices, Indices]

#: Side of the tiles in which costs are evaluated, px.
_COST_TILE = 192


@dataclass(frozen=True, eq=False)
class Band:
    """Pixels that show one of two layers and may show the other."""

    #: (n,) rows and columns on the canvas.
    rows: Indices
    columns: Indices
    #: (n,) bool: True at pixels that show the second layer now.
    second: Mask
    #: The cut between the layers; the second one is the hot terminal.
    cut: BinaryCut

    def total(self, second: Mask) -> float:
        """Compute Σ M over the interfaces that a division of the pixels cuts."""
        ends = np.append(second, [False, True])
        return float(self.cut.cost[ends[self.cut.tail] != ends[self.cut.head]].sum())


def band_of(labelling: Labelling, label_map: Labels, pair: Pair, opened: Mask | None) -> Band | None:
    """Find the open pixels that show one of two layers and may show either; None if there are none.

    Parameters
    ----------
    labelling : Labelling
    label_map : (H, W) int16 array
    pair : (int, int)
    opened : (H, W) bool array, or None for all pixels
    """
    cost = labelling.costs.get(pair)
    if cost is None:
        return None
    inner = cost.box.grown(-1).shared(labelling.canvas)
    if not all(inner.shape):
        return None
    box = inner.grown(1)
    width = box.shape[1]
    open_ = np.ones(inner.shape, bool) if opened is None else opened[inner.slices]
    rows, columns = np.divmod(np.flatnonzero(open_), inner.shape[1])
    labels = labelling.labels_in(label_map, box).ravel()
    at = (rows + 1) * width + columns + 1
    shows = labels.take(at)
    chosen = (shows == pair[0]) | (shows == pair[1])
    for index in pair:
        place = labelling.places[index]
        if uniform(labelling.allowed[index], inner.moved(-place.top, -place.left)) is None:
            chosen &= cut(labelling.allowed[index], place, inner)[rows, columns]
    rows, columns, at, shows = rows[chosen], columns[chosen], at[chosen], shows[chosen]
    if not len(at):
        return None
    return _joined(labelling, pair, box, labels, at, shows == pair[1])


def _joined(
    labelling: Labelling, pair: Pair, box: Box, labels: npt.NDArray[np.int16], at: Indices, second: Mask
) -> Band:
    """Pose the cut of a band whose pixels are given by flat indices in a box."""
    n, width = len(at), box.shape[1]
    node = np.full(labels.size, -1, np.int32)
    node[at] = np.arange(n, dtype=np.int32)
    # Per pair of layers: the nodes, their neighbours, the first pixel of each interface, and its axis.
    found: dict[Pair, list[tuple[Indices, ...]]] = {pair: []}

    def add(layers: Pair, own: Indices, head: Indices, first: Indices, axis: int) -> None:
        layers = min(layers), max(layers)
        if layers in labelling.costs:
            found.setdefault(layers, []).append((own, head, first, np.full(len(own), axis)))

    for axis, step in ((1, 1), (0, width)):
        ends = node.take(at + step)
        both = np.flatnonzero(ends >= 0)
        add(pair, both, ends[both].astype(np.intp), at[both], axis)
        for beyond, first in ((at + step, at), (at - step, at - step)):
            outer = np.flatnonzero(node.take(beyond) < 0)
            shown = labels.take(beyond[outer])
            for other in np.flatnonzero(np.bincount(shown + 1)[1:]).tolist():
                own = outer[shown == other]
                ties = (
                    [(pair, pair.index(other))]
                    if other in pair
                    else [((pair[k], other), 1 - k) for k in (0, 1)]
                )
                for layers, terminal in ties:
                    add(layers, own, np.full(len(own), n + terminal), first[own], axis)
    parts = []
    for layers, lists in found.items():
        tail, head, first, axis_of = (np.concatenate(part) for part in zip(*lists, strict=True))
        cost = costs_at(labelling.costs[layers], box, first, axis_of)
        known = np.flatnonzero(cost > 0)
        parts.append((tail[known], head[known], cost[known]))
    tail, head, cost = (np.concatenate(part) for part in zip(*parts, strict=True))
    inner = head < n
    joined = coo_array((np.ones(np.count_nonzero(inner), np.int8), (tail[inner], head[inner])), shape=(n, n))
    _, component = connected_components(joined, directed=False)
    rows, columns = np.divmod(at, width)
    rows, columns = rows + box.top, columns + box.left
    cut = BinaryCut(component, apart=(rows + columns) % 2 == 0, tail=tail, head=head, cost=cost)
    return Band(rows, columns, second, cut)


#: A pair of layers to be divided anew, as a task for this process or another one: the labelling, its (H, W)
#: label map, the (H, W) mask of pixels that may change or None for all, the pair, and the solver.
Division = tuple[Labelling, Labels, Mask | None, Pair, CutSolver]


def divided(division: Division) -> tuple[Pixels, Labels] | None:
    """Find the cheapest seam of two layers: rows and columns of the pixels that change, and the layers that
    show there from now on. None if no pixel is open.
    """
    labelling, label_map, near, pair, solver = division
    band = band_of(labelling, label_map, pair, near)
    if band is None:
        return None
    with one_thread():
        second = band.cut.solve(solver, band.second)
    gains = band.total(second) < band.total(band.second) * (1 - LEAST_GAIN)
    changed = np.flatnonzero(second != band.second) if gains else np.zeros(0, np.intp)
    pixels = band.rows[changed], band.columns[changed]
    return pixels, np.where(second[changed], np.int16(pair[1]), np.int16(pair[0]))


def costs_at(cost: PairCost, box: Box, first: Indices, axis: Indices) -> Floats:
    """Return the costs of interfaces that are given by the flat index of their left (axis 1) or upper (axis
    0) pixel in a box.
    """
    result = np.zeros(len(first))
    rows, columns = np.divmod(first, box.shape[1])
    for part in _by_tile(rows, columns, _COST_TILE):
        r, c, along = rows[part], columns[part], axis[part]
        top, left, bottom, right = int(r.min()), int(c.min()), int(r.max()) + 2, int(c.max()) + 2
        across, down = cost.on(Box(top, left, bottom, right).moved(box.top, box.left))
        for values, chosen in ((across, along == 1), (down, along == 0)):
            result[part[chosen]] = values[r[chosen] - top, c[chosen] - left]
    return result


def _by_tile(rows: Indices, columns: Indices, side: int) -> list[Indices]:
    """Group pixels by tiles; return their indices."""
    if not len(rows):
        return []
    key = rows // side * (int(columns.max()) // side + 1) + columns // side
    order = np.argsort(key, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(key[order])) + 1)


def write_pixels(
    label_map: npt.NDArray[Any], rows: Indices, columns: Indices, values: npt.NDArray[Any]
) -> None:
    """Write values at some pixels of a map, in place."""
    if isinstance(label_map, np.ndarray):
        label_map[rows, columns] = values
        return
    for part in _by_tile(rows, columns, TILE):
        r, c = rows[part], columns[part]
        tile = Box(int(r.min()), int(c.min()), int(r.max()) + 1, int(c.max()) + 1)
        labels = label_map[tile.slices]
        labels[r - tile.top, c - tile.left] = values[part]
        label_map[tile.slices] = labels
