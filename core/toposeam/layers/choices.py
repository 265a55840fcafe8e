"""Many layers on few pixels: moves on a list of those that may still change.

Where only some thousand pixels are open, on a canvas halved several times or round a place where three layers
meet, building a move as a picture takes longer than deciding it. Here the open pixels are *nodes* and their
interfaces *edges* of lists, and the cost of each edge for every two layers is looked up once. A move
(:mod:`toposeam.layers.labelling` says which there are) is then some passes over these lists. What a connected
piece of pixels does when it is asked for again, with the same beside it, is known: no piece is decided twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.heat.network import Floats
from toposeam.images import Mask, box_of
from toposeam.layers.crossing import Beyond, crossed
from toposeam.layers.deciding import Decide, decided, questions
from toposeam.layers.labelling import Labelling
from toposeam.layers.layer import Box
from toposeam.layers.painting import LabelMap
from toposeam.layers.pieces import pieces_of

#: A move counts when it lowers the cost of what it may change by this share.
_LEAST_GAIN = 1e-7
#: Least cost of an interface, so that no pixel is without connection.
_LEAST_LINK = 1e-6


class Choices:
    """The pixels of a box that may show several layers.

    Parameters
    ----------
    labelling : Labelling
    box : Box
        A part of the canvas; what lies around it is not looked at.
    label_map : (h, w) int16 array
        What shows in the box, -1 where nothing does.
    candidates : sequence of (h, w) bool arrays, per layer of `layers`
        Where each may show.
    layers : sequence of int
        All that show in the box.
    """

    def __init__(
        self,
        labelling: Labelling,
        box: Box,
        label_map: LabelMap,
        candidates: Sequence[Mask],
        layers: Sequence[int],
    ) -> None:
        self.box, self.layers = box, list(layers)
        count = len(layers)
        number = np.full(max(layers, default=0) + 2, count, np.int16)
        number[list(layers)] = np.arange(count)
        #: (h w,) position in `layers` of what shows, `count` where nothing does.
        self.shows = number[label_map.ravel()]
        #: (count, h w) bool.
        self.may = np.array([mask.ravel() for mask in candidates])
        #: (h w,) bool, which are nodes.
        self.several = self.may.sum(axis=0, dtype=np.uint16) > 1
        self.may &= self.several
        known, open_ = label_map >= 0, self.several.reshape(box.shape)
        first, second, which = [], [], []
        at = np.arange(len(self.shows)).reshape(box.shape)
        for axis, s, t in ((1, np.s_[:, :-1], np.s_[:, 1:]), (0, np.s_[:-1], np.s_[1:])):
            chosen = (open_[s] | open_[t]) & known[s] & known[t]
            first.append(at[s][chosen])
            second.append(at[t][chosen])
            which.append(np.full(len(first[-1]), axis, np.int8))
        #: (E,) the two pixels of each edge, by flat index.
        self.p, self.q = np.concatenate(first), np.concatenate(second)
        #: (h w,) label potential of the pixels that were last divided between two layers, else -1.
        self.soft = np.full(len(self.shows), -1, np.float32)
        #: (count + 1, count + 1) rows of `cost`; the first one is 0.
        self.row = np.zeros((count + 1, count + 1), np.intp)
        self.cost = self._costs(labelling, np.concatenate(which))
        #: (E,) which column of `cost` each edge has.
        self._column = np.arange(len(self.p))
        #: Whether paths decide what one seam crosses, which tell no potential.
        self.by_paths = False
        #: Pixels of one solution, of which several may be stacked.
        self._pixels = max(len(self.shows), 1)
        #: Rows and columns outside of which nothing changes.
        self._around = slice(0, box.shape[0]), slice(0, box.shape[1])
        #: What turned when a piece was asked for before, by all that decides it.
        self._known: dict[bytes, npt.NDArray[np.intp]] = {}

    def stacked(self, shows: Sequence[npt.NDArray[np.int16]]) -> Choices:
        """Several solutions of the same problem, (h w,) each, one below the other, as one."""
        (height, width), count, times = self.box.shape, len(self.layers), len(shows)
        pixels = (height + 1) * width  # a row without pixels keeps them apart
        result = copy(self)
        result.box = Box(0, 0, times * (height + 1), width)
        result._pixels = pixels
        result._around = slice(0, times * (height + 1)), slice(0, width)
        result.shows = np.concatenate([np.pad(part, (0, width), constant_values=count) for part in shows])
        result.may = np.tile(np.pad(self.may, ((0, 0), (0, width))), times)
        starts = np.arange(times)[:, None] * pixels
        result.p, result.q = (self.p + starts).ravel(), (self.q + starts).ravel()
        result._column = np.tile(self._column, times)
        return result

    def _narrowed(self, within: Mask) -> Choices:
        """The same, of which only some pixels, (h w,) bool, may change: what shows is the same array."""
        result = copy(self)
        result.may, result._known = self.may & within, {}
        edges = np.flatnonzero(within[self.p] | within[self.q])
        result.p, result.q, result._column = self.p[edges], self.q[edges], self._column[edges]
        result._around = box_of(within.reshape(self.box.shape)) if within.any() else self._around
        return result

    def parts(self, times: int) -> list[npt.NDArray[np.int16]]:
        """The solutions that are stacked."""
        each = len(self.shows) // times
        return [part[: each - self.box.shape[1]].copy() for part in np.split(self.shows, times)]

    def _costs(self, labelling: Labelling, axis: npt.NDArray[np.int8]) -> npt.NDArray[np.float32]:
        """(P + 1, E) costs for the pairs of layers that may adjoin."""
        rows, columns = np.divmod(self.p, self.box.shape[1])
        tables = [np.zeros(len(self.p), np.float32)]
        seen = [self.may[k] | (self.shows == k) for k in range(len(self.layers))]
        for i in range(len(self.layers)):
            for j in range(i + 1, len(self.layers)):
                low, high = sorted((self.layers[i], self.layers[j]))
                cost = labelling.costs.get((low, high))
                if cost is None:
                    continue
                common = cost.box.shared(self.box)
                if not all(common.shape):
                    continue
                wanted = (seen[i][self.p] & seen[j][self.q]) | (seen[j][self.p] & seen[i][self.q])
                top, left = common.top - self.box.top, common.left - self.box.left
                height, width = common.shape
                y, x = rows - top, columns - left
                wanted &= (y >= 0) & (x >= 0) & (y < height - (axis == 0)) & (x < width - (axis == 1))
                chosen = np.flatnonzero(wanted)
                if not len(chosen):
                    continue
                right, down = cost.on(common)
                values = np.zeros(len(self.p), np.float32)
                y, x, along = y[chosen], x[chosen], axis[chosen] == 1
                values[chosen[along]] = right[y[along], x[along]]
                values[chosen[~along]] = down[y[~along], x[~along]]
                self.row[i, j] = self.row[j, i] = len(tables)
                tables.append(values)
        return np.array(tables)

    def total(self, edges: npt.NDArray[np.intp] | None = None) -> float:
        """Σ M over the edges, or some of them."""
        p, q = (self.p, self.q) if edges is None else (self.p[edges], self.q[edges])
        at = self._column if edges is None else self._column[edges]
        return float(self.cost[self.row[self.shows[p], self.shows[q]], at].sum(dtype=np.float64))

    def _paid(self, i: Any, j: Any, column: npt.NDArray[np.intp]) -> Floats:
        """What edges cost whose ends show i and j."""
        place = self.row.take(i * np.intp(len(self.row)) + j)
        place *= self.cost.shape[1]
        place += column
        return np.asarray(self.cost.take(place), np.float64)

    def label_map(self) -> LabelMap:
        """(h, w) int16, what shows."""
        number = np.array([*self.layers, -1], np.int16)
        return number[self.shows].reshape(self.box.shape)

    def lay(self, k: int, everywhere: Mask) -> None:
        """Let a layer show where it has pixels and nothing does yet."""
        self.shows[everywhere & (self.shows == len(self.layers))] = k

    def run(
        self, decide: Decide, most: int, order: Sequence[int] | None = None, within: Mask | None = None
    ) -> int:
        """Expansions in an order until none gains, at most so many rounds; how many were made."""
        if within is not None:
            return self._narrowed(within).run(decide, most, order)
        order = range(len(self.layers)) if order is None else order
        waiting = set(order)
        for number in range(most):
            if not waiting:
                return number
            for k in order:
                if k in waiting:
                    waiting.discard(k)
                    if self.expand(k, decide):
                        waiting |= set(order) - {k}
        return most

    def expand(self, k: int, decide: Decide) -> bool:
        r"""Let a layer show more of itself; whether that gained something.

        At neighbours p and q that show i and j and may both turn to k, keeping both costs s = M_ij, turning p
        c = M_kj, turning q b = M_ik, and turning both nothing. With x = 1 for a turned pixel that is ::

            s + (c - b - s) / 2 x_p + (b - c - s) / 2 x_q + (b + c - s) / 2 |x_p - x_q|

        the unary costs of p and q and the cost of their interface, as a seam problem has them. That is
        submodular while s ≤ b + c. Where s > b + c, which no seam problem can say, b + c stands for s: the
        move is then chosen by too low a cost of what there is, and made only if it lowers the true one.

        *A worked example.* One row of four pixels, of which the first shows i, the second and third j, the
        fourth k; the second and third may turn to k. With M_ij = 5, M_ik = 1, M_jk = 3 at every interface::

            labels       i   j   j   k         turned        cost
            interfaces     5   0   3           none          5 + 0 + 3 = 8
                                               third         5 + 3 + 0 = 8
                                               both          1 + 0 + 0 = 1

        Interface 1 (i is fixed, q = j may turn): unary 5 for q staying, 1 for q turning. Interface 2 (both
        may turn, i = j): s = 0, b = c = 3, so 3 |x_p - x_q| and no unary. Interface 3 (k is fixed): unary 3
        for p staying. The least is 1: both turn.
        """
        shows, nothing = self.shows, len(self.layers)
        free = self.may[k] & (shows != k) & (shows != nothing)
        edges = np.flatnonzero(free[self.p] | free[self.q])
        if not len(edges):
            return False
        piece = np.zeros(len(shows), np.int32)
        window = free.reshape(self.box.shape)[self._around]
        piece.reshape(self.box.shape)[self._around], count = pieces_of(window)
        p, q = self.p[edges], self.q[edges]
        known = (shows[p] != nothing) & (shows[q] != nothing)
        edges, p, q = edges[known], p[known], q[known]
        of_edge = np.maximum(piece[p], piece[q])
        part = np.zeros(count + 1, np.intp)  # the first pixel of the solution in which a piece lies
        part[of_edge] = p - p % self._pixels
        number = np.intp(len(self.row))
        asked = questions(k, count, of_edge, self._column[edges] * number**2 + shows[p] * number + shows[q])
        first = {key: which for which, key in reversed(list(enumerate(asked, 1))) if key not in self._known}
        if first:
            new = np.zeros(count + 1, bool)
            new[list(first.values())] = True
            own = new[of_edge]
            turned = self._turned(k, np.where(new[piece], piece, 0), edges[own], decide)
            before, after = shows, shows.copy()
            after[turned] = k
            p, q, at, of_edge = p[own], q[own], self._column[edges[own]], of_edge[own]
            old, now = (
                np.bincount(of_edge, self._paid(state[p], state[q], at), count + 1)
                for state in (before, after)
            )
            gains = now < old * (1 - _LEAST_GAIN)
            of_node = piece[turned]
            for key, which in first.items():
                found = turned[of_node == which] if gains[which] else turned[:0]
                self._known[key] = found - part[which]
        changed = [self._known[key] + first for key, first in zip(asked, part[1:].tolist(), strict=True)]
        turning = np.concatenate([np.zeros(0, np.intp), *changed])
        shows[turning] = k
        return len(turning) > 0

    def _turned(
        self, k: int, piece: npt.NDArray[np.int32], edges: npt.NDArray[np.intp], decide: Decide
    ) -> npt.NDArray[np.intp]:
        """Which pixels of pieces turn to k, by the edges that end in them."""
        shows, free = self.shows, piece > 0
        p, q = self.p[edges], self.q[edges]
        i, j, at = shows[p], shows[q], self._column[edges]
        stay, q_turns, p_turns = self._paid(i, j, at), self._paid(i, k, at), self._paid(k, j, at)
        free_p, free_q = free[p], free[q]
        both, p_only, q_only = free_p & free_q, free_p & ~free_q, free_q & ~free_p
        least = np.minimum(stay, p_turns + q_turns)
        # What turning costs more than staying.
        on_p = np.where(both, (p_turns - q_turns - least) / 2, np.where(p_only, p_turns - stay, 0.0))
        on_q = np.where(both, (q_turns - p_turns - least) / 2, np.where(q_only, q_turns - stay, 0.0))
        link = (p_turns + q_turns - least) / 2
        nodes = np.flatnonzero(free)
        number = np.full(len(shows), -1, np.intp)
        number[nodes] = np.arange(len(nodes))
        unary: Floats = np.zeros(len(nodes))
        unary += np.bincount(number[p[free_p]], on_p[free_p], len(nodes))
        unary += np.bincount(number[q[free_q]], on_q[free_q], len(nodes))
        inner = np.flatnonzero(both)
        turns, _ = decided(
            piece[nodes],
            self._chessboard(nodes),
            number[p[inner]],
            number[q[inner]],
            np.maximum(link[inner], _LEAST_LINK),
            -unary,
            decide,
        )
        return nodes[turns]

    def _chessboard(self, nodes: npt.NDArray[np.intp]) -> Mask:
        """(n,) bool: pixels of which no two are neighbours."""
        return np.asarray(np.sum(np.divmod(nodes, self.box.shape[1]), axis=0) % 2 == 0)

    def fuse(self, other: npt.NDArray[np.int16]) -> None:
        """Take what another solution, (h w,), shows wherever that costs less, in each patch in which they
        differ as a whole (:mod:`toposeam.layers.fusion`).
        """
        patch, count = pieces_of((self.shows != other).reshape(self.box.shape))
        patch = patch.ravel()
        at = np.maximum(patch[self.p], patch[self.q])
        edges = np.flatnonzero(at)
        own, others = (
            np.bincount(
                at[edges], self.cost[self.row[shows[self.p[edges]], shows[self.q[edges]]], edges], count + 1
            )
            for shows in (self.shows, other)
        )
        self.shows = np.where((others < own)[patch], other, self.shows)

    def swap(self, i: int, j: int, decide: Decide) -> bool:
        """Divide anew what shows one of two layers and may show either; whether that gained something."""
        free = self.may[i] & self.may[j] & ((self.shows == i) | (self.shows == j))
        return self.divide(free, np.full(len(free), i, np.int16), np.full(len(free), j, np.int16), decide)

    def steep(self, step: float) -> npt.NDArray[np.intp]:
        """The pixels beside which the potential of the last division changes by more."""
        one, other = self.soft[self.p], self.soft[self.q]
        edges = np.flatnonzero((np.abs(one - other) > step) & (one >= 0) & (other >= 0))
        return np.unique(np.concatenate([self.p[edges], self.q[edges]]))

    def divide_all(
        self, decide: Decide, candidates: Sequence[Mask]
    ) -> tuple[Mask, npt.NDArray[np.int16], npt.NDArray[np.int16]]:
        """Divide anew all pixels for which two layers are candidates, as long as those beside them have no
        others, together; (h w,) bool, which, and the positions of the two layers there.

        `candidates` are (h, w) bool for each layer, and no more than those that may show.
        """
        may = np.array([mask.ravel() for mask in candidates])
        free = (may.sum(axis=0, dtype=np.uint16) == 2) & (self.shows != len(self.layers))
        own = may[:, free]
        one, other = np.full((2, len(free)), -1, np.int16)
        one[free], other[free] = own.argmax(axis=0), len(own) - 1 - own[::-1].argmax(axis=0)
        unlike = (one[self.p] != one[self.q]) | (other[self.p] != other[self.q])
        unlike &= free[self.p] & free[self.q]
        free[self.p[unlike]] = free[self.q[unlike]] = False
        self.divide(free, one, other, decide)
        return free, one, other

    def divide(
        self, free: Mask, one: npt.NDArray[np.int16], other: npt.NDArray[np.int16], decide: Decide
    ) -> bool:
        """Decide for some pixels which of two layers each shows, the two being the same for pixels that
        adjoin; whether that gained something.
        """
        shows = self.shows
        edges = np.flatnonzero(free[self.p] | free[self.q])
        if not len(edges):
            return False
        p, q = self.p[edges], self.q[edges]
        nodes = np.flatnonzero(free)
        number = np.full(len(shows), -1, np.intp)
        number[nodes] = np.arange(len(nodes))
        free_p, free_q = free[p], free[q]
        p_only, q_only = free_p & ~free_q, free_q & ~free_p
        at, out = np.concatenate([p[p_only], q[q_only]]), np.concatenate([q[p_only], p[q_only]])
        edge, beyond = np.concatenate([edges[p_only], edges[q_only]]), shows[out]
        costs = [self.cost[self.row[layer[at], beyond], edge].astype(np.float64) for layer in (one, other)]
        unary: Floats = np.bincount(number[at], costs[0] - costs[1], len(nodes)).astype(
            np.float64, copy=False
        )
        both = np.flatnonzero(free_p & free_q)
        link = self.cost[self.row[one[p[both]], other[q[both]]], edges[both]].astype(np.float64)
        link, piece = np.maximum(link, _LEAST_LINK), pieces_of(free.reshape(self.box.shape))[0]
        known = hot = np.zeros(len(free), bool)
        if self.by_paths:
            border = Beyond.of(at, out - at, beyond, (one[at], other[at]), costs)
            hot, known = crossed(piece, (p[both], q[both]), link, border, shows == other)
            unary[known[nodes]] = 0
        own, white = piece.ravel()[nodes], self._chessboard(nodes)
        ends, now = (number[p[both]], number[q[both]]), shows[nodes] == other[nodes]
        turned, soft = decided(own, white, *ends, link, unary, decide, now)
        turned = np.where(known[nodes], hot[nodes], turned)
        self.soft[nodes] = soft
        before, old = self.total(edges), shows[nodes]
        shows[nodes] = np.where(turned, other[nodes], one[nodes])
        if self.total(edges) < before * (1 - _LEAST_GAIN):
            return True
        shows[nodes] = old
        return False
