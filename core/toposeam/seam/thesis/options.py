"""The options of the thesis's own method; :mod:`toposeam.seam.thesis.method` explains them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from toposeam.checks import check_choice, check_range, check_whole
from toposeam.errors import OptionError, Term


@dataclass(frozen=True, slots=True, kw_only=True)
class ThesisOptions:
    """Options of the thesis's method.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 12, 6))
    >>> options = ts.seam.ThesisOptions(formulation=2)
    >>> ts.find_seam(a, b, method="thesis", options=options).optimum_ratio() < 1.1
    True
    """

    #: 1: minimise weighted mass under a compliance bound, by MMA. 2: minimise compliance under a mass bound,
    #: by optimality criteria.
    formulation: Literal[1, 2] = 1
    #: SIMP exponent p.
    penalty: float = 3.0
    #: p in stage 1.
    first_penalty: float = 1.0
    #: Exponent r of the match cost in the weight W = Mʳ, or in the conductivity M⁻ʳ of Formulation 2.
    exponent: float = 2.0
    #: Density at the start.
    start: float = 0.5
    #: Least density.
    least_density: float = 1e-3
    #: Stages (outer iterations J) at most.
    stages: int = 8
    #: Inner iterations at most, of all stages together.
    max_iterations: int = 100
    #: Inner iterations at most in the first stage.
    first_iterations: int = 25
    #: Inner iterations at most in each later stage.
    stage_iterations: int = 20
    #: A stage ends when no density and no flux changes by more than this share of the largest one.
    tolerance: float = 0.01
    #: Flux from which on an element belongs to the path.
    q_threshold: float = 0.01
    #: No flux counts as less than this in W ← W/q.
    least_flux: float = 1e-3
    #: f in the length term (f M̄)ʳ that is added to W from stage 3 on; in stage 2 a tenth of it.
    length_term: float = 2.0
    #: Largest change of a density in one iteration.
    move: float = 1.0
    #: Source of MMA's asymptotes: the curvature of the compliance, or Svanberg's rule.
    asymptotes: Literal["curvature", "moving"] = "curvature"
    #: A step to more than this multiple of the compliance bound is taken back.
    overshoot: float = 4.0
    #: An element with less flux and less conductance than this share of the largest leaves; 0: none does.
    dead: float = 1e-3
    #: Largest share by which densities are lowered, unevenly, at the start of each stage from 3 on.
    uneven: float = 0.05
    #: Whether C* is raised where nothing within it could carry the heat.
    reachable: bool = True
    #: Whether one more stage brings the densities of the found path to 1.
    harden: bool = True
    #: Upper bound of the mass in Formulation 2; None: width + height of the overlap.
    mass: float | None = None

    def __post_init__(self) -> None:
        check_choice("formulation", self.formulation, (1, 2))
        check_choice("asymptotes", self.asymptotes, ("curvature", "moving"))
        check_choice("reachable", self.reachable, (True, False))
        check_choice("harden", self.harden, (True, False))
        check_range(0, 0.5, dead=self.dead, uneven=self.uneven)
        check_range(1, 10, penalty=self.penalty, first_penalty=self.first_penalty)
        check_range(0.1, 5, exponent=self.exponent)
        check_range(1, 1e6, overshoot=self.overshoot)
        check_range(0, 10, length_term=self.length_term)
        check_range(
            0,
            1,
            above=True,
            start=self.start,
            tolerance=self.tolerance,
            least_flux=self.least_flux,
            move=self.move,
        )
        check_range(0, 0.499, above=True, q_threshold=self.q_threshold)
        check_range(0, 1, above=True, least_density=self.least_density)
        if self.least_density ** max(self.penalty, self.first_penalty) < 1e-15:
            raise OptionError(
                "{parameter} is {value}; to the power of {penalty} {power:g} it must be at least 1e-15",
                kind="number",
                parameter=Term("least_density"),
                value=self.least_density,
                power=self.penalty,
            )
        if not self.least_density < self.start:
            raise OptionError(
                "{parameter} is {value} and {least_density} {least}; the start must be denser",
                kind="number",
                parameter=Term("start"),
                value=self.start,
                least=self.least_density,
            )
        for name in ("stages", "max_iterations", "first_iterations", "stage_iterations"):
            check_whole(name, getattr(self, name), 1)
        if self.mass is not None:
            check_range(0, above=True, mass=self.mass)

    @classmethod
    def plain(cls, *, move: float = 0.2, **options: Any) -> ThesisOptions:
        """Algorithms 1 and 2 as they are written, with Svanberg's asymptotes.

        Parameters
        ----------
        move : float
            Largest change of a density in one iteration, which the thesis does not state. 0.2 is usual; with
            1 seams become much dearer (docs/results.md).
        **options
            Further fields.
        """
        as_written: dict[str, Any] = {
            "first_penalty": 3.0,
            "length_term": 0.0,
            "asymptotes": "moving",
            "overshoot": 1e6,
            "dead": 0.0,
            "uneven": 0.0,
            "reachable": False,
            "harden": False,
        }
        return cls(**{**as_written, "move": move, **options})
