r"""The fast heat method: the seam as the label potential of converged heat.

*The convex start.* With p = 1 and no upper bound on the density the thesis's Formulation 1 with W = M² is convex in the conductances:
minimise Σ k W under a compliance bound Σ q²/k ≤ C*. For given flux its optimality criterion is k = |q| / M up to a factor, and
substituting back leaves Σ M |q|: its optimum is the shortest path for edge lengths M, the best seam. Each step solves the heat network
for the flux of the current conductances and sets k ← |q| / M.

*Seen from the pixels.* By planar duality the flux across interface (s, t) is the jump |ψ(s) - ψ(t)| of a label potential that is 0 on
what only ``a`` covers, 1 on what only ``b`` covers, and solves Laplace's equation for conductances M / |q|. No terminals need placing, so
strips, Ls, rings, islands and several overlaps are one case, and the converged potential is the label map. By the maximum principle every
pixel on one side stays connected to that side's ground, so the seam is a single line.

*Over-relaxation.* With x = k M the step x ← |q| leaves path i a share that falls by L / L_i per step, L being the best path's length and
L_i that of path i. x ← x^(1-ω) |q|^ω has the same fixed points and, for ω = 1.5, one and a half times that rate.

*Contraction.* Where next to no heat flows, compared with Σ M q² / Σ M q, the seam will not run: the two pixels become one node and
parallel interfaces one element, whose costs add up. The problem keeps its form and shrinks by orders of magnitude. Large overlaps start
out contracted by what coarser networks show (:mod:`toposeam.seam.coarse`).

*The penalising end.* Like the thesis's W ← W / q (3.21), k ← |q|^(1+s) / M with s growing makes the strongest line win until every flux
is 0 or 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.errors import OptionError
from toposeam.heat.network import DENSE_NODES, Floats, Ints
from toposeam.images import Mask
from toposeam.optimize.history import Frame, Iteration, Termination
from toposeam.seam.coarse import restrict
from toposeam.seam.problem import SeamProblem
from toposeam.seam.relaxation import RELAXATION, contract, convex_step, penalising_step

#: An interface with less flux does not belong to the heat path (thesis, q_threshold).
FLUX_THRESHOLD = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class HeatOptions:
    """How the heat method iterates."""

    #: Solutions on the whole network before the first contraction.
    whole: int = 6
    #: Convex steps k = |q| / M before penalising begins.
    convex: int = 30
    #: Over-relaxation ω of the convex steps; 1 is the plain step, beyond 1.8 they swing.
    relaxation: float = RELAXATION
    #: By how much the penalising exponent s grows per step.
    growth: float = 0.05
    #: An interface is closed, when the network is contracted, below this share of the typical flux.
    threshold: float = 0.003
    #: Steps between contractions.
    between: int = 6
    #: Steps at most.
    max_iterations: int = 100

    def __post_init__(self) -> None:
        if not (self.whole >= 1 and self.convex >= 1 and self.between >= 1 and self.max_iterations >= 1):
            raise OptionError("whole, convex, between and max_iterations must be at least 1")
        for name, low, high in (("threshold", 0.0, 0.5), ("growth", 0.0, 1.0), ("relaxation", 0.5, 1.9)):
            if not low < getattr(self, name) <= high:
                raise OptionError(f"{name} is {getattr(self, name)}; it must be above {low} and at most {high}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """What a seam method returns: labels on the overlap's window, and how it got there."""

    labels: Mask
    soft: npt.NDArray[np.float32]
    history: tuple[Iteration, ...] = ()
    frames: tuple[Frame, ...] = ()
    termination: Termination = Termination.DIRECT


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
        ``soft`` is the label potential at the end of the first stage, before anything is contracted.
    """
    grid = problem.grid
    network, weight, pixels = grid.network(grid.free)
    network, weight, multiplicity, node_of_pixel = restrict(network, weight)
    history: list[Iteration] = []
    frames: list[Frame] = []
    soft = np.zeros(len(node_of_pixel))
    flux = np.ones(len(weight))
    strength = np.ones(len(weight))  # k M, the flux that the conductances expect
    penalty = 0.0
    settled = np.zeros(2)  # weight and number of the interfaces that already carry all the heat
    stage, left = 1, options.whole
    termination = Termination.ITERATIONS
    potential = np.zeros(network.n + 2)
    potential[-1] = 1.0

    for step in range(options.max_iterations if network.n else 0):
        resistance = weight / strength
        potential = network.solve(resistance)
        new = network.difference(potential)
        history.append(
            Iteration(
                stage=stage, objective=float(settled[0] + weight @ new), compliance=float(settled[0] + resistance @ np.square(new)),
                bound=float("nan"), n_flux=int(settled[1] + multiplicity[new > FLUX_THRESHOLD].sum()),
                change=float(np.abs(new - flux).max()), unknowns=network.n,
            )
        )  # fmt: skip
        flux = new
        if stage == 1:
            soft = potential[node_of_pixel]
        if record_frames:
            frames.append(_frame(problem, potential[node_of_pixel[:-2]], pixels, step + 1, stage))
        undecided = np.count_nonzero((potential > FLUX_THRESHOLD) & (potential < 1 - FLUX_THRESHOLD))
        if progress is not None:
            progress(1.0 if not undecided else min(0.95, (step + 1) / (options.convex + 15)))
        if not undecided:
            termination = Termination.SINGLE_LINE
            break
        left -= 1
        if left == 0:
            left = options.between
            large = network.n > DENSE_NODES  # smaller ones cost less than contracting them
            contracted = contract(network, weight, flux, strength, multiplicity, options.threshold) if large else None
            if contracted is not None:
                network, weight, flux, strength, multiplicity, node_map, newly_settled = contracted
                settled += newly_settled
                node_of_pixel = node_map[node_of_pixel]
                if not network.n:
                    potential, termination = np.array([0.0, 1.0]), Termination.SINGLE_LINE
                    break
            stage = max(stage, 2)
        if step + 1 >= options.convex:
            stage = 3
            penalty = min(penalty + options.growth, 1.5)
        strength = penalising_step(flux, penalty) if penalty else convex_step(strength, flux, options.relaxation)

    shape = grid.free.shape
    labels = np.zeros(shape, bool)
    labels.ravel()[pixels] = potential[node_of_pixel[:-2]] > 0.5
    soft_map = np.zeros(shape, np.float32)
    soft_map.ravel()[pixels] = soft[:-2]
    if not network.n:
        termination = Termination.SINGLE_LINE
    return Solution(labels=labels, soft=soft_map, history=tuple(history), frames=tuple(frames), termination=termination)


def _frame(problem: SeamProblem, potential: Floats, pixels: Ints, iteration: int, stage: int) -> Frame:
    """Flux of every interface of the window, from the label potential of its pixels."""
    on_free = np.zeros(problem.grid.free.shape, np.float32)
    on_free.ravel()[pixels] = potential
    values = problem.complete(on_free)
    return Frame(
        iteration=iteration, stage=stage,
        right=np.where(problem.right > 0, np.abs(np.diff(values, axis=1)), np.float32(0)),
        down=np.where(problem.down > 0, np.abs(np.diff(values, axis=0)), np.float32(0)),
    )  # fmt: skip
