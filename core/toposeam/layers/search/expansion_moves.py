"""Expansion moves of many layers on a list of the pixels that may still change.

On a canvas halved several times, or in a band beside the seams, some thousand pixels are open. They are
*nodes*, their interfaces *edges* of lists, and the cost of each edge for every two layers is looked up once.
A move (:mod:`toposeam.layers.labelling.problem` says which there are) is then some passes over these lists
and one minimum cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats, Indices, Labels, Mask
from toposeam.images import box_of
from toposeam.layers.canvas.layer import Box
from toposeam.layers.labelling.problem import Labelling
from toposeam.layers.search.edge_list import EdgeCosts, Edges
from toposeam.seam.exact.expansion import LEAST_GAIN, Decide, ExpansionMove


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
        label_map: Labels,
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
        #: Of a layer the edges of pixels that may show it, and rows and columns that hold these.
        self._nearby: dict[int, tuple[Edges, tuple[slice, slice]]] = {}

    def _narrowed(self, within: Mask) -> Choices:
        """The same, of which only some pixels, (h w,) bool, may change: what shows is the same array."""
        result = copy(self)
        result.may, result._nearby = self.may & within, {}
        result.edges = self.edges.some(np.flatnonzero(within[self.edges.p] | within[self.edges.q]))
        return result

    def total(self, edges: Edges | None = None) -> float:
        """Σ M over the edges, or some of them."""
        p, q, at = edges or self.edges
        return float(self._costs.paid(self.shows[p], self.shows[q], at).sum())

    def label_map(self) -> Labels:
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
        """Let a layer show more of itself (:mod:`toposeam.seam.exact.expansion`); whether that gained
        something.
        """
        move = self._expansion(k)
        turned, _ = move.gaining(move.turned(decide))
        self.shows[turned] = k
        return len(turned) > 0

    def would_expand(self, k: int, decide: Decide, dearer: float) -> Indices:
        """The pixels that would turn to a layer if the present interfaces cost more by a share."""
        return self._expansion(k).turned(decide, dearer=dearer)

    def _expansion(self, k: int) -> ExpansionMove:
        """The move in which a layer expands."""
        shows = self.shows
        near, window = self._beside(k)
        now = shows.reshape(self.box.shape)[window]
        free = self.may[k].reshape(self.box.shape)[window] & (now != k) & (now != len(self.layers))
        piece = np.zeros(len(shows), np.int32)
        piece.reshape(self.box.shape)[window], _ = scipy.ndimage.label(free)
        edges = near.some(np.flatnonzero(np.maximum(piece[near.p], piece[near.q])))
        return self._move(piece, edges, shows, np.where(piece > 0, np.int16(k), shows))

    def _beside(self, k: int) -> tuple[Edges, tuple[slice, slice]]:
        """The edges of pixels that may show a layer, and rows and columns that hold them."""
        if k not in self._nearby:
            may = self.may[k]
            found = self.edges.some(np.flatnonzero(may[self.edges.p] | may[self.edges.q]))
            window = box_of(may.reshape(self.box.shape)) if may.any() else (slice(0), slice(0))
            self._nearby[k] = found, window
        return self._nearby[k]

    def _move(
        self,
        piece: npt.NDArray[np.int32],
        edges: Edges,
        shows: npt.NDArray[np.int16],
        turned: npt.NDArray[np.int16],
    ) -> ExpansionMove:
        """The move from one solution towards another in some pieces, given the edges that end in them."""

        def paid(i: npt.NDArray[np.int16], j: npt.NDArray[np.int16], chosen: Any) -> Floats:
            return self._costs.paid(i, j, edges.column[chosen])

        return ExpansionMove(piece, self.box.shape[1], edges[:2], shows, turned, paid)

    def fuse(self, other: npt.NDArray[np.int16]) -> None:
        """Take what another solution, (h w,), shows wherever that costs less, in each patch in which they
        differ as a whole.
        """
        patch, count = scipy.ndimage.label((self.shows != other).reshape(self.box.shape))
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
    ) -> None:
        """Decide for some pixels which of two layers each shows, the two being the same for pixels that
        adjoin, if that gains something.
        """
        edges = self.edges.some(np.flatnonzero(free[self.edges.p] | free[self.edges.q]))
        if not len(edges.p):
            return
        shows, before = self.shows, self.total(edges)
        one, other = (np.where(free, layer, shows) for layer in (one, other))
        piece = scipy.ndimage.label(free.reshape(self.box.shape))[0].ravel()
        turned = self._move(piece, edges, one, other).turned(decide, now=shows == other)
        self.shows = one.copy()
        self.shows[turned] = other[turned]
        if self.total(edges) >= before * (1 - LEAST_GAIN):
            self.shows = shows
