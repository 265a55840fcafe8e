"""The surface problem: the overlap of two volumes, and the match cost of its interfaces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import AnyInts, Floats, Floats32, Mask
from toposeam.errors import OverlapError
from toposeam.heat.bricks import HIGH, LOW, along
from toposeam.heat.network import Network
from toposeam.seam.problem.overlap import FREE, A, B, Overlap


@dataclass(frozen=True, eq=False)
class SurfaceProblem:
    """Overlap of two volumes with the match cost of its interfaces.

    Parameters
    ----------
    overlap : Overlap
        On a window of the canvas, (d, h, w).
    costs : tuple of three float32 arrays
        Match cost between each voxel and the next one along axis 0, 1 and 2, of shapes (d - 1, h, w),
        (d, h - 1, w) and (d, h, w - 1); 0 where no surface can run.
    forbidden : float
        Interfaces that cost as much or more are forbidden.
    """

    overlap: Overlap
    costs: tuple[Floats32, ...]
    forbidden: float = float("inf")

    @property
    def free(self) -> Mask:
        """(d, h, w) bool: True on voxels whose label is free."""
        free: Mask = self.overlap.side == FREE
        return free

    def complete(self, labels: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Set every voxel of a labelling that is not free to its side (`NONE` counts as ``a``)."""
        side = self.overlap.side
        return np.where(side == FREE, labels, (side == B).astype(labels.dtype))

    def cost(self, labels: Mask) -> float:
        """Compute Σ M over the interfaces that a (d, h, w) bool labelling cuts.

        Raises
        ------
        OverlapError
            When one of them is forbidden.
        """
        full = self.complete(labels)
        total = 0.0
        for axis, cost in enumerate(self.costs):
            crossed = cost[full[along(axis, LOW)] != full[along(axis, HIGH)]]
            if crossed.max(initial=0.0) >= self.forbidden:
                raise OverlapError(
                    "no surface avoids the voxels you excluded: they block the overlap from side to "
                    "side; leave it a way through",
                    kind="blocked",
                )
            total += float(crossed.sum(dtype=np.float64))
        return total

    def on_canvas(self, labels: npt.NDArray[Any], only_b: Mask) -> npt.NDArray[Any]:
        """Put window values on the canvas: `labels` in the overlap, elsewhere 1 where only ``b`` is."""
        result = only_b.astype(labels.dtype)
        on_canvas, on_window = self.overlap.inside
        shared = self.overlap.shared[on_window]
        result[on_canvas][shared] = self.complete(labels)[on_window][shared]
        return result

    def network(self) -> tuple[Network, Floats, AnyInts]:
        """Return the free voxels as a network.

        Returns
        -------
        network : Network
            One node per free voxel in raster order; cold is ``a``, hot is ``b``.
        weight : (E,) float64 array
            Cost per element.
        index : (n,) int array
            Flat index of each node's voxel.
        """
        side = self.overlap.side
        index = np.flatnonzero(self.free)
        n = len(index)
        node = np.full(side.shape, -1, np.int32)
        node[side == A], node[side == B] = n, n + 1
        node.ravel()[index] = np.arange(n, dtype=np.int32)
        tails, heads, weights = zip(*self._elements(node, n), strict=True)
        tail, head = np.concatenate(tails), np.concatenate(heads)
        return Network(n, tail, head), np.concatenate(weights).astype(np.float64), index

    def _elements(self, node: npt.NDArray[np.int32], n: int) -> Iterator[tuple[AnyInts, AnyInts, Floats32]]:
        for axis, cost in enumerate(self.costs):
            one, other = node[along(axis, LOW)], node[along(axis, HIGH)]
            joined = (cost > 0) & (np.minimum(one, other) < n) & (one >= 0) & (other >= 0)
            one, other = one[joined], other[joined]
            yield np.minimum(one, other), np.maximum(one, other), cost[joined]
