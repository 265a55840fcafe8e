"""Pieces of pixels that one seam crosses, divided along a shortest path between corners.

A band beside a seam has what shows one layer along one side, what shows the other along the opposite one, and
two *ends*, beyond which there is nothing or a third layer. The best division of such a piece is a shortest
path through the corners of its pixels from end to end (:mod:`toposeam.seam.exact`), found in a fifth of the
time that heat takes to gather. At an end it may arrive at any corner: what the pixels on either side of that
cost beside the third layer is the length of the last step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

from toposeam.heat.network import Floats
from toposeam.images import Mask

Indices = npt.NDArray[np.intp]
#: What lies beyond a border: what shows the first layer, the second one, or neither.
FIRST, SECOND, NEITHER = 0, 1, 2


class Beyond(NamedTuple):
    """Interfaces between pixels of pieces and others of which something is known, (B,) arrays."""

    #: By flat index, and by how much that of the pixel beyond differs.
    pixel: Indices
    step: Indices
    #: What lies beyond, and what it costs to show the first layer, and the second one.
    kind: npt.NDArray[np.int8]
    costs: Sequence[Floats]

    @classmethod
    def of(
        cls,
        pixel: Indices,
        step: Indices,
        beyond: npt.NDArray[np.int16],
        layers: tuple[npt.NDArray[np.int16], npt.NDArray[np.int16]],
        costs: Sequence[Floats],
    ) -> Beyond:
        """The border beyond which some layers show, between pixels that may show two `layers`."""
        kind = np.where(beyond == layers[0], FIRST, np.where(beyond == layers[1], SECOND, NEITHER))
        return cls(pixel, step, kind.astype(np.int8), costs)


def crossed(
    piece: npt.NDArray[np.int32], inner: tuple[Indices, Indices], link: Floats, border: Beyond, now: Mask
) -> tuple[Mask, Mask]:
    """Which pixels show the second layer, (h w,) bool, and for which, (h w,) bool, that is known: those of
    pieces that one seam crosses.

    Parameters
    ----------
    piece : (h, w) int32 array
        The number of each pixel's piece, 0 for none.
    inner : (E,) int arrays
        The two pixels of each interface within a piece, by flat index, the left or upper one first.
    link : (E,) float64 array
        What it costs to divide them.
    border : Beyond
    now : (h w,) bool array
        Which show the second layer where all is as good.
    """
    of = piece.ravel()
    outline = _Outline(piece, border)
    along, right = inner[0], inner[1] - inner[0] == 1
    corners = outline.numbered(of[along], *_corners(along, np.where(right, 1, 3), piece.shape[1]))
    gates, steps = outline.gates()
    fine = np.zeros(outline.count + 1, bool)
    fine[list(gates)] = True
    seam = np.zeros(len(link), bool)
    if gates:
        seam = _along_paths(corners, link, outline, fine, gates, steps) & fine[of[along]]
    joined = ~seam
    number = np.cumsum(of > 0) - 1
    ends = number[along[joined]], number[inner[1][joined]]
    n = int(number[-1]) + 1
    _, part = connected_components(
        coo_array((np.ones(len(ends[0]), np.int8), ends), shape=(n, n)), directed=False
    )
    pull = np.zeros(of.size)
    sums = np.bincount(part[number[border.pixel]], border.costs[0] - border.costs[1], n)
    pull[of > 0] = sums[part]
    return np.where(pull == 0, now, pull > 0), fine[of]


class _Outline:
    """The sides of pieces: where each part of them begins and ends, and what lies beyond."""

    def __init__(self, piece: npt.NDArray[np.int32], border: Beyond) -> None:
        self.count = int(piece.max())
        width, size = piece.shape[1], np.intp(piece.size)
        pixel, way = _sides(piece)
        ways = np.select([border.step == -1, border.step == 1, border.step == -width], [0, 1, 2], 3)
        place = np.searchsorted(way * size + pixel, ways * size + border.pixel)
        self.kind = np.full(len(pixel), NEITHER, np.int8)
        self.kind[place] = border.kind
        self.costs = np.zeros((2, len(pixel)))
        self.costs[:, place] = border.costs
        self.owner = piece.ravel()[pixel]
        # Where two pieces touch at a corner it is one for each.
        self._corners = np.intp((piece.shape[0] + 1) * (width + 1))
        ends = [self.owner * self._corners + end for end in _corners(pixel, way, width)]
        self._keys, places = np.unique(np.concatenate(ends), return_inverse=True)
        self.tail, self.head = np.split(places, 2)
        self.size = len(self._keys)
        self._join_stretches()

    def numbered(self, owner: npt.NDArray[np.int32], *ends: Indices) -> tuple[Indices, Indices]:
        """The numbers of the corners at both ends of interfaces inside; those off the outline come last."""
        every, owners = np.concatenate(ends), np.concatenate([owner, owner])
        outer = np.zeros(self._corners, bool)
        outer[self._keys % self._corners] = True
        on, off = np.flatnonzero(outer[every]), np.flatnonzero(~outer[every])
        at = np.empty(len(every), np.intp)
        at[on] = np.searchsorted(self._keys, owners[on] * self._corners + every[on])
        # No other piece is at a corner off the outline.
        whose = np.zeros(self._corners, np.int32)
        whose[every[off]] = owners[off]
        more = np.flatnonzero(whose > 0)
        number = np.empty(self._corners, np.intp)
        number[more[np.argsort(whose[more], kind="stable")]] = self.size + np.arange(len(more))
        at[off] = number[every[off]]
        self.size += len(more)
        one, other = np.split(at, 2)
        return one, other

    def _parts(self, chosen: Mask) -> Indices:
        """Of each corner the part of the outline in which it is, made of some sides."""
        n = len(self._keys)
        ones = np.ones(np.count_nonzero(chosen), np.int8)
        graph = coo_array((ones, (self.tail[chosen], self.head[chosen])), shape=(n, n))
        return np.asarray(connected_components(graph, directed=False)[1], np.intp)

    def _join_stretches(self) -> None:
        """Find the ends: stretches with neither layer beyond that lie between the two; what lies between two
        parts of one side belongs to that side.
        """
        n = len(self._keys)
        open_ = self.kind == NEITHER
        self.stretch = self._parts(open_)
        self.touched = np.zeros((2, n), bool)
        for layer in (FIRST, SECOND):
            for end in (self.tail, self.head):
                self.touched[layer, end[self.kind == layer]] = True
        touches = [np.bincount(self.stretch[touched], minlength=n) > 0 for touched in self.touched]
        #: By corner, whether a seam may arrive there.
        self.arrives = (touches[0] & touches[1])[self.stretch]
        for layer in (FIRST, SECOND):
            own = open_ & ~self.arrives[self.tail] & touches[layer][self.stretch[self.tail]]
            self.kind[own] = layer
            self.costs[1 - layer, own] = np.maximum(self.costs[1 - layer, own] - self.costs[layer, own], 0)
            self.costs[layer, own] = 0

    def gates(self) -> tuple[dict[int, list[int]], list[tuple[int, int, float]]]:
        """Of pieces that one seam crosses the two ends, numbered from 0 on; and the last steps to them: which
        end, from which corner, and how long.
        """
        fine = (
            np.bincount(
                self.owner[(self.kind == NEITHER) & ~self.arrives[self.tail]], minlength=self.count + 1
            )
            == 0
        )
        for layer in (FIRST, SECOND):
            own = np.flatnonzero(self.kind == layer)
            _, first = np.unique(self._parts(self.kind == layer)[self.tail[own]], return_index=True)
            fine &= np.bincount(self.owner[own[first]], minlength=self.count + 1) == 1
        onward: dict[int, list[tuple[int, float, float]]] = {}
        for side in np.flatnonzero((self.kind == NEITHER) & fine[self.owner]).tolist():
            here, there = int(self.tail[side]), int(self.head[side])
            costs = self.costs[:, side].tolist()
            onward.setdefault(here, []).append((there, *costs))
            onward.setdefault(there, []).append((here, *costs))
        gates: dict[int, list[int]] = {}
        steps: list[tuple[int, int, float]] = []
        arriving = np.flatnonzero(self.arrives)
        names, first = np.unique(self.stretch[arriving], return_index=True)
        owners = self._keys[arriving[first]] // self._corners
        for gate, (name, own) in enumerate(zip(names.tolist(), owners.tolist(), strict=True)):
            if not fine[own]:
                continue
            members = arriving[self.stretch[arriving] == name]
            begins = members[self.touched[SECOND, members]].tolist()
            walk = _walked(begins[0], onward)
            if len(begins) == 1 and len(walk) == len(members) and self.touched[FIRST, walk[-1][0]]:
                gates.setdefault(own, []).append(gate)
                steps += [(gate, corner, length) for corner, length in walk]
            else:
                fine[own] = False
        return {own: pair for own, pair in gates.items() if fine[own] and len(pair) == 2}, steps


def _walked(here: int, onward: dict[int, list[tuple[int, float, float]]]) -> list[tuple[int, float]]:
    """The corners of an end from the second layer's side on, and what arriving at each costs along the end;
    as far as there is one way.
    """
    before, found, first, second = -1, [here], [0.0], [0.0]
    while len(ways := [way for way in onward.get(here, ()) if way[0] != before]) == 1:
        before, (here, cost_first, cost_second) = here, ways[0]
        if here == found[0]:
            break
        found.append(here)
        first.append(first[-1] + cost_first)
        second.append(second[-1] + cost_second)
    total = first[-1]
    return [(corner, total - one + other) for corner, one, other in zip(found, first, second, strict=True)]


def _along_paths(
    corners: tuple[Indices, Indices],
    link: Floats,
    outline: _Outline,
    fine: Mask,
    gates: dict[int, list[int]],
    steps: list[tuple[int, int, float]],
) -> Mask:
    """(E,) bool, the interfaces inside along which the shortest paths between pairs of ends run."""
    sides = fine[outline.owner] & (outline.kind != NEITHER)
    gate, corner, last = (np.array(part) for part in zip(*steps, strict=True))
    n = outline.size + int(gate.max()) + 1
    tail = np.concatenate([corners[0], outline.tail[sides], outline.size + gate])
    head = np.concatenate([corners[1], outline.head[sides], corner])
    length = np.concatenate([link, outline.costs.sum(axis=0)[sides], last])
    graph = coo_array(
        (np.concatenate([length, length]), (np.concatenate([tail, head]), np.concatenate([head, tail]))),
        shape=(n, n),
    ).tocsr()
    begins = [outline.size + pair[0] for pair in gates.values()]
    _, before, _ = dijkstra(graph, indices=begins, return_predecessors=True, min_only=True)
    previous, path = before.tolist(), []
    for _, end in gates.values():
        here = outline.size + end
        while here >= 0:
            path.append(here)
            here = previous[here]
    on_path = np.zeros(n, bool)
    on_path[path] = True
    one, other = corners
    seam = on_path[one] & on_path[other]
    seam &= (before[one] == other) | (before[other] == one)
    return seam


def _corners(pixel: Indices, way: Indices, width: int) -> tuple[Indices, Indices]:
    """The two corners of one side of each pixel: left, right, above or below."""
    y, x = np.divmod(pixel, width)
    start = (y + (way == 3)) * (width + 1) + x + (way == 1)
    return start, start + np.where(way < 2, width + 1, 1)


def _sides(piece: npt.NDArray[np.int32]) -> tuple[Indices, Indices]:
    """The pixels of pieces beside something else, once for each such side, and which side that is."""
    wide = np.zeros((piece.shape[0] + 2, piece.shape[1] + 2), bool)
    wide[1:-1, 1:-1] = piece > 0
    beyond = wide[1:-1, :-2], wide[1:-1, 2:], wide[:-2, 1:-1], wide[2:, 1:-1]
    pixels = [np.flatnonzero(wide[1:-1, 1:-1] & ~there) for there in beyond]
    return np.concatenate(pixels), np.repeat(np.arange(4), [len(part) for part in pixels])
