r"""The heat method: the seam as the label potential of a conductor network.

*The convex problem.* With p = 1 and no upper bound on the density the thesis's Formulation 1 with W = M² is
convex in the conductances: minimise Σ k W under a compliance bound Σ q²/k ≤ C*. For given flux its optimality
criterion is k = |q| / M up to a factor, and substituting back leaves Σ M |q|: its optimum is the shortest
path for edge lengths M, the best seam.

*Seen from the pixels.* By planar duality the flux across interface (s, t) is the jump |ψ(s) - ψ(t)| of a
label potential that is 0 where only ``a`` has pixels and 1 where only ``b`` has. No terminals need
placing, so strips, Ls, rings, islands and several overlaps are one case, and the converged potential is the
label map.

*Its solution.* Setting k ← |q| / M again and again converges, and slows down the closer it comes. Newton
steps on the potential and its dual flow together (:mod:`toposeam.heat.primal_dual`) are heat networks just as
well, take six to ten of them, and prove how good the seam is: the flow bounds every seam's cost from below.

*Large overlaps* are first contracted with the help of coarser networks
(:mod:`toposeam.seam.heat.coarsening`), then refined in a band along the seam
(:mod:`toposeam.seam.heat.band_refinement`); a proof holds only for the choices that contraction left.
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
from toposeam.optimize.history import Frame, Iteration, Termination
from toposeam.seam.heat.band_refinement import beside_seam, best_nearby, fix_labels
from toposeam.seam.heat.coarsening import WHOLE_NODES, restrict
from toposeam.seam.problem.grid import grown
from toposeam.seam.problem.overlap import FREE, NONE
from toposeam.seam.problem.seam_problem import SeamProblem, Solution

#: Half width, in cells of 8 px, of the band round a seam in which the label potential of a large overlap is
#: computed; and the most Newton steps for it.
_POTENTIAL_CELLS, _POTENTIAL_STEPS = 4, 20
#: Least flux, of a total of 1, of an interface on the heat path (thesis, q_threshold).
FLUX_THRESHOLD = 0.01
#: Gap between a potential's cost and the bound, as a share of the bound, above which the potential is still
#: soft: ``soft`` is the last such one.
SOFT_GAP = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatOptions:
    """Stopping rules of the heat method.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 12, 6))
    >>> ts.find_seam(a, b, options=ts.seam.HeatOptions(tolerance=0.01)).optimum_ratio() < 1.01
    True
    """

    #: The search ends when no seam can be cheaper by more than this share.
    tolerance: float = 1e-3
    #: Newton steps at most.
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
    # In a large overlap the network's bound holds only for the choices that coarsening left.
    bound = 0.0 if large else _bound(problem, labels, counted, heat.bound)
    potential = np.clip(heat.soft, 0.0, 1.0).astype(np.float32)[node_of_pixel]
    if large and not problem.tied:
        labels = _refined(problem, labels, node_of_pixel)
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
    """Compute the label potential of an overlap that was not heated whole.

    It is that of the last Newton step before the seam is proven within 10 %; in a large overlap it is
    computed in a band of some thirty pixels on either side of the seam.

    Parameters
    ----------
    problem : SeamProblem
    labels : (h, w) bool array
        True where ``b`` shows; beyond the band the potential equals the labels.

    Returns
    -------
    (h, w) float32 array in [0, 1]
    """
    free = problem.overlap.side == FREE
    labels = problem.complete(labels).astype(bool, copy=False)
    band = free
    if _is_large(problem):
        band = grown(beside_seam(labels, free, problem.overlap.side != NONE), _POTENTIAL_CELLS) & free
    network, cost, _, node_of_pixel = _pixel_network(fix_labels(problem, band, labels))
    potential: npt.NDArray[np.float32] = labels.astype(np.float32)
    if not network.n:
        return potential
    with one_thread():
        state = PrimalDual(network, cost)
        soft = state.potential
        for _ in range(_POTENTIAL_STEPS):
            if float(state.cost @ np.abs(state.jump)) <= (1 + SOFT_GAP) * state.bound:
                break
            soft = state.potential
            try:
                state.step()
            except SolverError:
                break
    potential[band] = np.clip(soft, 0.0, 1.0)[node_of_pixel[band]]
    return potential


def _bound(problem: SeamProblem, labels: Mask, counted: float, proven: float) -> float:
    """Turn a lower bound on the cuts of the network into one on the labellings of the problem.

    The network leaves out interfaces between pixels that are fixed, or merged with fixed ones. All labellings
    pay the same for these: the total cost of any labelling, less what the network `counted` of it.
    """
    return proven + problem.total(labels) - counted


def _is_large(problem: SeamProblem) -> bool:
    return int(np.count_nonzero(problem.overlap.side == FREE)) > WHOLE_NODES


def _refined(problem: SeamProblem, labels: Mask, node_of_pixel: AnyInts) -> Mask:
    """Find the best seam near the one that the heat found."""
    free = problem.overlap.side == FREE
    alone = np.bincount(node_of_pixel[free], minlength=int(node_of_pixel.max()) + 1) == 1
    return best_nearby(problem, labels, alone[node_of_pixel] & free)


def _network(problem: SeamProblem) -> tuple[Network, Floats, Floats, AnyInts]:
    """Build the network to solve.

    Returns it, the costs of its elements, the number of interfaces that each element stands for, and the
    (h, w) node of every free pixel.
    """
    return restrict(problem.grid) if _is_large(problem) else _pixel_network(problem)


def _pixel_network(problem: SeamProblem) -> tuple[Network, Floats, Floats, AnyInts]:
    """Build the network with a node for every free pixel; returns as :func:`_network` does."""
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
    """Merge the nodes that must not be divided, unless that joins the two sides, so that no seam is possible.

    Returns as :func:`_network` does.
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
    """Record the flux of every interface, from the (h, w) label potential of the window's free pixels."""
    values = problem.complete(np.clip(potential, 0.0, 1.0).astype(np.float32))
    return Frame(
        iteration=iteration,
        stage=stage,
        right=np.where(problem.right > 0, np.abs(np.diff(values, axis=1)), np.float32(0)),
        down=np.where(problem.down > 0, np.abs(np.diff(values, axis=0)), np.float32(0)),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Heat:
    """The state of a network after Newton steps."""

    #: (n + 2,) bool, the hot side of the cheapest cut found.
    hot: npt.NDArray[np.bool_]
    #: (n + 2,) potential of the last step whose cost exceeded the bound by more than 10 %.
    soft: Floats
    #: (E,) flux of the last step.
    flux: Floats
    #: Lower bound on the cost of every cut.
    bound: float
    history: tuple[Iteration, ...]
    termination: Termination


def gather_heat(
    network: Network,
    cost: Floats,
    tolerance: float,
    most: int,
    multiplicity: Floats | None = None,
    watch: Callable[[Floats, int, bool], None] | None = None,
) -> Heat:
    """Take Newton steps until the heat of a network has gathered along its cheapest cut.

    Parameters
    ----------
    network : Network
    cost : (E,) float64 array
        Cost of dividing the two nodes of each element.
    tolerance : float
        The steps end when no cut can be cheaper by more than this share.
    most : int
        Steps at most.
    multiplicity : (E,) float64 array, optional
        How many interfaces each element stands for; one by default.
    watch : callable, optional
        Called with the potential of each step, the step's number from 0, and whether it is the last one.
    """
    hot = np.append(np.zeros(network.n, bool), [False, True])
    soft, flux = hot.astype(np.float64), np.ones(len(cost))
    if not network.n:
        return Heat(hot, soft, flux, 0.0, (), Termination.SINGLE_LINE)
    history: list[Iteration] = []
    termination = Termination.ITERATIONS
    state = PrimalDual(network, cost)
    soft = state.potential
    raised = float(np.maximum(state.cost - cost, 0.0).sum())  # the flow may exceed the given costs by this
    bound, cheapest = 0.0, np.inf
    for step in range(most):
        cut, threshold = state.best_cut()
        if cut < cheapest:
            cheapest, hot = cut, state.potential > threshold
        size = state.bound
        bound = max(bound, size - raised)
        new = np.abs(state.jump)
        objective = float(state.cost @ new)
        used = new > FLUX_THRESHOLD
        history.append(
            Iteration(
                stage=1,
                objective=objective,
                compliance=size,
                bound=float("nan"),
                n_flux=int(np.count_nonzero(used) if multiplicity is None else multiplicity @ used),
                change=float(np.abs(new - flux).max()),
                unknowns=network.n,
            )
        )
        flux = new
        if objective > (1 + SOFT_GAP) * bound:
            soft = state.potential
        proven = cheapest <= (1 + tolerance) * bound
        if watch is not None:
            watch(state.potential, step, proven)
        if proven:
            termination = Termination.SINGLE_LINE
            break
        try:
            state.step()
        except SolverError:
            break  # double precision ends here; the best cut so far stands
    return Heat(hot, soft, flux, bound, tuple(history), termination)
