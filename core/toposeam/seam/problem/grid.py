"""The seam problem on the pixel grid: costs between free pixels, and towards the two fixed sides.

A labelling of the free pixels (False: ``a`` shows, True: ``b``) costs the sum over interfaces whose two
pixels differ. The seam is the set of those interfaces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import AnyInts, Floats, Floats32, Mask
from toposeam.heat.network import Network
from toposeam.seam.problem.overlap import FREE, NONE, A, B

#: Side of the cells that corridors are made of, px; and half width of a corridor along a seam, in cells.
CELL, SEAM_CELLS = 8, 8


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

    def network(self, pixels: Mask) -> tuple[Network, Floats, AnyInts]:
        """Build the network of some free pixels, which no interface may join to other free pixels.

        Parameters
        ----------
        pixels : (h, w) bool array
            A subset of `free`, such as one of its components.

        Returns
        -------
        network : Network
            One node per pixel, in raster order; the terminals are the labels False (cold) and True (hot).
        weight : (E,) float64 array
            Cost per element.
        index : (n,) int array
            Flat index of each node's pixel.
        """
        index = np.flatnonzero(pixels)
        n = len(index)
        number = np.zeros(pixels.shape, np.int32)
        number.ravel()[index] = np.arange(n, dtype=np.int32)
        tails, heads, weights = [], [], []
        for cost, s, t in ((self.right, np.s_[:, :-1], np.s_[:, 1:]), (self.down, np.s_[:-1], np.s_[1:])):
            joined = (cost > 0) & pixels[s]
            tails.append(number[s][joined])
            heads.append(number[t][joined])
            weights.append(cost[joined])
        for terminal, ends in ((n, self.cold), (n + 1, self.hot)):
            touching = (ends > 0) & pixels
            tails.append(number[touching])
            heads.append(np.full(len(tails[-1]), terminal, np.int32))
            weights.append(ends[touching])
        row, column = np.divmod(index, pixels.shape[1])
        chessboard = (row + column) % 2 == 0
        network = Network(n, np.concatenate(tails), np.concatenate(heads), chessboard)
        return network, np.concatenate(weights).astype(np.float64), index


def grid_from_sides(side: npt.NDArray[np.uint8], right: Floats32, down: Floats32) -> CutGrid:
    """Build the cut problem of an overlap.

    Parameters
    ----------
    side : (h, w) uint8 array
        Of :mod:`toposeam.seam.problem.overlap`; its outermost rows and columns are never free.
    right, down : float32 arrays
        Match cost of every interface, 0 where the seam cannot run.
    """
    free = side == FREE
    # Few pixels lie beside fixed ones: pages of these arrays that are never written take no memory.
    cold, hot = np.zeros(side.shape, np.float32), np.zeros(side.shape, np.float32)
    for cost, s, t in (
        (right, (slice(None), slice(None, -1)), (slice(None), slice(1, None))),
        (down, (slice(None, -1), slice(None)), (slice(1, None), slice(None))),
    ):
        places = np.nonzero(free[s] != free[t])
        for inner, outer in ((s, t), (t, s)):
            beside = np.where(free[inner][places], side[outer][places], NONE)
            for ends, ground in ((cold, A), (hot, B)):
                touching = tuple(index[beside == ground] for index in places)
                ends[inner][touching] += cost[touching]
    both_right = free[:, 1:] & free[:, :-1]
    both_down = free[1:] & free[:-1]
    return CutGrid(
        np.where(both_right, right, np.float32(0)), np.where(both_down, down, np.float32(0)), cold, hot, free
    )


def grown(places: Mask, cells: int) -> Mask:
    """Return all pixels within a number of cells of some places, (h, w) bool."""
    h, w = places.shape
    padded = np.zeros((-(-h // CELL) * CELL, -(-w // CELL) * CELL), bool)
    padded[:h, :w] = places
    coarse = padded.reshape(padded.shape[0] // CELL, CELL, -1, CELL).any(axis=(1, 3))
    coarse = scipy.ndimage.binary_dilation(coarse, np.ones((2 * cells + 1,) * 2, bool))
    wide: Mask = coarse.repeat(CELL, axis=0).repeat(CELL, axis=1)[:h, :w]
    return wide
