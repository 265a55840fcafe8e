r"""The method of moving asymptotes (MMA) for box bounds and one constraint.

Svanberg 1987 (doi:10.1002/nme.1620240207), with the move limits of Svanberg 2002
(doi:10.1137/S1052623499362822). To minimise f₀(x) subject to f₁(x) ≤ 0 within box bounds, each function is
replaced at xᵏ by

.. math:: \tilde f_i(x) = r_i + \sum_j \frac{p_{ij}}{U_j - x_j} + \frac{q_{ij}}{x_j - L_j},

with p = (U - xᵏ)² max(∂f, 0), q = (xᵏ - L)² max(-∂f, 0), and r such that the values agree at xᵏ. For a
multiplier y of the constraint the minimiser is closed-form in every variable, so one constraint leaves a
one-dimensional dual to solve.

*Asymptotes* close in where a variable oscillates and move away where it does not. A caller who knows the
curvature of its functions may pass better ones to :meth:`MMA.step`.

*Overshoot.* The approximation of a steep constraint may be far below the true one. In a heat
network one such step cuts the path, compliance grows by many orders of magnitude, and there is no way back.
So a step can be taken back: :meth:`MMA.retreat` halves the distance to the asymptotes, which makes both
approximations more conservative, and solves again (the idea of GCMMA, Svanberg 2002).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats
from toposeam.checks import check_range
from toposeam.errors import OptionError, Term
from toposeam.optimize.multiplier import find_multiplier


@dataclass(frozen=True, slots=True, kw_only=True)
class MMAOptions:
    """Move limit and asymptotes. Distances are shares of a variable's range."""

    #: Largest change of a variable in one step.
    move: float = 0.5
    #: Distance of the first asymptotes.
    initial: float = 0.5
    #: Factor on the distance where a variable oscillates.
    closer: float = 0.7
    #: Factor on the distance where it keeps its direction.
    farther: float = 1.2
    #: Smallest distance of an asymptote.
    nearest: float = 0.01
    #: Largest distance of an asymptote.
    farthest: float = 10.0
    #: Share of the distance to an asymptote that is never entered.
    margin: float = 0.1

    def __post_init__(self) -> None:
        check_range(0, above=True, move=self.move, initial=self.initial)
        check_range(0, 1, above=True, closer=self.closer, margin=self.margin)
        check_range(1, farther=self.farther)
        check_range(0, above=True, farthest=self.farthest)
        check_range(0, self.farthest, above=True, nearest=self.nearest)
        if self.margin == 1:
            raise OptionError(
                "{parameter} is 1, which leaves no way to go; it must be less",
                kind="number",
                parameter=Term("margin"),
                value=self.margin,
            )


def solve_subproblem(
    x: Floats,
    df: Floats,
    constraint: float,
    dg: Floats,
    low: Floats,
    high: Floats,
    alpha: Floats,
    beta: Floats,
    guess: float | None = None,
) -> tuple[Floats, float]:
    """Minimise the MMA approximation of an objective subject to that of one constraint.

    Parameters
    ----------
    x : (N,) float array
        Point of approximation.
    df, dg : (N,) float arrays
        Gradients of the objective and the constraint at `x`.
    constraint : float
        Value of the constraint at `x`; feasible where ≤ 0.
    low, high : (N,) float arrays
        Asymptotes, low < alpha ≤ beta < high.
    alpha, beta : (N,) float arrays
        Bounds of the step.
    guess : float, optional
        A multiplier to start from.

    Returns
    -------
    x : (N,) float array
        Where no point between the bounds satisfies the approximate constraint, the one that comes nearest.
    multiplier : float
    """
    above, below = high - x, x - low
    p0, q0 = np.square(above) * np.maximum(df, 0.0), np.square(below) * np.maximum(-df, 0.0)
    p1, q1 = np.square(above) * np.maximum(dg, 0.0), np.square(below) * np.maximum(-dg, 0.0)
    has_p, has_q, simple = bool(p1.any()), bool(q1.any()), not (p1.any() or q0.any())
    terms = float(
        above @ np.maximum(dg, 0.0) + below @ np.maximum(-dg, 0.0)
    )  # Σ p/(U - x) + q/(x - L) at the point of approximation
    rest = constraint - terms
    still = np.flatnonzero((df == 0) & (dg == 0))
    root_p0, root_q1 = np.sqrt(p0), np.sqrt(q1)
    from_low, from_high = root_p0 * low, root_q1 * high

    def design(y: float) -> Floats:
        # Zero of p / (U - x)² - q / (x - L)², with p = p₀ + y p₁ and q = q₀ + y q₁.
        if simple:
            value: Floats = from_low + math.sqrt(y) * from_high
            share = root_p0 + math.sqrt(y) * root_q1
        else:
            root_p, root_q = np.sqrt(p0 + y * p1), np.sqrt(q0 + y * q1)
            value, share = root_p * low + root_q * high, root_p + root_q
        value /= share
        if len(still):
            value[still] = x[still]
        np.maximum(value, alpha, out=value)
        return np.minimum(value, beta, out=value)

    def total(y: float) -> float:
        point = design(y)
        value = 0.0
        if has_p:
            value += float(np.sum(p1 / (high - point)))
        if has_q:
            value += float(np.sum(q1 / (point - low)))
        return value

    def residual(y: float) -> float:
        # Where no variable is at its bounds this is a power of y: regula falsi is fast on its logarithm.
        value = total(y)
        return math.log(value / -rest) if rest < 0 < value else value + rest

    with np.errstate(invalid="ignore"):
        if total(0.0) + rest <= 0:
            return design(0.0), 0.0
        size = float(np.abs(dg).sum())
        if guess is None or not guess > 0:
            guess = float(np.abs(df).sum()) / size if size > 0 and np.any(df) else 1.0
        tolerance = 1e-7 * (abs(constraint) + terms)
        multiplier = find_multiplier(residual, guess, tolerance / -rest if rest < 0 else tolerance)
        return design(multiplier), multiplier


class MMA:
    """The state of the method between steps.

    Parameters
    ----------
    lower, upper : (N,) float arrays
        Bounds of the variables.
    options : MMAOptions

    Attributes
    ----------
    multiplier : float
        Of the last step; 0 where the constraint was not active.
    """

    def __init__(self, lower: Floats, upper: Floats, options: MMAOptions | None = None) -> None:
        self.lower, self.upper = lower, upper
        self.options = options if options is not None else MMAOptions()
        self.multiplier = 0.0
        self._before: list[Floats] = []  # the two points before the current one, the latest first
        self._low = self._high = np.zeros(0)
        self._last: tuple[Floats, Floats, float, Floats] | None = None

    def step(
        self,
        x: Floats,
        df: Floats,
        constraint: float,
        dg: Floats,
        asymptotes: tuple[Floats, Floats] | None = None,
    ) -> Floats:
        """Compute the next point.

        Parameters
        ----------
        x, df, dg : (N,) float arrays
            The current point and the gradients of objective and constraint there.
        constraint : float
            The constraint's value; feasible where ≤ 0.
        asymptotes : pair of (N,) float arrays, optional
            Lower and upper asymptotes to use instead of the moving ones.
        """
        self._low, self._high = self._moved(x) if asymptotes is None else asymptotes
        self._before = [x, *self._before[:1]]
        self._last = (x, df, constraint, dg)
        return self._solve(*self._last)

    def retreat(self) -> Floats:
        """Shorten the last step: from the same point, with the asymptotes at half their distance."""
        if self._last is None:
            raise RuntimeError("retreat() takes back a step, but none was made")
        x = self._last[0]
        self._low, self._high = x - 0.5 * (x - self._low), x + 0.5 * (self._high - x)
        return self._solve(*self._last)

    def keep(self, alive: npt.NDArray[np.bool_]) -> None:
        """Forget all variables but some, given as an (N,) bool array."""
        self.lower, self.upper = self.lower[alive], self.upper[alive]
        self._before = [point[alive] for point in self._before]
        if self._last is not None:
            self._low, self._high = self._low[alive], self._high[alive]
            x, df, constraint, dg = self._last
            self._last = (x[alive], df[alive], constraint, dg[alive])

    def _moved(self, x: Floats) -> tuple[Floats, Floats]:
        span = np.where(self.upper > self.lower, self.upper - self.lower, 1.0)
        o = self.options
        if len(self._before) < 2:
            return x - o.initial * span, x + o.initial * span
        previous, earlier = self._before
        turn = (x - previous) * (previous - earlier)
        factor = np.where(turn > 0, o.farther, np.where(turn < 0, o.closer, 1.0))
        below = np.clip(factor * (previous - self._low), o.nearest * span, o.farthest * span)
        above = np.clip(factor * (self._high - previous), o.nearest * span, o.farthest * span)
        return x - below, x + above

    def _solve(self, x: Floats, df: Floats, constraint: float, dg: Floats) -> Floats:
        reach = self.options.move * (self.upper - self.lower)
        margin = self.options.margin
        alpha = np.maximum(np.maximum(self.lower, x - reach), self._low + margin * (x - self._low))
        beta = np.minimum(np.minimum(self.upper, x + reach), self._high - margin * (self._high - x))
        result, multiplier = solve_subproblem(
            x, df, constraint, dg, self._low, self._high, alpha, beta, self.multiplier
        )
        self.multiplier = multiplier
        return result


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MMAResult:
    """The result of :func:`minimize`."""

    x: Floats
    objective: float
    constraint: float
    #: Evaluations, those of steps taken back included.
    iterations: int
    #: Whether the variables came to rest before the iterations ran out.
    converged: bool


def minimize(
    evaluate: Callable[[Floats], tuple[float, Floats, float, Floats]],
    x: Floats,
    lower: Floats,
    upper: Floats,
    options: MMAOptions | None = None,
    *,
    max_iterations: int = 100,
    tolerance: float = 1e-4,
    overshoot: float = float("inf"),
) -> MMAResult:
    """Minimise an objective subject to one constraint and box bounds.

    Parameters
    ----------
    evaluate : callable
        Point to (objective, its gradient, constraint, its gradient); feasible where the constraint is ≤ 0.
    x, lower, upper : (N,) float arrays
        Start and bounds.
    options : MMAOptions
    max_iterations : int
        Evaluations at most, those of steps taken back included.
    tolerance : float
        Converged when no variable changes by more than this share of its range.
    overshoot : float
        A step to where the constraint exceeds both this value and its value before is taken back and
        shortened.

    Returns
    -------
    MMAResult
    """
    method = MMA(lower, upper, options)
    span = np.maximum(upper - lower, np.finfo(float).tiny)
    value, df, constraint, dg = evaluate(x)
    evaluations, converged = 1, False
    while evaluations < max_iterations and not converged:
        new = method.step(x, df, constraint, dg)
        found = evaluate(new)
        evaluations += 1
        while found[2] > max(overshoot, constraint) and evaluations < max_iterations:
            new = method.retreat()
            found = evaluate(new)
            evaluations += 1
        converged = float(np.max(np.abs(new - x) / span, initial=0.0)) <= tolerance
        x, (value, df, constraint, dg) = new, found
    return MMAResult(x=x, objective=value, constraint=constraint, iterations=evaluations, converged=converged)
