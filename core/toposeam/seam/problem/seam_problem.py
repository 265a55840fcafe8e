"""A seam problem ready to be solved: the overlap, its match cost, and the same interfaces seen from pixels
and from corners.

One drawing of all numbering, for a window of h × w pixels. Pixel (y, x) has flat index y w + x; corner (y,
x), the upper left corner of that pixel, has flat index y (w + 1) + x. ``right[y, x]`` belongs to the
interface of pixels (y, x) and (y, x + 1), ``down[y, x]`` to that of (y, x) and (y + 1, x)::

    corner (y, x) ───────── corner (y, x+1) ───────── corner (y, x+2)
         │                        │                        │
         │     pixel (y, x)    right[y, x]  pixel (y, x+1) │
         │                        │                        │
         ├────── down[y, x] ──────┼───── down[y, x+1] ─────┤
         │                        │                        │
         │    pixel (y+1, x)      │    pixel (y+1, x+1)    │

So every interface joins two pixels, and two corners. Heat that flows between corners along interfaces is, by
planar duality, the jump of a potential between pixels across them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Indices, Mask
from toposeam.errors import OverlapError
from toposeam.heat.network import Network
from toposeam.optimize.history import Frame, Iteration, Termination
from toposeam.seam.problem.grid import CutGrid, grid_from_sides
from toposeam.seam.problem.overlap import FREE, KEPT_PIXELS, KEPT_SHAPES, NONE, A, B, Overlap, neighbours

#: The thesis's M_max: the cost of an interface where no seam may run, in units of the dearest ordinary one
#: (at least 1).
M_MAX = 1e6


def geometry(right: Mask, down: Mask) -> tuple[Indices, Indices, Indices, Indices]:
    """Find the pixels and the corners that the chosen interfaces join, first those of `right`.

    Parameters
    ----------
    right : (h, w - 1) bool array
    down : (h - 1, w) bool array

    Returns
    -------
    first, second : (E,) int arrays
        Flat index of the left or upper pixel, and of the right or lower one.
    start, end : (E,) int arrays
        Flat index of the upper or left corner, and of the lower or right one.
    """
    w = down.shape[1]
    row, column = np.nonzero(right)
    below, beside = np.nonzero(down)
    first = np.concatenate([row * w + column, below * w + beside])
    stride, along = np.ones(len(first), np.intp), np.full(len(first), w + 1, np.intp)
    stride[len(row) :], along[len(row) :] = w, 1
    start = np.concatenate([row * (w + 1) + column + 1, (below + 1) * (w + 1) + beside])
    return first, first + stride, start, start + along


def blocked() -> OverlapError:
    """Return the error of a seam that would have to cut forbidden interfaces."""
    return OverlapError(
        "no seam avoids the pixels you excluded: they block the overlap from side to side; leave it a way "
        "through",
        kind="blocked",
    )


@dataclass(frozen=True, slots=True, eq=False)
class Pattern:
    """The parts of a problem that depend only on the shape of its overlap; all arrays are read-only."""

    first: Indices  #: (E,) as of :func:`geometry`, for the interfaces a seam may use
    second: Indices
    start: Indices
    end: Indices
    place: Indices  #: (E,) indices of their costs in ``right`` followed by ``down``
    pixels: Indices  #: (n,) flat index of each free pixel
    #: Nodes are the free pixels, terminals the pixels fixed to ``a`` (cold) and ``b`` (hot), elements the
    #: interfaces.
    network: Network


def _pattern(side: npt.NDArray[np.uint8], right: Mask, down: Mask) -> Pattern:
    """Build the pattern of a window with given sides, and with the interfaces that have a cost."""
    free = side == FREE
    right, down = right & (free[:, 1:] | free[:, :-1]), down & (free[1:] | free[:-1])
    first, second, start, end = geometry(right, down)
    pixels = np.flatnonzero(free)
    n = len(pixels)
    node: Indices = np.where(side.ravel() == B, n + 1, n).astype(
        np.intp if side.size <= KEPT_PIXELS else np.int32
    )
    node[pixels] = np.arange(n)
    row, column = np.divmod(pixels, side.shape[1])
    network = Network(n, node[first], node[second], (row + column) % 2 == 0)
    return Pattern(
        first,
        second,
        start,
        end,
        np.flatnonzero(np.concatenate([right.ravel(), down.ravel()])),
        pixels,
        network,
    )


@lru_cache(maxsize=KEPT_SHAPES)
def _kept_pattern(shape: tuple[int, int], side: bytes, right: bytes, down: bytes) -> Pattern:
    h, w = shape
    return _pattern(
        np.frombuffer(side, np.uint8).reshape(h, w),
        np.frombuffer(right, bool).reshape(h, w - 1),
        np.frombuffer(down, bool).reshape(h - 1, w),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Interfaces:
    """The interfaces a seam may use, (E,) arrays each; at least one of the two pixels is free."""

    first: npt.NDArray[np.intp]  #: flat index of the left or upper pixel
    second: npt.NDArray[np.intp]  #: flat index of the right or lower pixel
    start: npt.NDArray[np.intp]  #: flat index of the upper or left corner
    end: npt.NDArray[np.intp]  #: flat index of the lower or right corner
    cost: npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SeamProblem:
    """An overlap with the match cost of its interfaces.

    Parameters
    ----------
    overlap : Overlap
    right : (h, w - 1) float32 array
    down : (h - 1, w) float32 array
        Match cost of each interface, 0 where the seam cannot run.
    forbidden : float
        Interfaces that cost as much or more are forbidden.
    showing_a, showing_b : (h, w) float32 arrays, optional
        Unary cost of each free pixel when it shows ``a`` (``b``): its interfaces with layers that are not
        part of the problem.

    Examples
    --------
    One row of four pixels, the outer two fixed; the seam may run left, in the middle or right of the two free
    ones, for 3, 1 or 2:

    >>> side = np.full((3, 6), NONE, np.uint8)
    >>> side[1, 1:5] = A, FREE, FREE, B
    >>> right, down = np.zeros((3, 5), np.float32), np.zeros((2, 6), np.float32)
    >>> right[1, 1:4] = 3, 1, 2
    >>> problem = SeamProblem(Overlap(side, side != NONE, (-1, -1), (1, 4)), right, down)
    >>> labels = np.zeros((3, 6), bool)
    >>> labels[1, 3] = True  # the second free pixel shows b
    >>> problem.cost(labels), problem.cost(~labels)  # the first one instead: all three are cut
    (1.0, 6.0)
    """

    overlap: Overlap
    right: Floats32
    down: Floats32
    forbidden: float = float("inf")
    showing_a: Floats32 | None = None
    showing_b: Floats32 | None = None

    @property
    def tied(self) -> bool:
        """True if there are unary costs: free pixels then lie beside layers outside of the problem, too."""
        return self.showing_a is not None

    @cached_property
    def grid(self) -> CutGrid:
        """The free pixels as a cut problem."""
        grid = grid_from_sides(self.overlap.side, self.right, self.down)
        if self.showing_a is None or self.showing_b is None:
            return grid
        return replace(grid, hot=grid.hot + self.showing_a, cold=grid.cold + self.showing_b)

    @cached_property
    def pattern(self) -> Pattern:
        """The parts that depend only on the shape of the overlap; small problems of one shape share them."""
        side, right, down = self.overlap.side, self.right > 0, self.down > 0
        if side.size > KEPT_PIXELS:
            return _pattern(side, right, down)
        return _kept_pattern((side.shape[0], side.shape[1]), side.tobytes(), right.tobytes(), down.tobytes())

    @property
    def _interface_cost(self) -> npt.NDArray[np.float64]:
        return np.concatenate([self.right.ravel(), self.down.ravel()])[self.pattern.place].astype(np.float64)

    @cached_property
    def _ties(self) -> tuple[Indices, npt.NDArray[np.float64], Indices]:
        """The unary costs as elements: node, cost, and the terminal to which it joins the node."""
        if self.showing_a is None or self.showing_b is None:
            return np.zeros(0, np.intp), np.zeros(0), np.zeros(0, np.intp)
        n = len(self.pattern.pixels)
        costs = [
            values.ravel()[self.pattern.pixels].astype(np.float64)
            for values in (self.showing_b, self.showing_a)
        ]
        nodes = [np.flatnonzero(cost > 0) for cost in costs]
        terminals = np.repeat([n, n + 1], [len(node) for node in nodes])
        return (
            np.concatenate(nodes),
            np.concatenate([cost[node] for cost, node in zip(costs, nodes, strict=True)]),
            terminals,
        )

    @cached_property
    def element_cost(self) -> npt.NDArray[np.float64]:
        """(E,) float64: the cost of each interface of the pattern, then of each tie to a terminal."""
        return np.concatenate([self._interface_cost, self._ties[1]])

    @property
    def network(self) -> Network:
        """The pattern's network, with unary costs added as elements to the terminals.

        Its solutions do not depend on what was solved before.
        """
        kept = self.pattern.network
        nodes, _, terminals = self._ties
        if len(nodes):
            return Network(
                kept.n, np.concatenate([kept.tail, nodes]), np.concatenate([kept.head, terminals]), kept.apart
            )
        return kept if kept.repeatable else replace(kept)

    @property
    def interfaces(self) -> Interfaces:
        """Every interface with a cost and at least one free pixel."""
        kept = self.pattern
        return Interfaces(kept.first, kept.second, kept.start, kept.end, self._interface_cost)

    def crossed(self, labels: Mask) -> Floats32:
        """Return the cost of every interface that an (h, w) bool labelling cuts."""
        full = self.complete(labels)
        return np.concatenate([self.right[full[:, 1:] != full[:, :-1]], self.down[full[1:] != full[:-1]]])

    def crossings(self, labels: Mask) -> tuple[Floats32, Indices, Indices]:
        """Find the interfaces that an (h, w) bool labelling cuts: their costs, and the (x, y) on the canvas
        of the left or upper one of their two pixels.
        """
        full = self.complete(labels)
        found = []
        for costs, cut in ((self.right, full[:, 1:] != full[:, :-1]), (self.down, full[1:] != full[:-1])):
            y, x = np.nonzero(cut & (costs > 0))
            found.append((costs[y, x], x + self.overlap.start[1], y + self.overlap.start[0]))
        cost, x, y = (np.concatenate(part) for part in zip(*found, strict=True))
        return cost, x, y

    def cost(self, labels: Mask) -> float:
        """Compute Σ M over the interfaces that an (h, w) bool labelling cuts."""
        return float(self.crossed(labels).sum(dtype=np.float64))

    def total(self, labels: Mask) -> float:
        """Compute :meth:`cost` plus the unary costs of the free pixels."""
        if self.showing_a is None or self.showing_b is None:
            return self.cost(labels)
        beside = np.where(labels, self.showing_b, self.showing_a)[self.overlap.side == FREE]
        return self.cost(labels) + float(beside.sum(dtype=np.float64))

    def check(self, labels: Mask) -> None:
        """Refuse a labelling that cuts a forbidden interface.

        Raises
        ------
        OverlapError
        """
        if self.crossed(labels).max(initial=0.0) >= self.forbidden:
            raise blocked()

    def on_canvas(self, labels: npt.NDArray[Any], only_b: Mask) -> npt.NDArray[Any]:
        """Spread window values to the canvas: `labels` in the overlap, elsewhere 1 where only ``b`` shows.

        Parameters
        ----------
        labels : (h, w) array
        only_b : (H, W) bool array
        """
        result = only_b.astype(labels.dtype)
        on_canvas, on_window = self.overlap.inside
        shared = self.overlap.shared[on_window]
        result[on_canvas][shared] = self.complete(labels)[on_window][shared]
        return result

    def complete(self, labels: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Set every pixel that is not free to its side (`NONE` counts as ``a``)."""
        side = self.overlap.side
        return np.where(side == FREE, labels, (side == B).astype(labels.dtype))

    @property
    def seam_ground(self) -> Mask:
        """(h, w) bool mask of the pixels between which a seam is drawn.

        These are the overlap, and the ground beside places where it is one pixel wide.
        """
        side, shared = self.overlap.side, self.overlap.shared
        narrow = (side == FREE) & neighbours((side == A) & ~shared) & neighbours((side == B) & ~shared)
        ground: Mask = shared | (neighbours(narrow) & (side != NONE))
        return ground


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """The labels that a seam method found on the overlap's window, and how it found them."""

    #: (h, w) bool, True where ``b`` shows.
    labels: Mask
    #: (h, w) float32 in [0, 1], the label potential before the seam was decided.
    soft: npt.NDArray[np.float32]
    #: Whether only a part of the overlap was heated, so that `soft` is not the potential of the whole.
    contracted: bool = False
    #: The engine that ran; empty where it is the method that was asked for.
    method: str = ""
    history: tuple[Iteration, ...] = ()
    frames: tuple[Frame, ...] = ()
    termination: Termination = Termination.DIRECT
    #: A lower bound on the cost of every labelling; 0 where nothing is proven.
    bound: float = 0.0
