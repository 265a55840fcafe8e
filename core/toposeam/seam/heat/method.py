r"""The heat method: the seam as the label potential of a conductor network.

*The convex problem.* With p = 1 and no upper bound on the density the thesis's Formulation 1 with W = M² is
convex in the conductances: minimise Σ k W under a compliance bound Σ q²/k ≤ C*. For given flux its optimality
criterion is k = |q| / M up to a factor, and substituting back leaves Σ M |q|: its optimum is the shortest
path for edge lengths M, the best seam.

*Seen from the pixels.* By planar duality the flux across interface (s, t) is the jump |ψ(s) - ψ(t)| of a
label potential that is 0 on what only ``a`` covers and 1 on what only ``b`` covers. No terminals need
placing, so strips, Ls, rings, islands and several overlaps are one case, and the converged potential is the
label map.

*Its solution.* Setting k ← |q| / M again and again converges, and slows down the closer it comes. Newton
steps on the potential and its dual flow together (:mod:`toposeam.heat.primal_dual`) are heat networks just as
well, take six to ten of them, and prove how good the seam is: the flow bounds every seam's cost from below.

*Large overlaps* start out contracted by what coarser networks show (:mod:`toposeam.seam.heat.coarsening`),
and are opened again along the seam (:mod:`toposeam.seam.heat.band_refinement`); a proof holds for the choices
that are left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import AnyInts, Floats, Mask
from toposeam.checks import check_range, check_whole
from toposeam.errors import SolverError
from toposeam.heat.network import Network
from toposeam.heat.primal_dual import PrimalDual
from toposeam.heat.threads import one_thread
from toposeam.optimize.history import Frame, Iteration
from toposeam.seam.heat.band_refinement import beside_seam, best_nearby, keeping
from toposeam.seam.heat.coarsening import WHOLE_NODES, restrict
from toposeam.seam.heat.newton import SOFT, gather_heat
from toposeam.seam.problem.grid import grown
from toposeam.seam.problem.overlap import FREE, NONE
from toposeam.seam.problem.seam_problem import SeamProblem, Solution

#: In large overlaps ``soft`` is sought within so many cells (of 8 px) of the seam, in steps at most.
_SOFT_CELLS, _SOFT_STEPS = 4, 20


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatOptions:
    """How far the heat method goes.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 12, 6))
    >>> ts.find_seam(a, b, options=ts.seam.HeatOptions(tolerance=0.01)).optimum_ratio() < 1.01
    True
    """

    #: The search ends when no seam can be cheaper by more than this share.
    tolerance: float = 1e-3
    #: Steps at most.
    max_iterations: int = 100

    def __post_init__(self) -> None:
        check_range(1e-9, 1, tolerance=self.tolerance)
        check_whole("max_iterations", self.max_iterations, 1)


def heat_path(
    problem: SeamProblem,
    options: HeatOptions,
    record_frames: bool = False,
    progress: Callable[[float], None] | None = None,
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
        ``soft`` is the label potential of the last step before the seam was proven within 10 %; where it says
        ``contracted``, the overlap was never heated whole, and :func:`potential_beside` has a better one. The
        last record of the history is the seam itself, all heat on one line.
    """
    large = _is_large(problem)
    network, cost, multiplicity, node_of_pixel = _network(problem)
    frames: list[Frame] = []

    def watch(potential: Floats, step: int, proven: bool) -> None:
        if record_frames:
            frames.append(_frame(problem, potential[node_of_pixel], step + 1, 1))
        if progress is not None and not proven:
            progress(min(0.95, (step + 1) / 10))

    heat = gather_heat(network, cost, options.tolerance, options.max_iterations, multiplicity, watch)
    hot, history = heat.hot, list(heat.history)
    labels = hot[node_of_pixel]
    counted = float(cost @ (hot.take(network.head) != hot.take(network.tail)))
    # Of a large overlap it holds for the choices that were left.
    bound = 0.0 if large else _bound(problem, labels, counted, heat.bound)
    potential = np.clip(heat.soft, 0.0, 1.0).astype(np.float32)[node_of_pixel]
    if large and not problem.tied:
        labels = _opened_again(problem, labels, node_of_pixel)
    if history:
        least = problem.total(labels)
        used = len(problem.crossed(labels))
        seam_flux = np.abs(hot[network.head].astype(np.float64) - hot[network.tail])
        history.append(
            Iteration(
                stage=2,
                objective=least,
                compliance=least,
                bound=float("nan"),
                n_flux=used,
                change=float(np.abs(seam_flux - heat.flux).max()),
                unknowns=0,
            )
        )
        if record_frames:
            frames.append(_frame(problem, labels, len(history), 2))
    if progress is not None:
        progress(1.0)
    return Solution(
        method="heat",
        bound=bound,
        labels=labels,
        soft=potential,
        contracted=large,
        history=tuple(history),
        frames=tuple(frames),
        termination=heat.termination,
    )


def potential_beside(problem: SeamProblem, labels: Mask) -> npt.NDArray[np.float32]:
    """The label potential of an overlap that was not heated whole: the heat of the last step before the seam
    is proven within 10 %; of a large one in a band of some thirty pixels on either side of it.

    Parameters
    ----------
    problem : SeamProblem
    labels : (h, w) bool array
        What shows ``b``; beyond the band that is the potential.

    Returns
    -------
    (h, w) float32 array in [0, 1]
    """
    free = problem.overlap.side == FREE
    labels = problem.complete(labels).astype(bool, copy=False)
    band = free
    if _is_large(problem):
        band = grown(beside_seam(labels, free, problem.overlap.side != NONE), _SOFT_CELLS) & free
    network, cost, _, node_of_pixel = _pixel_network(keeping(problem, band, labels))
    potential: npt.NDArray[np.float32] = labels.astype(np.float32)
    if not network.n:
        return potential
    with one_thread():
        state = PrimalDual(network, cost)
        soft = state.potential
        for _ in range(_SOFT_STEPS):
            if float(state.cost @ np.abs(state.jump)) <= (1 + SOFT) * state.bound:
                break
            soft = state.potential
            try:
                state.step()
            except SolverError:
                break
    potential[band] = np.clip(soft, 0.0, 1.0)[node_of_pixel[band]]
    return potential


def _bound(problem: SeamProblem, labels: Mask, counted: float, proven: float) -> float:
    """What no labelling of the problem undercuts, from what is proven of its network.

    All labellings pay the same besides what the network counts: between pixels that are fixed, or merged with
    what is fixed. One of them, and what of it the network has counted, tells how much.
    """
    return proven + problem.total(labels) - counted


def _is_large(problem: SeamProblem) -> bool:
    return int(np.count_nonzero(problem.overlap.side == FREE)) > WHOLE_NODES


def _opened_again(problem: SeamProblem, labels: Mask, node_of_pixel: AnyInts) -> Mask:
    """The best seam near the one that the heat found."""
    free = problem.overlap.side == FREE
    alone = np.bincount(node_of_pixel[free], minlength=int(node_of_pixel.max()) + 1) == 1
    return best_nearby(problem, labels, alone[node_of_pixel] & free)


def _network(problem: SeamProblem) -> tuple[Network, Floats, Floats, AnyInts]:
    """The network to solve, the cost of its elements and the number of interfaces each stands for; (h, w)
    node of every free pixel.
    """
    return restrict(problem.grid) if _is_large(problem) else _pixel_network(problem)


def _pixel_network(problem: SeamProblem) -> tuple[Network, Floats, Floats, AnyInts]:
    """As :func:`_network`, every free pixel a node."""
    side = problem.overlap.side
    if problem.tied:
        network, cost, pixels = problem.grid.network(problem.grid.free)
    else:
        network, cost, pixels = problem.network, problem.element_cost, problem.pattern.pixels
    node = np.full(side.shape, network.n, np.int32)
    node.ravel()[pixels] = np.arange(network.n)
    return _without_forbidden(network, cost, node, problem.forbidden)


def _without_forbidden(
    network: Network, cost: Floats, node: AnyInts, forbidden: float
) -> tuple[Network, Floats, Floats, AnyInts]:
    """The network in which nodes that must not be divided are one, unless that joins the two sides and no
    seam is possible.
    """
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


def _frame(problem: SeamProblem, potential: npt.NDArray[Any], iteration: int, stage: int) -> Frame:
    """Flux of every interface of the window, from the (h, w) label potential of its free pixels."""
    values = problem.complete(np.clip(potential, 0.0, 1.0).astype(np.float32))
    return Frame(
        iteration=iteration,
        stage=stage,
        right=np.where(problem.right > 0, np.abs(np.diff(values, axis=1)), np.float32(0)),
        down=np.where(problem.down > 0, np.abs(np.diff(values, axis=0)), np.float32(0)),
    )
