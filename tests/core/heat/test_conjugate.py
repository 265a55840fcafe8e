"""The smoother of conjugate gradients."""

import pytest

from toposeam.heat.conjugate import _SMOOTHED, DAMPING


def test_two_damped_steps_are_the_least_over_what_they_smooth():
    """Chebyshev: what is left of an eigenvector is as large at both ends as, with the other sign, midway."""

    def left(eigenvalue):
        return (1 - DAMPING[0] * eigenvalue) * (1 - DAMPING[1] * eigenvalue)

    low, high = _SMOOTHED
    assert left(low) == pytest.approx(left(high), abs=1e-6)
    assert left((low + high) / 2) == pytest.approx(-left(low), abs=1e-6)
    assert 0 < left(low) < 0.25
