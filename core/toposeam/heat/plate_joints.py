r"""Joints of the border of a plate to itself, as groups of border nodes that share one temperature.

A plate of h × w elements has (h + 1) × (w + 1) nodes. Where motifs lie side by side, heat that leaves one
enters the next, so the temperature of some border nodes is that of others: θ = Tθ' (thesis 4.8). The joints
are those of the thesis, plus the one of a compound motif:

- ``free``: no joint; the border is insulated, as a mirror is (Figure 4.1);
- ``translate``: right is left and bottom is top (4.6), a torus;
- ``rotate``: every side is symmetric about its midpoint (4.7), so that the plate joins copies of itself
  turned by 180°;
- a shift along the rows: right is left, and bottom is top moved by a share of the width, as bricks lie, or
  two motifs side by side that alternate in both directions; or along the columns, as in a half-drop.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from toposeam.arrays import Ints32


class Joint(StrEnum):
    """Names of the joints."""

    FREE = "free"
    TRANSLATE = "translate"
    ROTATE = "rotate"

    def fits(self, shape: tuple[int, int]) -> bool:
        """Return whether a plate of `shape` elements can be joined in this way."""
        h, w = shape
        if self is Joint.FREE:
            return True
        if self is Joint.ROTATE:
            return h % 2 == 0 and w % 2 == 0 and min(h, w) >= 4
        return h >= 3 and w >= 3


@dataclass(frozen=True)
class Shift:
    """A torus whose rows (axis 1) or columns (axis 0) of plates are shifted by a share of one."""

    axis: int
    share: Fraction

    def fits(self, shape: tuple[int, int]) -> bool:
        """Return whether a plate of `shape` elements can be joined in this way."""
        return shape[self.axis] % self.share.denominator == 0 and min(shape) >= 3 and shape[self.axis] >= 6


class Groups:
    """The border nodes of one plate that share temperatures.

    Parameters
    ----------
    shape : (int, int)
        Elements down and across.
    joint : Joint or Shift

    Attributes
    ----------
    nodes : (B,) int array
        The border nodes that share with others, as flat indices into (h + 1, w + 1).
    share : (B,) float array
        One over the number of nodes in the group of each.
    """

    def __init__(self, shape: tuple[int, int], joint: Joint | Shift) -> None:
        count = (shape[0] + 1) * (shape[1] + 1)
        first, second = _pairs(shape, joint)
        if len(first) == 0:
            self.nodes, self.share = np.zeros(0, np.int32), np.zeros(0)
            self._group, self._groups = np.zeros(0, np.int32), 0
            return
        graph = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(count, count))
        _, label = connected_components(graph, directed=False)
        self.nodes = np.unique(np.concatenate([first, second])).astype(np.int32)
        _, group = np.unique(label[self.nodes], return_inverse=True)
        self._group, self._groups = group.astype(np.int32), int(group.max()) + 1
        self.share = 1.0 / np.bincount(self._group)[self._group]

    def gather(self, values: npt.NDArray[np.floating]) -> None:
        """Give every node the sum over its group, in place: TTᵀ applied to a flat (N,) array."""
        if self._groups:
            values[self.nodes] = np.bincount(self._group, values[self.nodes], self._groups)[self._group]

    def once(self, values: npt.NDArray[np.floating]) -> None:
        """Divide shared values by the number of nodes that share them, in place, so that sums count each
        group once.
        """
        if self._groups:
            values[self.nodes] *= self.share.astype(values.dtype)

    def dot(self, a: npt.NDArray[np.floating], b: npt.NDArray[np.floating]) -> float:
        """Compute the inner product of flat arrays that are equal within groups, counting each group once."""
        total = float(a @ b)
        if self._groups:
            total -= float(np.sum(a[self.nodes] * b[self.nodes] * (1.0 - self.share)))
        return total

    def numbering(self, count: int) -> tuple[Ints32, int]:
        """Number the independent temperatures θ': the number of every node's, (N,) ints, and their count."""
        leader = np.arange(count)
        if self._groups:
            first = np.full(self._groups, count)
            np.minimum.at(first, self._group, self.nodes)
            leader[self.nodes] = first[self._group]
        _, number = np.unique(leader, return_inverse=True)
        return number.astype(np.int32), int(number.max()) + 1


def _pairs(
    shape: tuple[int, int], joint: Joint | Shift
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """List the pairs of border nodes with the same temperature."""
    h, w = shape
    node = np.arange((h + 1) * (w + 1)).reshape(h + 1, w + 1)
    pairs: list[tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]] = []
    if joint is Joint.TRANSLATE:
        pairs = [(node[:, 0], node[:, -1]), (node[0], node[-1])]
    elif joint is Joint.ROTATE:
        pairs = [(side, side[::-1]) for side in (node[:, 0], node[:, -1], node[0], node[-1])]
        pairs = [(a[a != b], b[a != b]) for a, b in pairs]
    elif isinstance(joint, Shift):
        across = node if joint.axis == 1 else node.T
        along = shape[joint.axis]
        moved = int(joint.share * along)
        pairs = [
            (across[:, 0], across[:, -1]),
            (across[-1, :-1], np.roll(across[0, :-1], moved)),
            (across[-1, -1:], np.roll(across[0, :-1], moved)[:1]),
        ]
    if not pairs:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    return np.concatenate([a for a, _ in pairs]), np.concatenate([b for _, b in pairs])
