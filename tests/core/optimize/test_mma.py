"""MMA on separable problems with known optima, and against Svanberg's own example."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy import optimize

from toposeam.errors import OptionError
from toposeam.optimize.mma import MMA, MMAOptions, minimize, solve_subproblem
from toposeam.optimize.multiplier import find_multiplier


def cantilever(x):
    """Svanberg 1987, section 5: weight of a five-segment cantilever under a displacement bound; optimum
    1.3400.
    """
    c = np.array([61.0, 37.0, 19.0, 7.0, 1.0])
    return 0.0624 * x.sum(), np.full(5, 0.0624), (c / x**3).sum() - 1, -3 * c / x**4


C, W = np.array([1.0, 4.0, 9.0, 0.25]), np.array([2.0, 1.0, 1.0, 3.0])


def resistors(x):
    """Minimise W.x under C/x summing to at most 1."""
    return W @ x, W, (C / x).sum() - 1, -C / x**2


RESISTORS_OPTIMUM = np.sqrt(C / W) * np.sqrt(C * W).sum()


def test_svanbergs_cantilever():
    result = minimize(cantilever, np.full(5, 5.0), np.full(5, 1.0), np.full(5, 10.0), tolerance=1e-5)
    assert result.converged
    assert result.iterations < 40
    assert result.objective == pytest.approx(1.3400, abs=1e-4)
    assert result.x == pytest.approx(
        [6.016, 5.309, 4.494, 3.502, 2.153], abs=5e-3
    )  # as published, three decimals
    assert result.constraint <= 1e-6


def test_resistors_in_series_are_solved_in_one_step():
    # Linear objective: U far away. Constraint linear in 1/x: L = 0. Then the approximation is exact.
    x = np.full(4, 20.0)
    _, df, g, dg = resistors(x)
    result, multiplier = solve_subproblem(
        x, df, g, dg, np.zeros(4), np.full(4, 1e9), np.full(4, 1e-3), np.full(4, 1e3)
    )
    assert result == pytest.approx(RESISTORS_OPTIMUM, rel=1e-5)
    assert multiplier == pytest.approx(RESISTORS_OPTIMUM[0] ** 2 * 2, rel=1e-5)  # w = λ c / x²


def test_resistors_with_moving_asymptotes():
    result = minimize(
        resistors,
        np.full(4, 20.0),
        np.full(4, 0.1),
        np.full(4, 100.0),
        tolerance=1e-6,
        max_iterations=200,
        overshoot=1.0,
    )
    assert result.converged
    assert result.x == pytest.approx(RESISTORS_OPTIMUM, rel=1e-3)


def test_an_inactive_constraint_keeps_the_unconstrained_minimum():
    target = np.array([0.2, 0.5, 0.9])

    def evaluate(x):
        return np.square(x - target).sum(), 2 * (x - target), x.sum() - 100, np.ones(3)

    # A monotone approximation has no inner minimum: the asymptotes must be free to close in on it.
    result = minimize(
        evaluate,
        np.full(3, 0.6),
        np.zeros(3),
        np.ones(3),
        MMAOptions(nearest=1e-6),
        tolerance=1e-6,
        max_iterations=200,
    )
    assert result.x == pytest.approx(target, abs=1e-4)


def test_a_rising_constraint_is_met_with_equality():
    """Projection of a point on a half-space: min |x - t|² s.t. x₁ + x₂ ≤ 1 has x = t - (t₁ + t₂ - 1)/2."""
    target = np.array([0.9, 0.7])

    def evaluate(x):
        return np.square(x - target).sum(), 2 * (x - target), x.sum() - 1, np.ones(2)

    result = minimize(
        evaluate, np.array([0.1, 0.1]), np.zeros(2), np.ones(2), tolerance=1e-7, max_iterations=200
    )
    assert result.x == pytest.approx(target - 0.3, abs=1e-4)


def test_bounds_hold_where_the_optimum_lies_beyond_them():
    upper = np.array([100.0, 100.0, 18.0, 100.0])  # the third optimum is 21.8
    result = minimize(
        resistors, np.full(4, 15.0), np.full(4, 0.1), upper, max_iterations=300, tolerance=1e-6, overshoot=1.0
    )
    assert result.x[2] == pytest.approx(18.0)
    # The others share what the third one leaves of the constraint: c/x sums to 1 - 9/18.
    others = [0, 1, 3]
    assert result.x[others] == pytest.approx(
        np.sqrt(C / W)[others] * np.sqrt(C * W)[others].sum() / 0.5, rel=1e-3
    )


def test_an_infeasible_step_goes_as_far_as_its_bounds():
    x = np.full(4, 0.5)
    _, df, g, dg = resistors(x)
    result, _ = solve_subproblem(x, df, g, dg, np.zeros(4), np.full(4, 10.0), np.full(4, 0.1), np.ones(4))
    assert result == pytest.approx(np.ones(4))


def test_a_variable_that_matters_to_nothing_stays_where_it_is():
    result, _ = solve_subproblem(
        np.array([0.5, 0.3]),
        np.array([1.0, 0.0]),
        -1.0,
        np.array([-1.0, 0.0]),
        np.full(2, -1.0),
        np.full(2, 2.0),
        np.zeros(2),
        np.ones(2),
    )
    assert result[1] == 0.3


def test_retreating_shortens_the_step_until_it_vanishes():
    method = MMA(np.full(5, 1.0), np.full(5, 10.0))
    x = np.full(5, 5.0)
    _, df, g, dg = cantilever(x)
    lengths = [np.abs(method.step(x, df, g, dg) - x).max()]
    lengths += [np.abs(method.retreat() - x).max() for _ in range(8)]
    assert all(after <= before for before, after in pairwise(lengths))
    assert lengths[-1] < 0.02 * lengths[0]


def test_overshoot_is_taken_back():
    seen = []

    def steep(x):
        seen.append((x**-8.0).sum() - 2)
        return x.sum(), np.ones(2), seen[-1], -8 * x**-9.0

    options = MMAOptions(initial=5.0, move=1.0)  # asymptotes far away: the steep constraint looks linear
    minimize(steep, np.full(2, 3.0), np.full(2, 0.01), np.full(2, 4.0), options, max_iterations=30)
    assert max(seen) > 1e6
    seen.clear()
    result = minimize(
        steep, np.full(2, 3.0), np.full(2, 0.01), np.full(2, 4.0), options, max_iterations=200, overshoot=1.0
    )
    assert result.constraint <= 1.0
    assert result.x == pytest.approx([1.0, 1.0], abs=1e-2)


def test_dropping_a_resting_variable_does_not_affect_others():
    """A sixth segment fixed by its bounds; its part of the constraint is a constant."""
    lower, upper = np.full(6, 1.0), np.full(6, 10.0)
    lower[5] = upper[5] = 3.0
    method = MMA(lower, upper)
    x = np.r_[np.full(5, 5.0), 3.0]
    alone = MMA(lower[:5], upper[:5])
    for iteration in range(6):
        _, df, g, dg = cantilever(x[:5])
        expected = alone.step(x[:5], df, g, dg)
        if iteration == 3:
            method.keep(np.arange(6) < 5)
        x = (
            method.step(x, np.r_[df, 0.0624], g, np.r_[dg, 0.0])
            if iteration < 3
            else method.step(x[:5], df, g, dg)
        )
        assert x[:5] == pytest.approx(expected)


def test_a_step_is_the_minimum_of_both_approximations():
    """Against a general optimiser that knows nothing of multipliers."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        x, low, high = rng.uniform(2, 3, 6), rng.uniform(0, 1, 6), rng.uniform(4, 6, 6)
        df = rng.normal(size=6)
        dg = rng.normal(size=6) - df  # what lowers the objective mostly breaks the constraint
        alpha, beta = low + 0.2 * (x - low), high - 0.3 * (high - x)

        def approximation(gradient, point, x=x, low=low, high=high):
            p, q = (high - x) ** 2 * np.maximum(gradient, 0), (x - low) ** 2 * np.maximum(-gradient, 0)
            return (p / (high - point) - p / (high - x) + q / (point - low) - q / (x - low)).sum()

        found, multiplier = solve_subproblem(x, df, 0.4, dg, low, high, alpha, beta)
        wanted = optimize.minimize(
            lambda point, df=df, value=approximation: value(df, point),
            x,
            bounds=list(zip(alpha, beta, strict=True)),
            constraints={
                "type": "ineq",
                "fun": lambda point, dg=dg, value=approximation: -0.4 - value(dg, point),
            },
            method="SLSQP",
            options={"ftol": 1e-12, "maxiter": 300},
        )
        assert wanted.success
        assert multiplier > 0
        assert approximation(dg, found) == pytest.approx(-0.4, abs=1e-5)
        assert approximation(dg, found) <= -0.4
        assert found == pytest.approx(wanted.x, abs=2e-4)


def journey(signs, **options):
    """The steps of one variable of range 400 whose objective falls to one side or the other, or is level;
    as no constraint binds, each goes as far as it may.
    """
    method = MMA(np.array([-100.0]), np.array([300.0]), MMAOptions(initial=0.05, **options))
    x, steps = np.array([50.0]), []
    for sign in signs:
        new = method.step(x, np.array([float(sign)]), -1.0, np.zeros(1))
        steps.append(float((new - x)[0]))
        x = new
    return steps


@pytest.mark.parametrize(
    ("signs", "options", "steps"),
    [
        # The asymptotes start 20 away, nine tenths of which may be gone.
        ([1, 1, 1, 1], {}, [-18, -18, -21.6, -25.92]),
        ([-1, -1, -1, -1], {}, [18, 18, 21.6, 25.92]),
        ([1, -1, 1, -1], {}, [-18, 18, -12.6, 8.82]),
        ([1, 0, 1, 1], {}, [-18, 0, -18, -18]),
        ([1, -1, 1], {"nearest": 0.04}, [-18, 18, -14.4]),
        ([-1, -1, -1], {"farthest": 0.0525}, [18, 18, 18.9]),
        ([1, 1, 1], {"margin": 0.4, "farther": 2.0}, [-12, -12, -24]),
        ([1, -1, -1], {"move": 0.005}, [-2, 2, 2]),
    ],
)
def test_asymptotes_move_away_and_close_in(signs, options, steps):
    assert journey(signs, **options) == pytest.approx(steps)


def test_what_is_kept_of_the_variables_retreats_and_goes_on():
    method = MMA(np.array([0.0, -100.0, 0.0]), np.array([1.0, 300.0, 9.0]), MMAOptions(initial=0.05))
    x, gradient = np.array([0.5, 50.0, 5.0]), np.array([1.0, -1.0, 1.0])
    for _ in range(2):
        x = method.step(x, gradient, -1.0, np.zeros(3))
    assert x == pytest.approx([0.41, 86, 4.19])
    alive = np.array([False, True, False])
    method.keep(alive)
    assert method.retreat() == pytest.approx([68 + 9])
    assert method.retreat() == pytest.approx([68 + 4.5])
    # From there the asymptotes, 5 away now, move on by a fifth.
    again = method.step(np.array([72.5]), gradient[alive], -1.0, np.zeros(1))
    assert again == pytest.approx([72.5 + 5.4])


def test_who_has_not_stepped_cannot_retreat():
    with pytest.raises(RuntimeError, match="none was made"):
        MMA(np.zeros(1), np.ones(1)).retreat()


def test_evaluations_are_counted_and_bounded():
    asked = []

    def slope(x):
        asked.append(x)
        return x.sum(), np.ones(2), -1.0, np.zeros(2)

    stopped = minimize(
        slope, np.full(2, 0.9), np.zeros(2), np.ones(2), MMAOptions(move=0.1), max_iterations=4
    )
    assert (stopped.iterations, len(asked), stopped.converged) == (4, 4, False)
    assert stopped.x == pytest.approx([0.6, 0.6])
    assert stopped.objective == pytest.approx(1.2)
    assert stopped.constraint == -1.0
    arrived = minimize(slope, np.zeros(2), np.zeros(2), np.ones(2))
    assert (arrived.iterations, arrived.converged) == (2, True)


def test_changes_are_measured_by_each_variable_s_range():
    def slope(x):
        return x.sum(), np.ones(2), -1.0, np.zeros(2)

    for tolerance, converged in ((0.051, True), (0.049, False)):
        found = minimize(
            slope,
            np.array([0.9, 90.0]),
            np.zeros(2),
            np.array([1.0, 100.0]),
            MMAOptions(move=0.05),
            max_iterations=2,
            tolerance=tolerance,
        )
        assert found.x == pytest.approx([0.85, 85.0])
        assert found.converged is converged


@pytest.mark.parametrize(
    "options",
    [
        {"move": 0},
        {"initial": 0},
        {"closer": 0},
        {"closer": 1.2},
        {"farther": 0.5},
        {"nearest": 0},
        {"nearest": 11.0},
        {"farthest": 0, "nearest": 0},
        {"margin": 0},
        {"margin": 1.0},
    ],
)
def test_options_out_of_range_are_refused(options):
    with pytest.raises(OptionError):
        MMAOptions(**options)


@pytest.mark.parametrize(
    "options", [{"closer": 1.0}, {"farther": 1.0}, {"nearest": 10.0}, {"farthest": 0.01}, {"margin": 0.99}]
)
def test_options_at_their_bounds_are_taken(options):
    assert MMAOptions(**options)


@pytest.mark.parametrize("exponent", [-200, 0, 200])
def test_multipliers_are_found_over_many_orders_of_magnitude(exponent):
    root = 10.0 ** (exponent / 10)
    found = find_multiplier(lambda y: root - y, 1.0, 1e-9 * root)
    assert found == pytest.approx(root, rel=1e-6)
    assert root - found <= 0


@pytest.mark.parametrize(
    "residual",
    [
        lambda y: 1 / y**3 - 5,
        lambda y: 40 - y**0.2,
        lambda y: math.exp(-y) - 1e-3,
        lambda y: math.atan(3 - y) * 1e4,
        lambda y: 1 - y if y < 7 else -6 - 50 * (y - 7),
    ],
)
@pytest.mark.parametrize("guess", [0.01, 1.0, 1e3])
def test_a_multiplier_is_feasible_and_near_the_root(residual, guess):
    asked = []

    def counted(y):
        asked.append(y)
        return residual(y)

    assert -1e-6 <= residual(find_multiplier(counted, guess, 1e-6)) <= 0
    assert len(asked) < 40


def test_multipliers_are_looked_for_as_far_as_the_reach():
    assert 1e25 < find_multiplier(lambda y: 1.0, 1.0, 1e-9) < 1e27
    assert 1e-27 < find_multiplier(lambda y: -1.0, 1.0, 1e-9) < 1e-25
    # What they are multiplied with stays finite, wherever they are looked for.
    for guess in (1e-300, 1e-125, 1e125, 1e300):
        start = min(max(math.log(guess), -300), 300)
        for value, end in ((1.0, min(300, start + 60)), (-1.0, max(-300, start - 60))):
            found = find_multiplier(lambda y, value=value: value, guess, 1e-9)
            assert math.log(found) == pytest.approx(end)


def test_the_reference_implementation_finds_the_same_optimum():
    mmapy = pytest.importorskip("mmapy")
    rng = np.random.default_rng(0)
    n = 20
    c, w = rng.uniform(0.1, 1, n), rng.uniform(0.1, 10, n)

    def evaluate(x):
        return float(w @ x), w, float((c / x**3).sum() / 400 - 1), -3 * c / x**4 / 400

    ours = minimize(
        evaluate, np.full(n, 0.5), np.full(n, 0.01), np.ones(n), max_iterations=80, tolerance=1e-6
    )
    x = np.full((n, 1), 0.5)
    before, earlier, low, high = x.copy(), x.copy(), np.zeros((n, 1)), np.ones((n, 1))
    for iteration in range(1, 60):
        f, df, g, dg = evaluate(x[:, 0])
        new, *_, low, high = mmapy.mmasub(
            1,
            n,
            iteration,
            x,
            np.full((n, 1), 0.01),
            np.ones((n, 1)),
            before,
            earlier,
            f,
            df[:, None],
            np.array([[g]]),
            dg[None],
            low,
            high,
            1.0,
            np.zeros((1, 1)),
            np.full((1, 1), 1e4),
            np.ones((1, 1)),
            0.5,
        )
        x, before, earlier = new, x, before
    assert ours.objective == pytest.approx(evaluate(x[:, 0])[0], rel=1e-5)
