"""The optimality-criteria update against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from toposeam.errors import OptionError
from toposeam.optimize.oc import OCOptions, oc_step

WIDE = OCOptions(move=10.0)


def test_resistors_in_series_are_optimal_after_one_step():
    """Minimise c/x summed, s.t. x summing to at most V: x is proportional to sqrt(c)."""
    c = np.array([1.0, 4.0, 9.0])
    x = np.array([0.5, 0.2, 0.3])
    result = oc_step(x, -c / x**2, 1.0, 1.2, 1e-3, 1.0, WIDE)
    assert result == pytest.approx(np.sqrt(c) / 6 * 1.2, rel=1e-7)


def test_penalised_resistors_with_masses_converge():
    """Minimise c/x³ summed, s.t. m.x ≤ V: x⁴ is proportional to c/m."""
    c, m = np.array([1.0, 4.0, 9.0, 2.0]), np.array([1.0, 2.0, 0.5, 3.0])
    x = np.full(4, 0.5)
    for _ in range(30):
        x = oc_step(x, -3 * c / x**4, m, 3.0, 1e-3, 1.0, OCOptions(damping=0.25))
    expected = (c / m) ** 0.25
    assert x == pytest.approx(expected * 3.0 / (m @ expected), rel=1e-6)


@pytest.mark.parametrize("damping", [0.25, 0.5, 1.0])
def test_one_step_goes_as_far_as_its_damping_says(damping):
    """x B^η with B = -∂C/∂x / λm; from equal densities the new ones stand in the ratio of the benefits to the
    power of η.
    """
    benefit = np.array([1.0, 16.0, 81.0])
    result = oc_step(np.ones(3), -benefit, 1.0, 3.0, 1e-9, 100.0, OCOptions(move=99.0, damping=damping))
    assert result / result[0] == pytest.approx((benefit / benefit[0]) ** damping, rel=1e-6)
    assert result.sum() == pytest.approx(3.0)


def test_twice_the_mass_counts_as_half_the_benefit():
    result = oc_step(np.ones(2), -np.ones(2), np.array([1.0, 2.0]), 3.0, 1e-9, 10.0, WIDE)
    assert result[0] / result[1] == pytest.approx(np.sqrt(2.0), rel=1e-6)


def test_the_mass_bound_is_met_from_below():
    rng = np.random.default_rng(0)
    x = rng.uniform(0.1, 0.9, 500)
    result = oc_step(x, -rng.exponential(1, 500), 1.0, x.sum(), 1e-3, 1.0)
    assert x.sum() * (1 - 1e-6) <= result.sum() <= x.sum()


def test_no_variable_leaves_its_move_limit_or_its_bounds():
    rng = np.random.default_rng(1)
    x = rng.uniform(0.05, 1.0, 300)
    result = oc_step(x, -(10 ** rng.uniform(-6, 6, 300)), 1.0, 150.0, 0.05, 1.0, OCOptions(move=0.1))
    assert np.abs(result - x).max() <= 0.1 + 1e-12
    assert result.min() >= 0.05
    assert result.max() <= 1.0


def test_an_unreachable_bound_gives_the_lightest_allowed_design():
    result = oc_step(np.full(10, 0.9), -np.ones(10), 1.0, 1.0, 1e-3, 1.0, OCOptions(move=0.2))
    assert result == pytest.approx(np.full(10, 0.7))


def test_a_bound_that_does_not_bind_gives_the_densest_design():
    result = oc_step(
        np.full(4, 0.5), -np.array([1.0, 2.0, 0.0, 3.0]), 1.0, 100.0, 1e-3, 1.0, OCOptions(move=0.2)
    )
    assert result == pytest.approx([0.7, 0.7, 0.3, 0.7])


def test_elements_that_save_nothing_lose_their_mass():
    result = oc_step(np.full(4, 0.5), np.array([-1.0, 0.0, 1e-9, -1.0]), 1.0, 1.0, 1e-3, 1.0, WIDE)
    assert result == pytest.approx([0.499, 1e-3, 1e-3, 0.499])
    assert oc_step(np.full(3, 0.5), np.zeros(3), 1.0, 1.0, 1e-3, 1.0, WIDE) == pytest.approx(np.full(3, 1e-3))


@pytest.mark.parametrize("options", [{"move": 0}, {"damping": 0}, {"damping": 1.5}, {"move": float("nan")}])
def test_options_out_of_range_are_refused(options):
    with pytest.raises(OptionError):
        OCOptions(**options)
