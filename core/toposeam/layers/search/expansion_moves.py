"""Expansion moves of many layers on a list of the pixels that may change.

On a canvas that was halved several times, or in a band beside seams, some thousand pixels are open. They are
the *nodes*; their interfaces are *edges*, whose cost for each two layers is computed once. A move
(:mod:`toposeam.layers.labelling.problem`) is then a few passes over these lists and one minimum cut.
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
    """The labels of a box, and the pixels where several layers may show.

    Parameters
    ----------
    labelling : Labelling
    box : Box
        A part of the canvas; pixels around it are ignored.
    label_map : (h, w) int16 array
        The label map in the box, -1 where no layer shows.
    candidates : sequence of (h, w) bool arrays, per layer of `layers`
        True where each layer may show.
    layers : sequence of int
        The numbers of all layers that show or may show in the box.
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
        #: (h w,) position in `layers` of the layer that shows; `count` where none does.
        self.shows = number[label_map.ravel()]
        #: (count, h w) bool: where each layer may show, if several may.
        self.may = np.array([mask.ravel() for mask in candidates])
        #: (h w,) bool: the nodes, at which several layers may show.
        self.several = self.may.sum(axis=0, dtype=np.uint16) > 1
        self.may &= self.several
        known, open_ = label_map >= 0, self.several.reshape(box.shape)
        self.edges = Edges.beside(open_, known)
        may_show = [(self.may[k] | (self.shows == k)).reshape(box.shape) for k in range(count)]
        self._costs = EdgeCosts(labelling, box, self.layers, may_show, self.edges)
        #: Per layer, the edges of pixels that may show it, and the rows and columns of these pixels.
        self._nearby: dict[int, tuple[Edges, tuple[slice, slice]]] = {}

    def _narrowed(self, within: Mask) -> Choices:
        """Return the same choices with fewer open pixels, (h w,) bool; the array of labels is shared."""
        result = copy(self)
        result.may, result._nearby = self.may & within, {}
        result.edges = self.edges.some(np.flatnonzero(within[self.edges.p] | within[self.edges.q]))
        return result

    def total(self, edges: Edges | None = None) -> float:
        """Compute Σ M over the edges, or some of them."""
        p, q, at = edges or self.edges
        return float(self._costs.paid(self.shows[p], self.shows[q], at).sum())

    def label_map(self) -> Labels:
        """Return the (h, w) int16 label map."""
        number = np.array([*self.layers, -1], np.int16)
        return number[self.shows].reshape(self.box.shape)

    def lay(self, k: int, everywhere: Mask) -> None:
        """Let a layer show where it has pixels and no layer shows yet."""
        self.shows[everywhere & (self.shows == len(self.layers))] = k

    def run(
        self, decide: Decide, most: int, order: Sequence[int] | None = None, within: Mask | None = None
    ) -> int:
        """Repeat expansions in an order until none gains, for at most `most` rounds; return their number."""
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
        """Let a layer show at more pixels (:mod:`toposeam.seam.exact.expansion`); return whether that lowered
        the cost.
        """
        move = self._expansion(k)
        turned, _ = move.gaining(move.turned(decide))
        self.shows[turned] = k
        return len(turned) > 0

    def would_expand(self, k: int, decide: Decide, dearer: float) -> Indices:
        """Find the pixels that would change to a layer if the present interfaces cost more by a fraction."""
        return self._expansion(k).turned(decide, dearer=dearer)

    def _expansion(self, k: int) -> ExpansionMove:
        """Pose the move in which a layer expands."""
        shows = self.shows
        near, window = self._beside(k)
        now = shows.reshape(self.box.shape)[window]
        free = self.may[k].reshape(self.box.shape)[window] & (now != k) & (now != len(self.layers))
        piece = np.zeros(len(shows), np.int32)
        piece.reshape(self.box.shape)[window], _ = scipy.ndimage.label(free)
        edges = near.some(np.flatnonzero(np.maximum(piece[near.p], piece[near.q])))
        return self._move(piece, edges, shows, np.where(piece > 0, np.int16(k), shows))

    def _beside(self, k: int) -> tuple[Edges, tuple[slice, slice]]:
        """Return the edges of pixels that may show a layer, and the rows and columns of these pixels."""
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
        """Pose the move from one solution to another in connected pieces, by the edges that end in them."""

        def paid(i: npt.NDArray[np.int16], j: npt.NDArray[np.int16], chosen: Any) -> Floats:
            return self._costs.paid(i, j, edges.column[chosen])

        return ExpansionMove(piece, self.box.shape[1], edges[:2], shows, turned, paid)

    def fuse(self, other: npt.NDArray[np.int16]) -> None:
        """Take over another solution, (h w,), in each connected patch of differing pixels where it is
        cheaper.
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
        """Divide all pixels with exactly two candidates in one cut; return their (h w,) bool mask.

        Pixels beside others with another two candidates are left out. `candidates` is an (h, w) bool mask per
        layer, within those that may show.
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
        """Decide by one cut which of two layers each pixel shows, and keep the result if it costs less.

        Adjoining pixels must have the same two layers.
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
