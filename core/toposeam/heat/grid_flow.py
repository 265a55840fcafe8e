r"""Heat that travels through a grid of conductors with limited capacity: cheapest cuts in any dimension.

Voxels of a grid are nodes, fixed at 0 (cold), fixed at 1 (hot) or free; the conductor between two neighbours
carries at most M, the cost of dividing them. Heat that needs time to set itself in motion (Cattaneo 1958)
follows the temperature differences: its flow grows with them until the conductor is full, and the net flow
into a voxel changes its temperature:

.. math::

    f \leftarrow \mathrm{clip}(f + M\,D\bar\psi, \pm M), \qquad
    \psi \leftarrow \mathrm{clip}(\psi - \tau\,D^{\mathsf T}\!f, 0, s), \qquad
    \tau = 0.65 / \textstyle\sum M

with :math:`\bar\psi = 2\psi - \psi_{\mathrm{before}}` and :math:`s` the temperature of the hot terminal.
This is the primal-dual method of Chambolle and Pock (2011, doi:10.1007/s10851-010-0251-1) with the steps of
Pock and Chambolle (2011, doi:10.1109/ICCV.2011.6126441), made a third longer, which still converges (Banert,
Upadhyaya and Giselsson 2023, arXiv:2309.03998). Σ M |Dψ| becomes least: in the end the flow fills the
conductors of one surface, where ψ jumps, and ψ is level everywhere else.

Unlike the Newton steps of :mod:`toposeam.heat.primal_dual` no system is solved. On a plane those win; in
three dimensions elimination fills in, and a few hundred sweeps, each as cheap as reading the volume a few
times, win. Most of a volume comes to rest early: of the bricks that the grid is cut into
(:mod:`toposeam.heat.bricks`) only those are swept in which something still moves.

*Bounds at every step.* The flow respects every capacity. Its size, less its losses on the way through free
voxels, is a lower bound on every cut (:meth:`GridFlow.bound`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from toposeam.arrays import Floats32, Mask
from toposeam.heat.bricks import HIGH, LOW, Bricks, along
from toposeam.heat.sweeps import HOT, Merged, MergedMoves, Part, Sweeps

#: Interval, in sweeps, at which all bricks are swept; in between only those in which something moved are.
_ALL_EVERY = 25
#: Largest share of the bricks that are awake for which only those are swept.
_MOST_AWAKE = 0.8
#: Thresholds at which the potential is cut.
_THRESHOLDS = 64
#: Least jump of ψ that counts as a crossing.
_CROSSING = 0.01


class PotentialState(NamedTuple):
    """The cheapest cut of the potential between two sweeps, and how far the heat has gathered."""

    cut: float  #: cost of the cheapest cut
    threshold: float  #: above which voxels are hot in that cut; of equals, the middle one
    objective: float  #: Σ M |Dψ|, whose minimum is the cost of the cheapest cut
    crossings: int  #: number of interfaces with more than a hundredth of the flux
    change: float  #: largest change of a voxel's temperature since the last look, in [0, 1]


class GridFlow:
    """State of the method between sweeps.

    Parameters
    ----------
    cost : sequence of float32 arrays, not negative
        M along each axis: ``cost[k]`` is one shorter than the grid along axis k, and belongs to the voxels
        on either side. 0 where nothing joins them.
    fixed, hot : bool arrays of the grid's shape
        Voxels with a fixed temperature, and those of them at 1.
    potential : float32 array of the grid's shape, optional
        Where to start from, in [0, 1].
    filled : sequence of float32 arrays, optional
        Likewise the flow, as a share of its conductor's capacity in [-1, 1], counted along the axes.
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
        free = ~fixed
        self.shape, self.n_free = fixed.shape, int(np.count_nonzero(free))
        # Stored are the free voxels, and those on the other side of their conductors.
        stored = free.copy()
        for axis in range(fixed.ndim):
            stored[along(axis, LOW)] |= free[along(axis, HIGH)]
            stored[along(axis, HIGH)] |= free[along(axis, LOW)]
        self._bricks = bricks = Bricks(stored)
        # Interfaces between fixed voxels cost the same in every cut.
        self._settled, costs = 0.0, []
        for axis, part in enumerate(cost):
            low, high = along(axis, LOW), along(axis, HIGH)
            self._settled += float(part[fixed[low] & fixed[high] & (hot[low] != hot[high])].sum(dtype=float))
            costs.append(bricks.gather(np.where(free[low] | free[high], part, np.float32(0))))
        start = np.full(fixed.shape, 0.5, np.float32) if potential is None else potential.astype(np.float32)
        start[fixed] = hot[fixed]
        self._start, self._filled = start, None if filled is None else list(filled)
        at = bricks.gather(start)
        at *= HOT
        moves = bricks.gather(free)
        self._before = at.copy()
        self._all = Sweeps(
            at,
            at.copy(),
            np.zeros_like(at),
            [np.zeros_like(at) for _ in cost] if filled is None else [bricks.gather(part) for part in filled],
            costs,
            bricks.lower,
            bricks.upper,
            MergedMoves.posed(merged, cost, bricks),
        )
        if self._all.groups is not None:
            moves.reshape(-1)[self._all.groups.voxel] = False
        self._all.set_rates(moves)
        #: Voxels at which a negative surplus is lost, and voxels at which heat arrives.
        self._loses, self._hot = moves, bricks.gather(hot & fixed)
        self._part: Part | None = None
        # No brick rests before the heat had time to get everywhere.
        self._until_all = max(fixed.shape) if potential is None else 0

    @property
    def potential(self) -> Floats32:
        """ψ in [0, 1], of the grid's shape."""
        self._settle()
        result = self._start.copy()
        self._bricks.scatter(self._all.at * np.float32(1 / HOT), result)
        return result

    @property
    def filled(self) -> list[Floats32]:
        """The flow as a share of its conductor's capacity, of the shapes of the costs."""
        self._settle()
        result = []
        for axis, values in enumerate(self._all.filled):
            shape = [length - (place == axis) for place, length in enumerate(self.shape)]
            part = np.zeros(shape, np.float32) if self._filled is None else self._filled[axis].copy()
            self._bricks.scatter(values, part)
            result.append(part)
        return result

    def sweep(self, times: int = 1) -> None:
        """Let the heat move on by some steps."""
        while times > 0:
            if self._until_all == 0:
                self._settle()
                self._all.sweep()
                times -= 1
                self._until_all = _ALL_EVERY - 1
                awake = self._all.awake()
                if np.count_nonzero(awake) <= _MOST_AWAKE * len(awake):
                    self._part = Part(self._all, awake)
            some = min(times, self._until_all)
            sweeps = self._all if self._part is None else self._part.sweeps
            for _ in range(some):
                sweeps.sweep()
            times -= some
            self._until_all -= some

    def _settle(self) -> None:
        """Copy the bricks that were swept as a part back."""
        if self._part is not None:
            self._part.give_back(self._all)
            self._part, self._until_all = None, 0

    def bound(self) -> float:
        """Compute the size of the flow, less the losses on its way: no cut costs less.

        Σ f Dψ = Σ ψ(v) surplus(v) over all voxels v. The least of that over all ψ is the surplus of the hot
        voxels plus all negative ones of free voxels.
        """
        self._settle()
        total = self._settled
        for here, surplus in self._all.surplus():
            total += float(surplus[self._hot[here]].sum(dtype=np.float64))
            surplus *= self._loses[here]
            total += float(np.minimum(surplus, 0, out=surplus).sum(dtype=np.float64))
        if self._all.groups is not None:
            total += self._all.groups.lost(self._all.filled)
        return total

    def look(self) -> PotentialState:
        """Cut the potential where that is cheapest, and measure how far the heat has gathered."""
        self._settle()
        everything = self._all
        at, before = everything.at, self._before
        tally = np.zeros(_THRESHOLDS + 1)
        objective, crossings, change = 0.0, 0, 0.0
        for here in everything.chunks():
            np.subtract(at[here], before[here], out=before[here])
            change = max(change, float(np.abs(before[here]).max(initial=0)))
            before[here] = at[here]
            for axis, cost in enumerate(everything.cost):
                above = everything.above(at, axis, here)
                jumps = np.flatnonzero((above != at[here]) & (cost[here] > 0))
                costs = cost[here].reshape(-1)[jumps]
                one, other = (values.reshape(-1)[jumps] for values in (at[here], above))
                size = np.abs(other - one)
                objective += float(np.dot(size.astype(np.float64), costs))
                crossings += int(np.count_nonzero(size > _CROSSING * HOT))
                one, other = (
                    np.ceil(values * np.float32(_THRESHOLDS / HOT) - np.float32(0.5)).astype(np.int8)
                    for values in (np.minimum(one, other), np.maximum(one, other))
                )
                # Threshold j divides those whose levels lie at or below j on one side, above j on the other.
                tally += np.bincount(one, costs, _THRESHOLDS + 1)
                tally -= np.bincount(other, costs, _THRESHOLDS + 1)
        cuts = np.cumsum(tally)[:-1] + self._settled
        ties = np.flatnonzero(cuts <= (1 + 1e-9) * cuts.min() + 1e-14 * cuts.max())
        best = int(ties[np.argmin(np.abs(ties - (_THRESHOLDS - 1) / 2))])
        return PotentialState(
            cut=float(cuts[best]),
            threshold=(best + 0.5) / _THRESHOLDS,
            objective=objective / float(HOT) + self._settled,
            crossings=crossings,
            change=change / float(HOT),
        )
