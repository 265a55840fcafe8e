"""Expansion moves of many layers on a list of the pixels that may still change.

On a canvas halved several times, or in a band beside the seams, some thousand pixels are open. They are
*nodes*, their interfaces *edges* of lists, and the cost of each edge for every two layers is looked up once.
A move (:mod:`toposeam.layers.labelling.problem` says which there are) is then some passes over these lists
and one minimum cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np
import numpy.typing as npt

from toposeam.heat.network import Floats
from toposeam.images import Mask, box_of
from toposeam.layers.canvas.connected_components import pieces_of
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.painting import LabelMap
from toposeam.layers.labelling.problem import Labelling
from toposeam.layers.search.cut_solver import Decide, decided
from toposeam.layers.search.edge_list import EdgeCosts, Edges

Indices = npt.NDArray[np.intp]

#: A move counts when it lowers the cost of what it may change by this share.
LEAST_GAIN = 1e-7
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
        self.edges = Edges.beside(open_, known)
        seen = [(self.may[k] | (self.shows == k)).reshape(box.shape) for k in range(count)]
        self._costs = EdgeCosts(labelling, box, self.layers, seen, self.edges)
        #: (h w,) bool: pixels of which no two are neighbours.
        self._white = _chessboard(box.shape)
        #: Pixels of one solution, of which several may be stacked.
        self._pixels = max(len(self.shows), 1)
        #: Of a layer the edges of pixels that may show it, and rows and columns that hold these.
        self._nearby: dict[int, tuple[Edges, tuple[slice, slice]]] = {}

    def stacked(self, shows: Sequence[npt.NDArray[np.int16]]) -> Choices:
        """Several solutions of the same problem, (h w,) each, one below the other, as one."""
        (height, width), times, count = self.box.shape, len(shows), len(self.layers)
        result, pixels = copy(self), (height + 1) * width  # a row without pixels keeps them apart
        result.box, result._pixels, result._nearby = Box(0, 0, times * (height + 1), width), pixels, {}
        result._white = _chessboard(result.box.shape)
        stack = np.full((times, pixels), count, np.int16)
        stack[:, :-width] = shows
        result.shows = stack.ravel()
        result.may = np.tile(np.concatenate([self.may, np.zeros((count, width), bool)], axis=1), times)
        starts = np.arange(times)[:, None] * pixels
        p, q, column = self.edges
        result.edges = Edges((p + starts).ravel(), (q + starts).ravel(), np.tile(column, times))
        return result

    def _narrowed(self, within: Mask) -> Choices:
        """The same, of which only some pixels, (h w,) bool, may change: what shows is the same array."""
        result = copy(self)
        result.may, result._nearby = self.may & within, {}
        result.edges = self.edges.some(np.flatnonzero(within[self.edges.p] | within[self.edges.q]))
        return result

    def parts(self, times: int) -> list[npt.NDArray[np.int16]]:
        """The solutions that are stacked."""
        each = len(self.shows) // times
        return [part[: each - self.box.shape[1]].copy() for part in np.split(self.shows, times)]

    def total(self, edges: npt.NDArray[np.intp] | None = None) -> float:
        """Σ M over the edges, or some of them."""
        p, q, at = self.edges if edges is None else self.edges.some(edges)
        return float(self._costs.paid(self.shows[p], self.shows[q], at).sum())

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
        piece, turned, gains = self._turned(k, decide)
        turned = turned[gains[piece[turned]]]
        self.shows[turned] = k
        return len(turned) > 0

    def would_expand(self, k: int, decide: Decide, dearer: float) -> Indices:
        """The pixels that would turn to a layer if the present interfaces cost more by a share."""
        return self._turned(k, decide, dearer)[1]

    def _open_to(self, k: int) -> tuple[npt.NDArray[np.int32], int, Edges, npt.NDArray[np.int32]]:
        """The pieces of what may turn to a layer, numbered from 1 on, (h w,), and how many; the edges that
        end in them, and in which.
        """
        shows, nothing = self.shows, len(self.layers)
        near, window = self._beside(k)
        now = shows.reshape(self.box.shape)[window]
        free = self.may[k].reshape(self.box.shape)[window] & (now != k) & (now != nothing)
        piece = np.zeros(len(shows), np.int32)
        piece.reshape(self.box.shape)[window], count = pieces_of(free)
        of_edge = np.maximum(piece[near.p], piece[near.q])
        own = np.flatnonzero(of_edge > 0)
        edges, of_edge = near.some(own), of_edge[own]
        if len(edges.p) and max(shows[edges.p].max(), shows[edges.q].max()) == nothing:
            own = np.flatnonzero((shows[edges.p] != nothing) & (shows[edges.q] != nothing))
            edges, of_edge = edges.some(own), of_edge[own]
        return piece, count, edges, of_edge

    def _beside(self, k: int) -> tuple[Edges, tuple[slice, slice]]:
        """The edges of pixels that may show a layer, and rows and columns that hold them."""
        if k not in self._nearby:
            may = self.may[k]
            found = self.edges.some(np.flatnonzero(may[self.edges.p] | may[self.edges.q]))
            window = box_of(may.reshape(self.box.shape)) if may.any() else (slice(0), slice(0))
            self._nearby[k] = found, window
        return self._nearby[k]

    def _turned(
        self, k: int, decide: Decide, dearer: float = 0.0
    ) -> tuple[npt.NDArray[np.int32], Indices, Mask]:
        """The piece of each pixel that may turn to a layer, (h w,), 0 for none; the pixels that turn if the
        present interfaces cost more by a share; and of each piece whether that lowers its true cost.
        """
        piece, count, edges, of_edge = self._open_to(k)
        if not count:
            return piece, np.zeros(0, np.intp), np.zeros(1, bool)
        p, q, at = edges
        i, j, free_p, free_q = self.shows[p], self.shows[q], piece[p] > 0, piece[q] > 0
        q_turns = self._costs.paid(i, k, at)
        # Most edges lie inside of what shows one layer: they cost nothing, and as much whichever end turns.
        unlike = np.flatnonzero(i != j)
        stay, p_turns = np.zeros(len(p)), q_turns.copy()
        stay[unlike] = self._costs.paid(i[unlike], j[unlike], at[unlike])
        p_turns[unlike] = self._costs.paid(k, j[unlike], at[unlike])
        nodes = np.flatnonzero(piece)
        number = np.empty(len(piece), np.intp)
        number[nodes] = np.arange(len(nodes))
        both = free_p & free_q
        pulled = np.flatnonzero(~both | (i != j))
        c, b, s = p_turns[pulled], q_turns[pulled], stay[pulled] * (1 + dearer)
        inside, on_p, on_q = both[pulled], free_p[pulled], free_q[pulled]
        least = np.minimum(s, c + b)
        # What turning costs more than staying.
        more_p = np.where(inside, (c - b - least) / 2, c - s)[on_p]
        more_q = np.where(inside, (b - c - least) / 2, b - s)[on_q]
        unary: Floats = np.zeros(len(nodes))
        unary += np.bincount(number[p[pulled[on_p]]], more_p, len(nodes))
        unary += np.bincount(number[q[pulled[on_q]]], more_q, len(nodes))
        link = q_turns.copy()
        link[pulled] = (c + b - least) / 2
        inner = np.flatnonzero(both)
        ends = number[p[inner]], number[q[inner]]
        link = np.maximum(link[inner], _LEAST_LINK)
        turned = nodes[decided(piece[nodes], self._white[nodes], *ends, link, -unary, decide)]
        turning = np.zeros(len(piece), bool)
        turning[turned] = True
        one, other = turning[p], turning[q]
        now = np.select([one & other, one, other], [0.0, p_turns, q_turns], stay)
        before, after = (np.bincount(of_edge, values, count + 1) for values in (stay, now))
        return piece, turned, after < before * (1 - LEAST_GAIN)

    def fuse(self, other: npt.NDArray[np.int16]) -> None:
        """Take what another solution, (h w,), shows wherever that costs less, in each patch in which they
        differ as a whole.
        """
        patch, count = pieces_of((self.shows != other).reshape(self.box.shape))
        patch = patch.ravel()
        at = np.maximum(patch[self.edges.p], patch[self.edges.q])
        own = np.flatnonzero(at > 0)
        edges, at = self.edges.some(own), at[own]
        own, others = (
            np.bincount(at, self._costs.paid(shows[edges.p], shows[edges.q], edges.column), count + 1)
            for shows in (self.shows, other)
        )
        if (others < own).any():
            self.shows = np.where((others < own)[patch], other, self.shows)

    def divide_all(self, decide: Decide, candidates: Sequence[Mask]) -> Mask:
        """Divide anew all pixels for which two layers are candidates, as long as those beside them have no
        others, together; (h w,) bool, which.

        `candidates` are (h, w) bool for each layer, and no more than those that may show.
        """
        may = np.array([mask.ravel() for mask in candidates])
        free: Mask = (may.sum(axis=0, dtype=np.uint16) == 2) & (self.shows != len(self.layers))
        own = may[:, free]
        one, other = np.full((2, len(free)), -1, np.int16)
        one[free], other[free] = own.argmax(axis=0), len(own) - 1 - own[::-1].argmax(axis=0)
        p, q, _ = self.edges
        unlike = (one[p] != one[q]) | (other[p] != other[q])
        unlike &= free[p] & free[q]
        free[p[unlike]] = free[q[unlike]] = False
        self.divide(free, one, other, decide)
        return free

    def divide(
        self, free: Mask, one: npt.NDArray[np.int16], other: npt.NDArray[np.int16], decide: Decide
    ) -> bool:
        """Decide for some pixels which of two layers each shows, the two being the same for pixels that
        adjoin; whether that gained something.
        """
        shows = self.shows
        edges = np.flatnonzero(free[self.edges.p] | free[self.edges.q])
        if not len(edges):
            return False
        p, q, _ = self.edges.some(edges)
        nodes = np.flatnonzero(free)
        number = np.full(len(shows), -1, np.intp)
        number[nodes] = np.arange(len(nodes))
        free_p, free_q = free[p], free[q]
        p_only, q_only = free_p & ~free_q, free_q & ~free_p
        at, out = np.concatenate([p[p_only], q[q_only]]), np.concatenate([q[p_only], p[q_only]])
        edge, beyond = np.concatenate([edges[p_only], edges[q_only]]), shows[out]
        costs = [self._costs.paid(layer[at], beyond, edge) for layer in (one, other)]
        unary: Floats = np.bincount(number[at], costs[0] - costs[1], len(nodes)).astype(
            np.float64, copy=False
        )
        both = np.flatnonzero(free_p & free_q)
        link = self._costs.paid(one[p[both]], other[q[both]], edges[both])
        link, piece = np.maximum(link, _LEAST_LINK), pieces_of(free.reshape(self.box.shape))[0]
        own, white = piece.ravel()[nodes], self._white[nodes]
        ends, now = (number[p[both]], number[q[both]]), shows[nodes] == other[nodes]
        turned = decided(own, white, *ends, link, unary, decide, now)
        before, old = self.total(edges), shows[nodes]
        shows[nodes] = np.where(turned, other[nodes], one[nodes])
        if self.total(edges) < before * (1 - LEAST_GAIN):
            return True
        shows[nodes] = old
        return False


def _chessboard(shape: tuple[int, int]) -> Mask:
    """(h w,) bool: every other pixel."""
    white = np.zeros(shape, bool)
    white[::2, ::2] = white[1::2, 1::2] = True
    return white.ravel()
