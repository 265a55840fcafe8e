r"""The thesis's own method: topology optimisation of a heat path on the ground structure, Algorithms 1 and 2
of chapter 3.

*Formulation 1.* Minimise the weighted mass ρᵀW, W = Mʳ (3.5), under a compliance bound θᵀK(ρ)θ ≤ C* with K_e
= ρᵖ K₀ (3.7)-(3.11), by MMA. *Algorithm 2* repeats that in stages, W ← W/q and C* ← N_q, the number of
elements with flux above 0.01 (3.18)-(3.21), until the heat runs along a single line. What makes the plain
transcription fragile, and what is done about it within the formulation:

- *Asymptotes.* For fixed flux the compliance q²/ρᵖ of an element has the curvature of 1/(ρ - L) with L = ρ (p
  - 1)/(p + 1), and the mass is linear, U → ∞. By Thomson's principle fixed flux overestimates the compliance
  of the next design, so MMA with these asymptotes does not overshoot (never in 3,000 steps on real crops); if
  it did, the step would be taken back. ``asymptotes="moving"`` is Svanberg's own rule.
- *Continuation.* For p = 1 the problem is convex in ρ, and where no density reaches 1 its optimum is the seam
  of least Σ M. For general p it prefers the least Σ M^(rp/(p+1)), that is M^1.5 at p = 3, and M² where the
  densities are 1. So stage 1, which finds the outline, has p = 1, and the later ones p = 3.
- *Length term.* An element much cheaper than the others on the path stays at ρ = 1, and branches there do not
  compete: a second branch saves compliance at hardly any mass. So from stage 2 on, W = Mʳ + (f M̄)ʳ, where M̄
  is the mean cost along the path and f grows to 2.
- *Live elements.* Elements that conduct next to nothing and carry next to no heat leave the ground structure
  (``dead``).
- *Steps taken back.* A step whose compliance exceeds ``overshoot`` times the bound is shortened, up to eight
  times.
- *Bounds that can be met.* The first C* is N_q⁰ = width + height, but at least twice the least compliance
  there is, which only winding overlaps need; where most heat is spread thinner than the threshold, so that
  N_q counts next to none of it, C* is twice the least compliance that the fluxes allow (``reachable``).
- *Uneven restart.* From stage 3 on densities start up to 5 % lower, differently for each element, so that
  branches alike in everything do not share the heat for ever (``uneven``).
- *Hardening.* When the path is found, one more stage with C* = N_q brings its densities to 1 (``harden``).
  It changes no seam.
- *Floors and caps.* q counts as at least ``least_flux`` in W ← W/q, densities as at least ``least_density``,
  at the same least conductance for every p; stages and iterations end at their caps, and the seam is then
  the cheapest cut of the label potential.

``ThesisOptions.plain()`` is the transcription without any of it but floors and caps; it takes Svanberg's
asymptotes, whose result depends on the move limit a great deal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Mask
from toposeam.errors import SolverError
from toposeam.optimize.history import Frame, Iteration, Termination
from toposeam.optimize.mma import MMA, MMAOptions
from toposeam.optimize.oc import OCOptions, oc_step
from toposeam.seam.problem.seam_problem import SeamProblem, Solution
from toposeam.seam.thesis.ground_structure import (
    OUTERMOST,
    CornerNetwork,
    GroundStructure,
    PixelNetwork,
    corner_network,
    ground_structure,
    pixel_network,
)
from toposeam.seam.thesis.options import ThesisOptions

#: Distance of the upper asymptote: practically infinite for densities of at most 1.
_UPPER_ASYMPTOTE = 1e3
#: Share of the distance to the lower asymptote that one step leaves: a density that falls too fast takes a
#: line out of the competition.
_MARGIN = 0.3
#: Solutions before the first elements are dropped: until then heat is still finding its way across.
_SOLUTIONS_BEFORE_DROPPING = 12
#: Largest relative spread of the factors by which conductances have changed that counts as one common factor:
#: then no new solution is needed.
_COMMON_FACTOR = 1e-9
#: Multiples of the golden ratio, modulo 1, never repeat and differ most between neighbours.
_GOLDEN = 0.6180339887498949
#: Steps taken back one after the other before an iteration gives up.
_MOST_RETREATS = 8
#: Thresholds at which the label potential of several lines is cut; the cheapest cut counts.
_THRESHOLDS = tuple(np.linspace(0.05, 0.95, 19))


def thesis_path(
    problem: SeamProblem,
    options: ThesisOptions,
    record_frames: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Solution:
    """Find the seam as the thesis does.

    Parameters
    ----------
    problem : SeamProblem
    options : ThesisOptions
    record_frames : bool
        Keep the densities of every iteration.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].

    Returns
    -------
    Solution
        Its labels always separate the patches. Where its termination is not ``SINGLE_LINE`` the heat still
        ran along several lines, and the labels are the best cut of the last state. ``soft`` is the label
        potential at the end of stage 1.
    """
    structure = ground_structure(problem)
    if not len(structure.cost):
        labels = problem.complete(np.zeros(structure.side.shape, bool)).astype(bool)
        return Solution(labels=labels, soft=labels.astype(np.float32), termination=Termination.SINGLE_LINE)
    run = _Run(problem, structure, options, record_frames, progress)
    single = run.algorithm_2() if options.formulation == 1 else run.formulation_2()
    if progress is not None:
        progress(1.0)
    return Solution(
        labels=run.best_cut(),
        soft=run.soft,
        history=tuple(run.history),
        frames=tuple(run.frames),
        termination=Termination.SINGLE_LINE if single else Termination.ITERATIONS,
    )


@dataclass(slots=True, eq=False)
class _Run:
    """One search. The arrays of length L belong to the live elements."""

    problem: SeamProblem
    structure: GroundStructure
    options: ThesisOptions
    record_frames: bool
    progress: Callable[[float], None] | None
    history: list[Iteration] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)
    view: CornerNetwork | PixelNetwork = field(init=False)
    pixels: PixelNetwork = field(init=False)
    rho: Floats = field(init=False)  #: (L,) density
    flux: Floats = field(init=False)  #: (L,) flux q
    conductance: Floats = field(init=False)  #: (L,) of the last solution
    cost: Floats = field(init=False)  #: (L,) match cost M
    penalised: Floats = field(init=False)  #: (L,) product of 1/q over the stages so far
    compliance: float = field(init=False, default=0.0)
    #: conductances and compliance that the flux was computed for
    latest: tuple[Floats, float] | None = field(init=False, default=None)
    solved: int = field(init=False, default=0)
    soft: npt.NDArray[np.float32] = field(init=False)

    def __post_init__(self) -> None:
        self.pixels = pixel_network(self.structure)
        corners = corner_network(self.structure)
        self.view = self.pixels if corners is None else corners
        self.cost = self.structure.cost[self.view.elements]
        self.rho = np.full(len(self.cost), self.options.start)
        self.penalised = np.ones(len(self.cost))

    # Algorithm 2

    def algorithm_2(self) -> bool:
        """Run stages until the heat runs along a single line; returns whether it does."""
        o = self.options
        p = o.first_penalty
        self._solve(p)
        # C* = N_q (3.18); a winding overlap, in which nothing so short fits, gets twice the least compliance
        # there is.
        bound = float(self.structure.zigzag())
        if o.reachable:
            bound = max(bound, 2.0 * self.compliance * o.start**p)
        length = 0.0
        for stage in range(1, o.stages + 1):
            self._algorithm_1(stage, p, self.cost**o.exponent + length**o.exponent, bound, stage > 1)  # (3.5)
            if stage == 1:
                self.soft = self._soft()
            single = self._is_single()
            if single or stage == o.stages or self.solved >= o.max_iterations:
                break
            bound = self._n_flux()  # (3.20)
            self.penalised /= np.maximum(self.flux, o.least_flux)  # (3.21)
            p = o.penalty
            length = (0.1 if stage == 1 else 1.0) * o.length_term * self._mean_cost()
            if stage > 1:
                # Two identical branches would share the heat for ever; slightly uneven densities, the same in
                # every run, decide between them.
                self.rho = self.rho * (1.0 - o.uneven * (self.view.elements * _GOLDEN % 1.0))
            self.rho = np.maximum(self.rho, o.least_density)
            self._solve(p)
        if single and o.harden and self.solved < o.max_iterations:
            self._harden(stage + 1)
        return single

    def _algorithm_1(self, stage: int, p: float, weight: Floats, bound: float, to_single: bool) -> None:
        """Run one stage: minimise ρᵀW s.t. C ≤ C* until the densities rest, or the path is a single line.

        `weight` is W without the penalty 1/q of the stages before.
        """
        o = self.options
        least = o.least_density ** (o.penalty / p)  # the same least conductance for every p
        curved = o.asymptotes == "curvature"
        mma = MMA(
            np.full(len(self.rho), least),
            np.ones(len(self.rho)),
            MMAOptions(move=o.move, margin=_MARGIN if curved else 0.1),
        )
        limit = o.first_iterations if stage == 1 else o.stage_iterations
        change = flux_change = 0.0
        for inner in range(1, limit + 1):
            # Outermost elements, with W = M_maxʳ, are left out: any mass of them would drown the rest.
            ordinary = self.structure.cost[self.view.elements] < OUTERMOST
            self._record(stage, float((self.rho * weight * self.penalised)[ordinary].sum()), bound, change)
            at_rest = (
                inner > 2
                and change < o.tolerance * self.rho.max()
                and flux_change < o.tolerance * self.flux.max()
            )
            if (
                at_rest
                or inner == limit
                or self.solved >= o.max_iterations
                or (to_single and self._is_single())
            ):
                return
            before, flux_before = self.rho, self.flux
            sensitivity = -p * np.square(self.flux) / self.rho ** (p + 1)  # (3.13), with q = ρᵖ ΔT
            asymptotes = (self.rho * ((p - 1.0) / (p + 1.0)), self.rho + _UPPER_ASYMPTOTE) if curved else None
            new = mma.step(
                self.rho, weight * self.penalised, self.compliance - bound, sensitivity, asymptotes
            )
            if not self._try(mma, new, p, max(o.overshoot * bound, self.compliance)):
                self.rho = before
                self._solve(p)
                return
            change = float(np.abs(self.rho - before).max())
            flux_change = float(np.abs(self.flux - flux_before).max())
            kept = self._drop(p)
            if kept is not None:
                mma.keep(kept)
                weight = weight[kept]

    def _try(self, mma: MMA, new: Floats, p: float, allowed: float) -> bool:
        """Take a step, shortened until its compliance is allowed; returns whether that succeeded."""
        for _ in range(_MOST_RETREATS):
            self.rho = new
            try:
                self._solve(p)
            except SolverError:
                self.compliance = np.inf
            if self.compliance <= allowed:
                return True
            new = mma.retreat()
        return False

    def _harden(self, stage: int) -> None:
        """Run the last stage: the path is found, and C* = N_q brings its densities to 1."""
        o = self.options
        bound = self._n_flux()  # (3.20)
        if bound > 0:
            self._keep(self.flux > 0.5)
            self.rho = np.maximum(self.rho, o.least_density)
            self._solve(o.penalty)
            self._algorithm_1(stage, o.penalty, self.cost**o.exponent, bound, False)

    # Formulation 2

    def formulation_2(self) -> bool:
        """Minimise compliance under a mass bound with conductivity M⁻ʳ (3.14)-(3.15).

        Returns whether the heat runs along a single line.
        """
        o = self.options
        mass = o.mass if o.mass is not None else float(self.structure.zigzag())
        conductivity = np.maximum((np.median(self.cost) / self.cost) ** o.exponent, 1e-9)
        options = OCOptions(move=min(o.move, 0.2), damping=1.0 / (o.penalty + 1.0))
        change = 0.0
        for step in range(1, o.max_iterations + 1):
            self._solve(o.penalty, conductivity)
            self._record(1, self.compliance, float("nan"), change)
            if step > 2 and change < 0.1 * o.tolerance:
                break
            before = self.rho
            sensitivity = -o.penalty * np.square(self.flux) / (conductivity * self.rho ** (o.penalty + 1))
            self.rho = oc_step(self.rho, sensitivity, 1.0, mass, o.least_density, 1.0, options)
            change = float(np.abs(self.rho - before).max())
        self.soft = self._soft()
        return self._is_single()

    # The state

    def _solve(self, p: float, conductivity: Floats | float = 1.0) -> None:
        self.conductance = conductivity * self.rho**p  # (3.11)
        self.solved += 1
        if self.latest is not None:
            # While no density has reached a bound, all change by one factor: the flux stays the same, and the
            # compliance changes alone.
            conductance, compliance = self.latest
            grown = self.conductance / conductance
            if np.ptp(grown) <= _COMMON_FACTOR * grown.max():
                self.compliance = compliance / float(grown.mean())
                return
            self.latest = None
        self.flux, self.compliance = self.view.flow(self.conductance)
        self.latest = self.conductance, self.compliance

    def _n_flux(self) -> float:
        """Compute N_q (3.20).

        Where most of the flux lies below the threshold, it is twice the least compliance that fluxes allow.
        """
        counted, reachable = (
            float(np.count_nonzero(self.flux > self.options.q_threshold)),
            float(np.square(self.flux).sum()),
        )
        enough = counted >= 0.99 * reachable or not self.options.reachable
        return counted if enough else 2.0 * reachable

    def _mean_cost(self) -> float:
        """Compute the mean match cost along the path, weighted by flux."""
        total = float(self.flux.sum())
        return float(self.cost @ self.flux) / total if total > 0 else 0.0

    def _is_single(self) -> bool:
        """Return whether every flux is 0 or 1, and those that are 1 make up the whole path."""
        threshold = self.options.q_threshold
        if np.any((self.flux > threshold) & (self.flux < 1.0 - threshold)):
            return False
        try:
            self.view.restricted(self.flux > 0.5)
        except SolverError:
            return False
        return True

    def _drop(self, p: float) -> Mask | None:
        """Remove the dead elements; returns a mask of those that stay, or None where none was removed."""
        conductance = self.rho**p
        share = self.options.dead
        dead = (self.flux < share * self.flux.max()) & (conductance < share * conductance.max())
        if self.solved < _SOLUTIONS_BEFORE_DROPPING or np.count_nonzero(dead) < 0.1 * len(dead):
            return None
        try:
            return self._keep(~dead)
        except SolverError:
            return None

    def _keep(self, alive: Mask) -> Mask:
        smaller = self.view.restricted(alive)
        kept = np.zeros(len(alive), bool)
        kept[np.searchsorted(self.view.elements, smaller.elements)] = True
        self.view, self.latest = smaller, None
        self.rho, self.flux, self.conductance = self.rho[kept], self.flux[kept], self.conductance[kept]
        self.cost, self.penalised = self.cost[kept], self.penalised[kept]
        return kept

    def _record(self, stage: int, objective: float, bound: float, change: float) -> None:
        o = self.options
        self.history.append(
            Iteration(
                stage=stage,
                objective=objective,
                compliance=self.compliance,
                bound=bound,
                n_flux=int(np.count_nonzero(self.flux > o.q_threshold)),
                change=change,
                unknowns=self.view.unknowns,
            )
        )
        if self.record_frames:
            density = np.zeros(len(self.structure.cost))
            density[self.view.elements] = self.rho
            right, down = self.structure.spread(density)
            self.frames.append(Frame(iteration=len(self.history), stage=stage, right=right, down=down))
        if self.progress is not None:
            self.progress(min(0.95, self.solved / (o.first_iterations + 2 * o.stage_iterations)))

    def _potential(self) -> Floats:
        """Compute the label potential of every free pixel, from the conductances of the last solution."""
        if isinstance(self.view, PixelNetwork):
            return self.view.potential(self.conductance)
        conductance = np.zeros(len(self.structure.cost))
        conductance[self.view.elements] = self.conductance
        conductance = conductance[self.pixels.elements]
        alive = conductance > 0
        smaller = self.pixels.restricted(alive)
        return smaller.potential(conductance[np.searchsorted(self.pixels.elements, smaller.elements)])

    def _map(self, values: npt.NDArray[np.generic]) -> npt.NDArray[np.generic]:
        """Spread values of the free pixels to the window; elsewhere those of the sides."""
        result = np.zeros(self.structure.side.shape, values.dtype)
        result.ravel()[self.pixels.pixels] = values
        return self.problem.complete(result)

    def _soft(self) -> npt.NDArray[np.float32]:
        return self._map(self._potential().astype(np.float32)).astype(np.float32, copy=False)

    def best_cut(self) -> Mask:
        """Cut the label potential at the threshold that gives the cheapest labelling.

        For a single line all thresholds give the same one.
        """
        potential = self._potential()
        thresholds = (0.5,) if self._is_single() else _THRESHOLDS
        cuts = [self._map(potential > threshold).astype(bool) for threshold in thresholds]
        return min(cuts, key=self.problem.cost)
