"""The seam problem on the pixel grid: costs between undecided pixels, and towards the two decided sides.

A labelling of the free pixels (False: ``a`` shows, True: ``b``) costs the sum over interfaces whose two pixels differ. The seam is the set of
those interfaces. Half as many pixels each way give a coarser problem of the same kind: blocks of 2 × 2 pixels, interface costs added up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.heat.network import Floats, Ints, Network
from toposeam.images import Mask
from toposeam.seam.overlap import FREE, A, B

Floats32 = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class CutGrid:
    """Costs of dividing the free pixels of an (h, w) window.

    Parameters
    ----------
    right : (h, w - 1) float32 array
        Cost between each free pixel and its free right neighbour; 0 where either is not free.
    down : (h - 1, w) float32 array
        Likewise for the lower neighbour.
    cold, hot : (h, w) float32 arrays
        Cost between a free pixel and its neighbours fixed to ``a`` (cold) and to ``b`` (hot).
    free : (h, w) bool array
    """

    right: Floats32
    down: Floats32
    cold: Floats32
    hot: Floats32
    free: Mask

    def cost(self, labels: Mask) -> float:
        """Cost of an (h, w) bool labelling; values outside `free` do not matter."""
        across = self.right[labels[:, 1:] != labels[:, :-1]].sum(dtype=np.float64)
        along = self.down[labels[1:] != labels[:-1]].sum(dtype=np.float64)
        ends = self.cold[labels].sum(dtype=np.float64) + self.hot[~labels].sum(dtype=np.float64)
        return float(across + along + ends)

    def network(self, active: Mask, labels: Mask) -> tuple[Network, Floats, Ints]:
        """The problem restricted to some free pixels, the others keeping their labels.

        Parameters
        ----------
        active : (h, w) bool array
            Pixels to decide; a subset of `free`.
        labels : (h, w) bool array
            Labels of the free pixels that are not active.

        Returns
        -------
        network : Network
            One node per active pixel, in raster order; the terminals are the labels False and True.
        weight : (E,) float64 array
            Cost per element.
        pixels : (n,) int array
            Flat index of each node's pixel.
        """
        width = active.shape[1]
        pixels = np.flatnonzero(active)
        n = len(pixels)
        number = np.empty(active.size, np.int32)
        number[pixels] = np.arange(n, dtype=np.int32)
        tails, heads, weights = [], [], []
        rest = self.free.ravel() & ~active.ravel()
        flat_labels = labels.ravel()
        row, column = np.divmod(pixels, width)
        for cost, step, stride in ((self.right, (row, column), 1), (self.down, (row, column), width)):
            height_c, width_c = cost.shape
            # Towards the right (below), then towards the left (above).
            ahead = np.flatnonzero((step[1] < width_c) & (step[0] < height_c))
            values = cost[row[ahead], column[ahead]]
            ahead, values = ahead[values > 0], values[values > 0]
            target = pixels[ahead] + stride
            inner = active.ravel()[target]
            tails.append(ahead[inner])
            heads.append(number[target[inner]])
            weights.append(values[inner])
            self._towards(rest, flat_labels, ahead[~inner], target[~inner], values[~inner], n, tails, heads, weights)
            behind = np.flatnonzero((column if stride == 1 else row) > 0)
            source = pixels[behind] - stride
            outer = rest[source]
            behind, source = behind[outer], source[outer]
            values = cost.ravel()[_before(row[behind], column[behind], stride, width_c)]
            self._towards(rest, flat_labels, behind[values > 0], source[values > 0], values[values > 0], n, tails, heads, weights)
        for terminal, ends in ((n, self.cold), (n + 1, self.hot)):
            values = ends.ravel()[pixels]
            touching = np.flatnonzero(values)
            tails.append(touching)
            heads.append(np.full(len(touching), terminal))
            weights.append(values[touching])
        network = Network(n, np.concatenate(tails).astype(np.int32), np.concatenate(heads).astype(np.int32))
        return network, np.concatenate(weights).astype(np.float64), pixels.astype(np.int32)

    @staticmethod
    def _towards(
        rest: Mask, labels: Mask, nodes: npt.NDArray[np.intp], targets: npt.NDArray[np.intp], values: Floats32, n: int,
        tails: list[npt.NDArray[np.intp]], heads: list[npt.NDArray[np.intp]], weights: list[Floats32],
    ) -> None:  # fmt: skip
        decided = rest[targets]
        tails.append(nodes[decided])
        heads.append(n + labels[targets[decided]].astype(np.intp))
        weights.append(values[decided])

    def coarsen(self) -> CutGrid:
        """The problem on blocks of 2 × 2 pixels (the last row and column of blocks may be smaller)."""
        return CutGrid(
            right=_pairs(self.right[:, 1::2], 0),
            down=_pairs(self.down[1::2], 1),
            cold=_pairs(_pairs(self.cold, 0), 1),
            hot=_pairs(_pairs(self.hot, 0), 1),
            free=_pairs(_pairs(self.free, 0), 1),
        )


def _before(row: npt.NDArray[np.intp], column: npt.NDArray[np.intp], stride: int, width: int) -> npt.NDArray[np.intp]:
    """Flat index, in the array of costs, of the interface to the left neighbour (stride 1) or the upper one."""
    return row * width + column - 1 if stride == 1 else (row - 1) * width + column


def _pairs(values: npt.NDArray[np.generic], axis: int) -> npt.NDArray[np.generic]:
    """Neighbouring rows (columns) added up, or combined by `or` for bool; an odd last one stands alone."""
    take = (slice(None),) * axis
    result = values[(*take, slice(0, None, 2))].copy()
    second = values[(*take, slice(1, None, 2))]
    result[(*take, slice(0, second.shape[axis]))] += second
    return result


def grid_from_sides(side: npt.NDArray[np.uint8], right: Floats32, down: Floats32) -> tuple[CutGrid, float]:
    """The cut problem of an overlap, and the cost of the interfaces that are cut whatever the free pixels do.

    Parameters
    ----------
    side : (h, w) uint8 array
        Of :mod:`toposeam.seam.overlap`; its outermost rows and columns are never free.
    right, down : float32 arrays
        Match cost of every interface, 0 where the seam cannot run.
    """
    free = side == FREE
    cold, hot = np.zeros(side.shape, np.float32), np.zeros(side.shape, np.float32)
    forced = 0.0
    for cost, s, t in (
        (right, (slice(None), slice(None, -1)), (slice(None), slice(1, None))),
        (down, (slice(None, -1), slice(None)), (slice(1, None), slice(None))),
    ):
        for inner, outer in ((s, t), (t, s)):
            cold[inner] += np.where(free[inner] & (side[outer] == A), cost, np.float32(0))
            hot[inner] += np.where(free[inner] & (side[outer] == B), cost, np.float32(0))
            forced += float(cost[(side[inner] == A) & (side[outer] == B)].sum(dtype=np.float64))
    both_right = free[:, 1:] & free[:, :-1]
    both_down = free[1:] & free[:-1]
    return CutGrid(np.where(both_right, right, np.float32(0)), np.where(both_down, down, np.float32(0)), cold, hot, free), forced



