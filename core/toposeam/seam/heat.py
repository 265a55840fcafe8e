r"""The heat method: the seam as the label potential of a conductor network.

*The convex problem.* With p = 1 and no upper bound on the density the thesis's Formulation 1 with W = M² is convex in the conductances:
minimise Σ k W under a compliance bound Σ q²/k ≤ C*. For given flux its optimality criterion is k = |q| / M up to a factor, and
substituting back leaves Σ M |q|: its optimum is the shortest path for edge lengths M, the best seam.

*Seen from the pixels.* By planar duality the flux across interface (s, t) is the jump |ψ(s) - ψ(t)| of a label potential that is 0 on
what only ``a`` covers and 1 on what only ``b`` covers. No terminals need placing, so strips, Ls, rings, islands and several overlaps are
one case, and the converged potential is the label map.

*Its solution.* Setting k ← |q| / M again and again converges, and slows down the closer it comes. Newton steps on the potential and its
dual flow together (:mod:`toposeam.heat.primal_dual`) are heat networks just as well, take six to ten of them, and prove how good the seam
is: the flow bounds every seam's cost from below. Large overlaps start out contracted by what coarser networks show
(:mod:`toposeam.seam.coarse`); there the proof holds for the choices that are left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.errors import SolverError, check_range
from toposeam.heat.network import Floats, Ints, Network
from toposeam.heat.primal_dual import PrimalDual
from toposeam.images import Mask
from toposeam.optimize.history import Frame, Iteration, Termination
from toposeam.seam.coarse import WHOLE_NODES, restrict
from toposeam.seam.overlap import FREE, TOUCHING, A, B
from toposeam.seam.problem import SeamProblem
from toposeam.seam.solution import Solution

#: An interface with less flux does not belong to the heat path (thesis, q_threshold).
FLUX_THRESHOLD = 0.01
#: ``soft`` is the last potential whose cost exceeded what is proven by this share.
_SOFT = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatOptions:
    """How far the heat method goes."""

    #: The search ends when no seam can be cheaper by more than this share.
    tolerance: float = 1e-3
    #: Steps at most.
    max_iterations: int = 100

    def __post_init__(self) -> None:
        check_range(1e-9, 1, tolerance=self.tolerance)
        check_range(1, max_iterations=self.max_iterations)


def heat_path(
    problem: SeamProblem, options: HeatOptions, record_frames: bool = False, progress: Callable[[float], None] | None = None
) -> Solution:
    """Find the seam by converging heat.

    Parameters
    ----------
    problem : SeamProblem
    options : HeatOptions
    record_frames : bool
        Keep the flux of every iteration.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].

    Returns
    -------
    Solution
        ``soft`` is the label potential of the last step before the seam was proven within 10 %; where the overlap was contracted first,
        it varies only between the pixels that were left to choose from. The last record of the history is the seam itself, all heat on
        one line.
    """
    side = problem.overlap.side
    network, cost, multiplicity, node_of_pixel = _network(problem)
    history: list[Iteration] = []
    frames: list[Frame] = []
    hot = np.append(np.zeros(network.n, bool), [False, True])
    soft = hot.astype(np.float64)
    termination = Termination.ITERATIONS if network.n else Termination.SINGLE_LINE
    if network.n:
        state = PrimalDual(network, cost)
        soft = state.potential
    bound, cheapest = 0.0, np.inf
    flux = np.ones(len(cost))

    for step in range(options.max_iterations if network.n else 0):
        cut, threshold = state.best_cut()
        if cut < cheapest:
            cheapest, hot = cut, state.potential > threshold
        bound = max(bound, state.bound)
        new = np.abs(state.jump)
        objective = float(state.cost @ new)
        history.append(
            Iteration(
                stage=1, objective=objective, compliance=state.bound, bound=float("nan"),
                n_flux=int(multiplicity[new > FLUX_THRESHOLD].sum()), change=float(np.abs(new - flux).max()), unknowns=network.n,
            )
        )  # fmt: skip
        flux = new
        if objective > (1 + _SOFT) * bound:
            soft = state.potential
        if record_frames:
            frames.append(_frame(problem, state.potential[node_of_pixel], step + 1, 1))
        if cheapest <= (1 + options.tolerance) * bound:
            termination = Termination.SINGLE_LINE
            break
        if progress is not None:
            progress(min(0.95, (step + 1) / 10))
        try:
            state.step()
        except SolverError:
            break  # double precision ends here; the best cut so far stands

    labels = hot[node_of_pixel]
    if not problem.tied:
        labels = _without_islands(labels, side)
    if history:
        least = problem.total(labels)
        used = len(problem.crossed(labels))
        seam_flux = np.abs(hot[network.head].astype(np.float64) - hot[network.tail])
        history.append(
            Iteration(
                stage=2, objective=least, compliance=least, bound=float("nan"), n_flux=used,
                change=float(np.abs(seam_flux - flux).max()), unknowns=0,
            )
        )  # fmt: skip
        if record_frames:
            frames.append(_frame(problem, labels, len(history), 2))
    if progress is not None:
        progress(1.0)
    on_node = np.clip(soft, 0.0, 1.0).astype(np.float32)
    return Solution(labels=labels, soft=on_node[node_of_pixel], history=tuple(history), frames=tuple(frames), termination=termination)


def _network(problem: SeamProblem) -> tuple[Network, Floats, Floats, Ints]:
    """The network to solve, the cost of its elements and the number of interfaces each stands for; (h, w) node of every free pixel."""
    side = problem.overlap.side
    if np.count_nonzero(side == FREE) > WHOLE_NODES:
        return restrict(problem.grid)
    if problem.tied:
        network, cost, pixels = problem.grid.network(problem.grid.free)
    else:
        network, cost, pixels = problem.network, problem.element_cost, problem.pattern.pixels
    node = np.full(side.shape, network.n, np.int32)
    node.ravel()[pixels] = np.arange(network.n)
    return _without_forbidden(network, cost, node, problem.forbidden)


def _without_forbidden(network: Network, cost: Floats, node: Ints, forbidden: float) -> tuple[Network, Floats, Floats, Ints]:
    """The network in which nodes that must not be divided are one, unless that joins the two sides and no seam is possible."""
    multiplicity = np.ones(len(cost))
    closed = cost >= forbidden
    if not closed.any():
        return network, cost, multiplicity, node
    try:
        group = network.components(closed)
    except SolverError:
        return network, cost, multiplicity, node
    smaller, element_map = network.quotient(group)
    kept = np.flatnonzero(element_map >= 0)

    def total(values: Floats) -> Floats:
        return np.bincount(element_map[kept], values[kept], len(smaller.tail)).astype(np.float64, copy=False)

    return smaller, total(cost), total(multiplicity), group[node]


def _without_islands(labels: Mask, side: npt.NDArray[np.uint8]) -> Mask:
    """The labelling in which pixels that are cut off from their own patch's ground go to the other; never dearer."""
    free = side == FREE
    for own, wanted in ((B, True), (A, False)):
        region, count = ndimage.label((side == own) | (free & (labels == wanted)), TOUCHING)
        grounded = np.zeros(count + 1, bool)
        grounded[region[side == own]] = True
        if count and not grounded[1:].all():
            labels = np.where(free & (labels == wanted) & ~grounded[region], not wanted, labels)
    return labels


def _frame(problem: SeamProblem, potential: npt.NDArray[Any], iteration: int, stage: int) -> Frame:
    """Flux of every interface of the window, from the (h, w) label potential of its free pixels."""
    values = problem.complete(np.clip(potential, 0.0, 1.0).astype(np.float32))
    return Frame(
        iteration=iteration, stage=stage,
        right=np.where(problem.right > 0, np.abs(np.diff(values, axis=1)), np.float32(0)),
        down=np.where(problem.down > 0, np.abs(np.diff(values, axis=0)), np.float32(0)),
    )  # fmt: skip
