r"""Heat that travels through a grid of conductors with limited capacity: cheapest cuts in any dimension.

Voxels of a grid are nodes, held at 0 (cold), held at 1 (hot) or free; the conductor between two neighbours
carries at most M, the cost of dividing them. Heat that needs time to set itself in motion (Cattaneo 1958)
follows the temperature differences: its flow grows with them until the conductor is full, and what arrives
at a voxel and does not leave it changes its temperature:

.. math::

    f \leftarrow \mathrm{clip}(f + M\,D\bar\psi, \pm M), \qquad
    \psi \leftarrow \mathrm{clip}(\psi - \tau\,D^{\mathsf T}\!f, 0, s), \qquad
    \tau = 1 / (2 \textstyle\sum M)

with :math:`\bar\psi = 2\psi - \psi_{\mathrm{before}}` and :math:`s` the temperature of the hot terminal.
This is the primal-dual method of Chambolle and Pock (2011, doi:10.1007/s10851-010-0251-1) with the steps of
Pock and Chambolle (2011, doi:10.1109/ICCV.2011.6126441), for which Σ M |Dψ| becomes least: in the end the
flow fills the conductors of one surface, where ψ jumps, and ψ is level everywhere else.

Unlike the Newton steps of :mod:`toposeam.heat.primal_dual` no system is solved. On a plane those win; in
three dimensions elimination fills in, and a few hundred sweeps, each as cheap as reading the volume a few
times, win.

*What is known at every step.* The flow respects every capacity; what gets lost on its way through free voxels
is counted against it, and the rest is a lower bound on every cut (:meth:`GridFlow.bound`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats32 = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
Index = tuple[slice, ...]

#: s: how far the hot terminal's temperature is from the cold one's, in steps that fill a conductor.
_HOT = np.float32(0.25)
#: A sweep goes from block to block of about so many voxels, which stay in a processor's cache.
_BLOCK = 1 << 17
#: With fewer free voxels than this share, blocks follow them; their sides off the first axis, in voxels.
_SPARSE = 0.5
_TILE = (32, 64)
#: Thresholds at which the potential is cut.
_THRESHOLDS = 64


def along(axis: int, part: slice) -> Index:
    """The index that takes a part of one axis, and all of the others."""
    return (*(slice(None),) * axis, part)


LOW, HIGH = slice(None, -1), slice(1, None)


@dataclass(frozen=True, slots=True, eq=False)
class Merged:
    """Voxels that share one temperature, such as those that must not be divided."""

    #: (m,) flat index of each such voxel, and its group.
    voxel: npt.NDArray[np.intp]
    group: npt.NDArray[np.intp]


class GridFlow:
    """State of the method between sweeps.

    Parameters
    ----------
    cost : sequence of float32 arrays, not negative
        M along each axis: ``cost[k]`` is one shorter than the grid along axis k, and belongs to the voxels
        on either side. 0 where nothing joins them.
    fixed, hot : bool arrays of the grid's shape
        Voxels held at a temperature, and which of those at 1.
    potential : float32 array of the grid's shape, optional
        Where to start from, in [0, 1].
    filled : sequence of float32 arrays, optional
        Likewise the flow, as a share of its conductor's capacity in [-1, 1], counted along the axes. These
        arrays are written to.
    merged : Merged, optional
        Free voxels that share temperatures; their conductors inside a group must cost 0.
    """

    def __init__(
        self,
        cost: Sequence[Floats32],
        fixed: Mask,
        hot: Mask,
        potential: Floats32 | None = None,
        filled: Sequence[Floats32] | None = None,
        merged: Merged | None = None,
    ) -> None:
        self.cost, self.fixed, self.hot = cost, fixed, hot
        self.filled = [np.zeros_like(part) for part in cost] if filled is None else list(filled)
        start = np.full(fixed.shape, 0.5, np.float32) if potential is None else potential.astype(np.float32)
        start[fixed] = hot[fixed]
        start *= _HOT
        self._at, self._ahead = start, start.copy()
        rate = np.zeros(fixed.shape, np.float32)
        for axis, part in enumerate(cost):
            rate[along(axis, LOW)] += part
            rate[along(axis, HIGH)] += part
        moves = ~fixed & (rate > 0)
        self._merged = _Groups(merged, cost, fixed.shape) if merged is not None else None
        if merged is not None:
            moves.ravel()[merged.voxel] = False
        np.divide(np.float32(0.5), rate, out=rate, where=moves)
        rate[~moves] = 0
        self._rate = rate
        blocks = list(_blocks(~fixed))
        sizes = [np.subtract(upper, lower).prod() for lower, upper in blocks]
        # All blocks work in the same two arrays, which stay in the cache.
        scratch = np.empty((2, int(max(sizes, default=0))), np.float32)
        self._blocks = [self._block(lower, upper, scratch) for lower, upper in blocks]

    @property
    def potential(self) -> Floats32:
        """ψ in [0, 1], of the grid's shape."""
        return self._at * np.float32(1 / _HOT)

    def sweep(self) -> None:
        """Let the heat move on by one step everywhere."""
        for surplus, at, ahead, rate, earlier, own in self._blocks:
            surplus[...] = 0
            for filled, cost, reached in earlier:
                reached += filled * cost
            for filled, cost, below, above, flow, inner, into, out_of in own:
                np.subtract(above, below, out=flow)
                filled += flow
                np.minimum(filled, 1, out=filled)
                np.maximum(filled, -1, out=filled)
                np.multiply(filled, cost, out=flow)
                into += inner
                out_of -= flow
            surplus *= rate
            np.subtract(at, surplus, out=ahead)
            np.maximum(ahead, 0, out=ahead)
            np.minimum(ahead, _HOT, out=ahead)
            np.subtract(ahead, at, out=surplus)
            at[...] = ahead
            ahead += surplus
        if self._merged is not None:
            self._merged.move(self.filled, self._at, self._ahead)

    def _block(self, lower: tuple[int, ...], upper: tuple[int, ...], scratch: Floats32) -> _Block:
        """The views of one block; faces belong to the voxel below them."""
        box = tuple(slice(first, last) for first, last in zip(lower, upper, strict=True))
        shape = [last - first for first, last in zip(lower, upper, strict=True)]
        surplus = scratch[0, : np.prod(shape)].reshape(shape)
        earlier, own = [], []
        for axis, (first, last) in enumerate(zip(lower, upper, strict=True)):
            filled, cost = self.filled[axis], self.cost[axis]

            def part(start: int, stop: int, axis: int = axis) -> Index:
                return (*box[:axis], slice(start, stop), *box[axis + 1 :])

            if first > 0:
                before = part(first - 1, first)
                earlier.append(_Earlier(filled[before], cost[before], surplus[along(axis, slice(1))]))
            end = min(last, self.fixed.shape[axis] - 1)
            if end > first:
                faces = [*shape[:axis], end - first, *shape[axis + 1 :]]
                flow = scratch[1, : np.prod(faces)].reshape(faces)
                inner = flow[along(axis, slice(last - first - 1))]
                own.append(
                    _Own(
                        filled[part(first, end)],
                        cost[part(first, end)],
                        self._ahead[part(first, end)],
                        self._ahead[part(first + 1, end + 1)],
                        flow,
                        inner,
                        surplus[along(axis, slice(1, 1 + inner.shape[axis]))],
                        surplus[along(axis, slice(end - first))],
                    )
                )
        return _Block(surplus, self._at[box], self._ahead[box], self._rate[box], earlier, own)

    def surplus(self) -> Floats32:
        """What the flow brings to every voxel and does not carry on, of the grid's shape."""
        total = np.zeros(self.fixed.shape, np.float32)
        for axis, (filled, cost) in enumerate(zip(self.filled, self.cost, strict=True)):
            flow = filled * cost
            total[along(axis, HIGH)] += flow
            total[along(axis, LOW)] -= flow
        return total

    def bound(self) -> float:
        """The size of the flow, less what gets lost on the way: no cut costs less.

        Σ f Dψ = Σ ψ(v) surplus(v) over all voxels v; the least of that over all ψ is what arrives at hot
        voxels, and at free ones whatever is negative.
        """
        surplus = self.surplus()
        arrived = float(surplus[self.hot & self.fixed].sum(dtype=np.float64))
        surplus[self.fixed] = 0
        lost = 0.0
        if self._merged is not None:
            voxel, group = self._merged.voxel, self._merged.group
            lost = float(np.minimum(np.bincount(group, surplus.ravel()[voxel]), 0).sum())
            surplus.ravel()[voxel] = 0
        return arrived + lost + float(np.minimum(surplus, 0, out=surplus).sum(dtype=np.float64))

    def objective(self) -> float:
        """Σ M |Dψ|, which no cut costs less than when it is least."""
        total = 0.0
        for axis, cost in enumerate(self.cost):
            jump = self._at[along(axis, HIGH)] - self._at[along(axis, LOW)]
            np.abs(jump, out=jump)
            jump *= cost
            total += float(jump.sum(dtype=np.float64))
        return total / float(_HOT)

    def best_cut(self) -> tuple[float, float]:
        """The cheapest cut of the potential: its cost, and the threshold above which voxels are hot; of
        equals, the middle one.
        """
        level = np.ceil(self._at * np.float32(_THRESHOLDS / _HOT) - np.float32(0.5)).astype(np.int8)
        change = np.zeros(_THRESHOLDS + 1)
        for axis, cost in enumerate(self.cost):
            below, above = level[along(axis, LOW)], level[along(axis, HIGH)]
            divided = below != above
            one, other, costs = below[divided], above[divided], cost[divided]
            # Threshold j divides those whose levels lie at or below j on one side, above j on the other.
            change += np.bincount(np.minimum(one, other), costs, _THRESHOLDS + 1)
            change -= np.bincount(np.maximum(one, other), costs, _THRESHOLDS + 1)
        costs = np.cumsum(change)[:-1]
        ties = np.flatnonzero(costs <= (1 + 1e-9) * costs.min() + 1e-14 * costs.max())
        best = int(ties[np.argmin(np.abs(ties - (_THRESHOLDS - 1) / 2))])
        return float(costs[best]), (best + 0.5) / _THRESHOLDS


class _Earlier(NamedTuple):
    """Faces below a block, whose flow an earlier block has found."""

    filled: Floats32
    cost: Floats32
    reached: Floats32  #: surplus of the voxels above them


class _Own(NamedTuple):
    """Faces of a block along one axis."""

    filled: Floats32
    cost: Floats32
    below: Floats32  #: ψ̄ of the voxels on either side
    above: Floats32
    flow: Floats32
    inner: Floats32  #: the part of `flow` between voxels of the block ...
    into: Floats32  #: ... and the surplus of those above these faces
    out_of: Floats32  #: surplus of the voxels below the faces


class _Block(NamedTuple):
    surplus: Floats32
    at: Floats32  #: ψ, in [0, s]
    ahead: Floats32  #: ψ̄
    rate: Floats32  #: τ
    earlier: list[_Earlier]
    own: list[_Own]


class _Groups:
    """The moves of voxels that share one temperature."""

    def __init__(self, merged: Merged, cost: Sequence[Floats32], shape: tuple[int, ...]) -> None:
        self.voxel, self.group = merged.voxel, merged.group
        count = int(merged.group.max()) + 1
        number = np.full(shape, -1, np.intp)
        number.ravel()[merged.voxel] = merged.group
        self._faces: list[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], npt.NDArray[np.float64]]] = []
        total = np.zeros(count)
        for axis, part in enumerate(cost):
            for side, sign in ((HIGH, 1.0), (LOW, -1.0)):
                beside = number[along(axis, side)].ravel()
                face = np.flatnonzero((beside >= 0) & (part.ravel() > 0))
                group, costs = beside[face], part.ravel()[face].astype(np.float64)
                total += np.bincount(group, costs, count)
                self._faces.append((face, group, sign * costs))
        self._rate = np.divide(0.5, total, out=np.zeros(count), where=total > 0)

    def move(self, filled: Sequence[Floats32], at: Floats32, ahead: Floats32) -> None:
        surplus = np.zeros(len(self._rate))
        for place, (face, group, cost) in enumerate(self._faces):
            surplus += np.bincount(group, filled[place // 2].ravel()[face] * cost, len(surplus))
        before = at.ravel()[self.voxel]
        # Every voxel of a group has the same temperature; the mean tells it whatever came before.
        mean = np.bincount(self.group, before) / np.bincount(self.group)
        after = np.clip(mean - self._rate * surplus, 0, _HOT)[self.group].astype(np.float32)
        at.ravel()[self.voxel] = after
        ahead.ravel()[self.voxel] = 2 * after - before


def _blocks(free: Mask) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """The first and the last voxel, exclusive, of blocks that hold every free voxel and the voxels below its
    faces; those with lower places along any axis come first.
    """
    shape = free.shape
    if np.count_nonzero(free) > _SPARSE * free.size:
        sides = [shape[-1]]
        for length in reversed(shape[1:-1]):
            sides.insert(0, max(1, min(length, _BLOCK // (4 * int(np.prod(sides))))))
    else:
        sides = [min(length, side) for length, side in zip(shape[1:], _TILE[-len(shape) + 1 :], strict=True)]
    thick = max(1, _BLOCK // int(np.prod(sides)))
    reach = free.copy()
    for axis in range(free.ndim):
        reach[along(axis, LOW)] |= free[along(axis, HIGH)]
    for corner in product(*(range(0, length, side) for length, side in zip(shape[1:], sides, strict=True))):
        far = [min(at + side, length) for at, side, length in zip(corner, sides, shape[1:], strict=True)]
        tile = reach[(slice(None), *(slice(*ends) for ends in zip(corner, far, strict=True)))]
        used = np.flatnonzero(tile.any(axis=tuple(range(1, tile.ndim))))
        if not len(used):
            continue
        last = int(used[-1]) + 1
        for first in range(int(used[0]), last, thick):
            yield (first, *corner), (min(first + thick, last), *far)
