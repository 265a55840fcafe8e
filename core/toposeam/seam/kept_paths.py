"""Best seams of many small overlaps of few shapes, as textures lay them.

Where one path between corners divides each piece of what is free (:mod:`toposeam.seam.exact`), most of the
work on a small overlap is laying out its graph. That depends on the shape alone and is kept; what is left is
one search for all pieces together, whose corners count as different ones. The labels follow from the path by
parity: along a tree from what is decided to every free pixel, kept as well, the label changes where the path
is crossed.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from toposeam.images import Mask
from toposeam.seam.exact import border_of, pieces
from toposeam.seam.overlap import FREE, KEPT_PIXELS, KEPT_SHAPES, NONE, Overlap
from toposeam.seam.problem import Indices, Pattern, SeamProblem, geometry


@dataclass(frozen=True, slots=True, eq=False)
class _Paths:
    """What overlaps of one shape have in common. No array of it may be written to."""

    pattern: Pattern
    #: The corners as a graph without costs, and the element of the pattern that each entry stands for.
    graph: csr_array
    element: Indices
    #: Where the path of each piece begins and ends.
    sources: Indices
    targets: Indices
    #: The elements that paths may take, and the corners that each joins.
    elements: Indices
    corners: tuple[Indices, Indices]
    #: The tree from decided pixels to free ones, level by level: nodes, their parents, the elements between.
    levels: tuple[tuple[Indices, Indices, Indices], ...]


def cut_by_paths(problem: SeamProblem) -> Mask | None:
    """The labelling of least cost of a small overlap; None where its pieces are not divided by one path each,
    or it is not small.

    Parameters
    ----------
    problem : SeamProblem
        Without ties.

    Returns
    -------
    (h, w) bool array
        What is not free is labelled by its side.
    """
    side = problem.overlap.side
    if side.size > KEPT_PIXELS or problem.tied:
        return None
    right, down = problem.right > 0, problem.down > 0
    kept = _kept_paths((side.shape[0], side.shape[1]), side.tobytes(), right.tobytes(), down.tobytes())
    if kept is None:
        return None
    pattern = kept.pattern
    cost = np.concatenate([problem.right.ravel(), problem.down.ravel()]).take(pattern.place).astype(float)
    hot, most = np.zeros(pattern.network.n + 2, bool), 0.0
    hot[-1] = True
    crossed = np.zeros(len(cost), bool)
    if len(kept.sources):
        graph = copy.copy(kept.graph)
        graph.data = cost.take(kept.element)
        length, before, _ = dijkstra(graph, indices=kept.sources, return_predecessors=True, min_only=True)
        place = _places(before, kept)
        if place is None:
            return None
        one, other = kept.corners
        taken = np.abs(place.take(one) - place.take(other)) == 1
        some = np.flatnonzero(taken)
        # Of parallel elements the path takes the cheaper one.
        apart = np.abs(length.take(one.take(some)) - length.take(other.take(some)))
        some = some[cost.take(kept.elements.take(some)) <= apart * (1 + 1e-9)]
        crossed[kept.elements.take(some)] = True
        most = float(length.take(kept.targets).sum())
    for nodes, parents, between in kept.levels:
        hot[nodes] = hot.take(parents) ^ crossed.take(between)
    network = pattern.network
    # A product of vectors would wake threads that wait for one another, at several times the cost.
    if float(cost[hot.take(network.tail) != hot.take(network.head)].sum()) > most * (1 + 1e-6):
        return None
    labels = problem.complete(np.zeros(side.shape, bool)).astype(bool, copy=False)
    labels.ravel()[pattern.pixels] = hot[:-2]
    return labels


def _places(before: npt.NDArray[np.int32], kept: _Paths) -> Indices | None:
    """(n,) the number of each corner along the path of its piece, far below 0 off the path: only what follows
    one another is one apart. None where an end cannot be reached.
    """
    place, steps, first = np.arange(-(10**9), 2 * len(before) - 10**9, 2), before.data, 0
    for source, target in zip(kept.sources.tolist(), kept.targets.tolist(), strict=True):
        path = [target]
        while path[-1] != source:
            path.append(steps[path[-1]])
            if path[-1] < 0:
                return None
        place[path] = np.arange(first, first + len(path))
        first += len(path) + 1
    return place


@lru_cache(maxsize=KEPT_SHAPES)
def _kept_paths(shape: tuple[int, int], sides: bytes, right: bytes, down: bytes) -> _Paths | None:
    h, w = shape
    side = np.frombuffer(sides, np.uint8).reshape(h, w)
    # Of costs only matters where there are any.
    problem = SeamProblem(
        Overlap(side, side != NONE, (0, 0), (h, w)),
        np.frombuffer(right, bool).reshape(h, w - 1).astype(np.float32),
        np.frombuffer(down, bool).reshape(h - 1, w).astype(np.float32),
    )
    pattern = problem.pattern
    corners = (side.shape[0] + 1) * (side.shape[1] + 1)
    tails: list[Any] = []
    heads: list[Any] = []
    chosen: list[Any] = []
    ends: list[tuple[int, int]] = []
    whole = slice(0, side.shape[0]), slice(0, side.shape[1])
    for number, (box, pixels, _) in enumerate(pieces(side == FREE)):
        free = np.zeros(side.shape, bool)
        free[box] = pixels
        border = border_of(problem, whole, free)
        if not (border.to_a and border.to_b):
            continue
        found = border.ends()
        if found is None:
            return None
        along, onward = geometry(*border.gaps)[2:]
        joined = coo_array((np.ones(len(along), np.int8), (along, onward)), shape=(corners, corners))
        _, group = connected_components(joined, directed=False)
        elements = np.flatnonzero(free.ravel()[pattern.first] | free.ravel()[pattern.second])
        chosen.append(elements)
        tails.append(group[pattern.start[elements]] + number * corners)
        heads.append(group[pattern.end[elements]] + number * corners)
        first, last = (int(group[end]) + number * corners for end in found)
        ends.append((first, last))
    levels = _tree(pattern)
    if not ends:
        none = np.zeros(0, np.intp)
        return _Paths(pattern, csr_array((0, 0)), none, none, none, none, (none, none), levels)
    element, tail, head = (np.concatenate(part).astype(np.intp) for part in (chosen, tails, heads))
    used, place = np.unique(np.concatenate([tail, head]), return_inverse=True)
    sources, targets = np.searchsorted(used, np.array(ends)).T
    if not np.isin(ends, used).all():
        return None
    one, other = np.split(place, 2)
    rows, columns = np.concatenate([one, other]), np.concatenate([other, one])
    order = np.argsort(rows, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=len(used)))])
    graph = csr_array(
        (np.ones(len(order)), columns[order].astype(np.int32), starts.astype(np.int32)),
        shape=(len(used), len(used)),
    )
    both = np.concatenate([element, element])[order]
    return _Paths(pattern, graph, both, sources, targets, element, (one, other), levels)


def _tree(pattern: Pattern) -> tuple[tuple[Indices, Indices, Indices], ...]:
    """The way from the terminals to every free pixel that is connected to one."""
    network = pattern.network
    tail, head = network.tail.astype(np.intp, copy=False), network.head.astype(np.intp, copy=False)
    known = np.zeros(network.n + 2, bool)
    known[network.n :] = True
    levels: list[tuple[Indices, Indices, Indices]] = []
    while True:
        between = np.flatnonzero(known[tail] != known[head])
        if not len(between):
            return tuple(levels)
        nodes = np.where(known[tail[between]], head[between], tail[between])
        nodes, first = np.unique(nodes, return_index=True)
        between = between[first]
        levels.append((nodes, tail[between] + head[between] - nodes, between))
        known[nodes] = True
