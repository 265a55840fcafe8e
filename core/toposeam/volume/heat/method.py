"""The heat method for surfaces: the label potential of a volume, from coarse to fine.

The label potential ψ is 0 on voxels of ``a`` only and 1 on voxels of ``b`` only, and minimises Σ M |Δψ|. The
surface lies where ψ jumps. The method is the same in three dimensions as in two. The heat flow of
:mod:`toposeam.heat.grid_flow` finds ψ on blocks of voxels first, and then, starting from there, on voxels.

*Large volumes.* On grids beyond `whole` voxels only a slab round the surface of the coarser grid is free, so
that the time, and the distance that heat must travel, grow with the surface only. Where the surface ends up
on the border of the slab, the slab grows and the flow continues.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypedDict

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from toposeam.arrays import Floats32, Mask
from toposeam.checks import check_range, check_whole
from toposeam.errors import OverlapError
from toposeam.heat.bricks import HIGH, LOW, along
from toposeam.heat.grid_flow import GridFlow
from toposeam.heat.sweeps import Merged
from toposeam.optimize.history import Iteration, Termination
from toposeam.seam.problem.overlap import FREE, A, B
from toposeam.seam.problem.seam_problem import Solution
from toposeam.volume.heat.levels import VolumeLevel, coarsen, refine, refine_filling
from toposeam.volume.problem.surface_problem import SurfaceProblem

#: Sweeps between two tests of convergence.
_SWEEPS_PER_TEST = 50
#: Gap between cost and bound at which a coarse grid is left, and the largest number of sweeps there.
_COARSE_TOLERANCE, _MAX_COARSE_SWEEPS = 0.01, 400
#: Reach of the slab to either side of the coarser grid's surface, in voxels of that grid.
_SLAB_REACH = 4
#: Least jump of ψ between neighbours that counts as surface for the slab.
_MIN_JUMP = 0.05
#: Largest number of times that a slab grows on one grid.
_MAX_GROWTHS = 3
#: ``soft`` is the last potential whose cost exceeded the bound by more than this share.
_SOFT_GAP = 0.1
#: Cost of a forbidden interface on coarse grids, as a multiple of the largest other cost.
_FORBIDDEN_FACTOR = 4.0


class SurfaceKeywords(TypedDict, total=False):
    """Fields of :class:`SurfaceOptions`."""

    tolerance: float
    max_iterations: int
    whole: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceOptions:
    """Options of the heat method in three dimensions.

    Examples
    --------
    >>> SurfaceOptions(tolerance=0.01).max_iterations
    3000
    """

    #: Gap between cost and bound at which the search ends: no surface is cheaper by more than this share.
    tolerance: float = 1e-3
    #: Largest number of sweeps on the finest grid.
    max_iterations: int = 3000
    #: Largest grid, in voxels, on which all voxels are free; on larger ones only a slab is.
    whole: int = 1_500_000

    def __post_init__(self) -> None:
        check_range(1e-6, 1, tolerance=self.tolerance)
        check_whole("max_iterations", self.max_iterations, 1)
        check_whole("whole", self.whole, 0)


def heat_surface(
    problem: SurfaceProblem, options: SurfaceOptions, progress: Callable[[float], None] | None = None
) -> tuple[Solution, float]:
    """Find the surface by the heat method.

    Parameters
    ----------
    problem : SurfaceProblem
    options : SurfaceOptions
    progress : callable, optional
        Called with the share of the work done, in [0, 1].

    Returns
    -------
    solution : Solution
        ``soft`` is the last label potential whose cost exceeded the bound by more than 10 %.
    bound : float
        Lower bound on the cost of every surface; 0 if a slab was used.

    Raises
    ------
    OverlapError
        When forbidden interfaces join the two sides.
    """
    side = problem.overlap.side
    finest, merged, costs = _pose(problem)
    levels = [finest]
    while (
        below := coarsen(VolumeLevel(costs, levels[-1].fixed, levels[-1].hot, levels[-1].span))
    ) is not None:
        levels.append(below)
        costs = below.cost
    run = _Search(options, progress)
    for depth in range(len(levels) - 1, -1, -1):
        run.level(levels[depth], depth, merged if depth == 0 else None)
        levels.pop()
    labels = run.labels
    if merged is None:
        labels = _without_cut_off(labels, side)
    soft = np.where(side == FREE, run.soft, (side == B).astype(np.float32))
    solution = Solution(
        labels=problem.complete(labels), soft=soft, history=tuple(run.history), termination=run.termination
    )
    return solution, 0.0 if run.in_slab else run.bound


class _Search:
    """State of a search from coarse to fine."""

    def __init__(self, options: SurfaceOptions, progress: Callable[[float], None] | None) -> None:
        self.options, self.progress = options, progress
        self.history: list[Iteration] = []
        self.termination = Termination.ITERATIONS
        self.bound, self.in_slab = 0.0, False
        self.labels: Mask
        self.soft: Floats32
        self._flow: GridFlow | None = None
        self._span: tuple[int, ...] = ()
        self._costs: tuple[Floats32, ...] = ()
        self._share = 0.0

    def level(self, level: VolumeLevel, depth: int, merged: Merged | None) -> None:
        """Solve on one grid, starting from the result on the coarser one."""
        shape = level.fixed.shape
        potential, filled, slab = None, None, None
        if self._flow is not None:
            coarse = self._flow.potential
            if level.fixed.size > self.options.whole:
                slab = refine(_near_jumps(coarse, self._costs), self._span, shape)
            potential = refine(coarse, self._span, shape)
            filled = refine_filling(self._flow.filled, self._span, shape)
            self._flow = None
        self._span, self._costs = level.span, level.cost
        self.in_slab = slab is not None
        growths = 0
        while True:
            fixed, hot = level.fixed, level.hot
            inside = merged
            if slab is not None and potential is not None:
                slab, inside = _with_whole_groups(slab, merged)
                fixed = level.fixed | ~slab
                hot = np.where(level.fixed, level.hot, potential > 0.5)
            flow = GridFlow(level.cost, fixed, hot, potential, filled, inside)
            self._solve(flow, depth)
            self._flow = flow
            if slab is None or growths == _MAX_GROWTHS:
                return
            grown = _grow_slab(slab, fixed & ~level.fixed, self.labels)
            if grown is None:
                return
            growths += 1
            slab, potential, filled = grown, flow.potential, flow.filled

    def _solve(self, flow: GridFlow, depth: int) -> None:
        finest = depth == 0
        tolerance = self.options.tolerance if finest else _COARSE_TOLERANCE
        sweeps = self.options.max_iterations if finest else _MAX_COARSE_SWEEPS
        cheapest, self.bound, first = np.inf, 0.0, 0.0
        self.termination = Termination.ITERATIONS
        self.soft = flow.potential
        for sweep in range(0, sweeps + 1, _SWEEPS_PER_TEST):
            seen = flow.look()
            if seen.cut < cheapest:
                cheapest, self.labels = seen.cut, flow.potential > seen.threshold
            self.bound = max(self.bound, flow.bound())
            self.history.append(
                Iteration(
                    stage=depth + 1,
                    objective=seen.objective,
                    compliance=self.bound,
                    bound=float("nan"),
                    n_flux=seen.crossings,
                    change=seen.change,
                    unknowns=flow.n_free,
                )
            )
            if seen.objective > (1 + _SOFT_GAP) * self.bound:
                self.soft = flow.potential
            gap = cheapest / self.bound - 1 if self.bound > 0 else np.inf
            if finest and self.progress is not None:
                first = first or min(gap, 1.0)
                done = 1 - np.log(max(min(gap, first) / tolerance, 1)) / np.log(max(first / tolerance, 1.1))
                self._share = max(self._share, float(done))
                self.progress(min(1.0, 0.1 + 0.9 * self._share))
            if gap <= tolerance:
                self.termination = Termination.SINGLE_LINE
                break
            flow.sweep(min(_SWEEPS_PER_TEST, sweeps - sweep))


def _pose(problem: SurfaceProblem) -> tuple[VolumeLevel, Merged | None, tuple[Floats32, ...]]:
    """Return the finest grid, its groups of voxels that stay undivided, and the costs for coarser grids."""
    side = problem.overlap.side
    fixed, hot = (side == A) | (side == B), side == B
    if not np.isfinite(problem.forbidden):
        return VolumeLevel(problem.costs, fixed, hot, (1,) * side.ndim), None, problem.costs
    number = np.arange(side.size, dtype=np.intp).reshape(side.shape)
    pairs = [
        (
            number[along(axis, LOW)][cost >= problem.forbidden],
            number[along(axis, HIGH)][cost >= problem.forbidden],
        )
        for axis, cost in enumerate(problem.costs)
    ]
    one, other = (np.concatenate(ends) for ends in zip(*pairs, strict=True))
    voxel, inverse = np.unique(np.concatenate([one, other]), return_inverse=True)
    half = len(one)
    graph = coo_array((np.ones(half, np.int8), (inverse[:half], inverse[half:])), shape=(len(voxel),) * 2)
    count, group = connected_components(graph, directed=False)
    at = side.ravel()[voxel]
    on_a, on_b = (np.bincount(group[at == own], minlength=count) > 0 for own in (A, B))
    if (on_a & on_b).any():
        raise OverlapError(
            "no surface avoids the voxels you excluded: they block the overlap from side to "
            "side; leave it a way through",
            kind="blocked",
        )
    fixed, hot = fixed.copy(), hot.copy()
    decided = (on_a | on_b)[group]
    fixed.ravel()[voxel[decided]] = True
    hot.ravel()[voxel[decided]] = on_b[group[decided]]
    label = np.zeros(side.shape, np.int32)
    label.ravel()[voxel] = group + 1
    highest = max(float(cost[cost < problem.forbidden].max(initial=0)) for cost in problem.costs)
    inner, deterred = [], []
    for axis, cost in enumerate(problem.costs):
        below, above = label[along(axis, LOW)], label[along(axis, HIGH)]
        inner.append(np.where((below == above) & (below > 0), np.float32(0), cost))
        deterred.append(np.minimum(cost, np.float32(_FORBIDDEN_FACTOR * highest)))
    free = ~decided & (at == FREE)
    merged = None
    if free.any():
        _, numbered = np.unique(group[free], return_inverse=True)
        merged = Merged(voxel[free], numbered)
    return VolumeLevel(tuple(inner), fixed, hot, (1,) * side.ndim), merged, tuple(deterred)


def _near_jumps(potential: Floats32, costs: Sequence[Floats32]) -> Mask:
    """Mark the voxels within a few steps of jumps of the potential, or of changes of the labels."""
    near = np.zeros(potential.shape, bool)
    for axis, cost in enumerate(costs):
        low, high = along(axis, LOW), along(axis, HIGH)
        flows = np.abs(potential[high] - potential[low]) > _MIN_JUMP
        flows |= (potential[high] > 0.5) != (potential[low] > 0.5)
        flows &= cost > 0
        near[low] |= flows
        near[high] |= flows
    return dilate(near, _SLAB_REACH)


def dilate(mask: Mask, reach: int) -> Mask:
    """Dilate a mask by a cube that reaches `reach` voxels to every side."""
    for axis in range(mask.ndim):
        mask = ndimage.maximum_filter1d(mask.view(np.uint8), 2 * reach + 1, axis, mode="constant").view(bool)
    return mask


def _with_whole_groups(slab: Mask, merged: Merged | None) -> tuple[Mask, Merged | None]:
    """Extend a slab by all groups of merged voxels that it meets; return it with those groups."""
    if merged is None:
        return slab, None
    met = np.bincount(merged.group, slab.ravel()[merged.voxel]) > 0
    kept = met[merged.group]
    slab = slab.copy()
    slab.ravel()[merged.voxel[kept]] = True
    if not kept.any():
        return slab, None
    _, numbered = np.unique(merged.group[kept], return_inverse=True)
    return slab, Merged(merged.voxel[kept], numbered)


def _grow_slab(slab: Mask, closed: Mask, labels: Mask) -> Mask | None:
    """Grow a slab where the surface runs along its border; None if it does so nowhere."""
    touched = np.zeros(slab.shape, bool)
    for axis in range(slab.ndim):
        low, high = along(axis, LOW), along(axis, HIGH)
        at_border = (labels[low] != labels[high]) & (closed[low] != closed[high])
        touched[low] |= at_border
        touched[high] |= at_border
    if not touched.any():
        return None
    return slab | dilate(touched, 2 * _SLAB_REACH)


def _without_cut_off(labels: Mask, side: npt.NDArray[np.uint8]) -> Mask:
    """Give pieces that are not connected to their own volume's ground to the other volume.

    The cost of the labelling never grows.
    """
    free = side == FREE
    for own, wanted in ((B, True), (A, False)):
        region, count = ndimage.label((side == own) | (free & (labels == wanted)))
        grounded = np.zeros(count + 1, bool)
        grounded[region[side == own]] = True
        if not grounded[1:].all():
            labels = np.where(free & (labels == wanted) & ~grounded[region], not wanted, labels)
    return labels
