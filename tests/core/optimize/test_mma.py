"""MMA on separable problems with known optima, and against Svanberg's own example."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

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


@pytest.mark.parametrize(
    "options", [{"move": 0}, {"closer": 1.2}, {"farther": 0.5}, {"nearest": 11.0}, {"margin": 1.0}]
)
def test_options_out_of_range_are_refused(options):
    with pytest.raises(OptionError):
        MMAOptions(**options)


@pytest.mark.parametrize("exponent", [-200, 0, 200])
def test_multipliers_are_found_over_many_orders_of_magnitude(exponent):
    root = 10.0 ** (exponent / 10)
    found = find_multiplier(lambda y: root - y, 1.0, 1e-9 * root)
    assert found == pytest.approx(root, rel=1e-6)
    assert root - found <= 0


def test_an_infeasible_residual_gives_the_largest_multiplier():
    assert find_multiplier(lambda y: 1.0, 1.0, 1e-9) > 1e20


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
