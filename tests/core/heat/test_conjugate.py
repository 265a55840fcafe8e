"""The smoother of conjugate gradients, and when they stop."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from toposeam.heat.conjugate import _SMOOTHED, DAMPING
from toposeam.heat.plate import Plate


def test_two_damped_steps_are_the_least_over_what_they_smooth():
    """Chebyshev: what is left of an eigenvector is as large at both ends as, with the other sign, midway."""

    def left(eigenvalue):
        return (1 - DAMPING[0] * eigenvalue) * (1 - DAMPING[1] * eigenvalue)

    low, high = _SMOOTHED
    assert left(low) == pytest.approx(left(high), abs=1e-6)
    assert left((low + high) / 2) == pytest.approx(-left(low), abs=1e-6)
    assert 0 < left(low) < 0.25


def test_a_step_that_gains_little_is_the_last():
    """Void among strokes conducts a thousandth: temperatures are known well long before residuals say so."""
    rng = np.random.default_rng(0)
    heat, sinks = np.full((128, 128), 1 / 128**2), np.zeros((128, 128))
    sinks[60:68, :2] = 1.0
    k = np.where(gaussian_filter(rng.random((128, 128)), 3, mode="wrap") > 0.5, 1.0, 1e-3)
    plate = Plate(heat, sinks)
    exact = plate.solve(k, tolerance=1e-12, max_iterations=300)
    near = plate.solve(k * rng.uniform(0.9, 1.1, k.shape), tolerance=1e-12, max_iterations=300).nodes
    by_residual = plate.solve(k, near, tolerance=1e-3)
    for share in (1e-3, 1e-4, 1e-5):
        found = plate.solve(k, near, tolerance=1e-12, energy=share)
        error = found.nodes - exact.nodes
        squared = float((plate.energy(error) * k).sum()) / exact.compliance
        assert 0 < squared < 2 * share
        # Known to the squared error, and from below, which the load times the temperatures is not.
        assert -2 * share < found.compliance / exact.compliance - 1 <= 1e-9
        assert found.iterations < 0.6 * by_residual.iterations
