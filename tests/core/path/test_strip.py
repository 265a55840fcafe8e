"""Heat on free elements only, against the whole plate."""

import numpy as np
import pytest

from toposeam.heat.plate import Plate
from toposeam.path.strip import Strip


@pytest.mark.parametrize("shape", [(5, 6), (12, 40), (70, 75)])  # dense, banded and sparse elimination
def test_a_strip_that_is_the_whole_plate_has_its_temperatures(shape):
    rng = np.random.default_rng(2)
    heat, convection = np.zeros(shape), np.zeros(shape)
    heat[1, 1] = heat[3, 2] = 1.0
    convection[-2, -1] = 1.0
    conductivity = rng.uniform(0.2, 1.0, shape)
    found = Strip(heat, convection, np.ones(shape, bool)).solve(conductivity)
    wanted = Plate(heat, convection).solve(conductivity, tolerance=1e-11, max_iterations=200)
    np.testing.assert_allclose(found.nodes, wanted.nodes, rtol=1e-6)
    np.testing.assert_allclose(found.energy, wanted.energy, rtol=1e-5, atol=1e-9)
    assert found.compliance == pytest.approx(wanted.compliance, rel=1e-8)


def test_what_is_not_free_conducts_nothing():
    free = np.ones((9, 12), bool)
    free[4, 1:] = False
    heat, convection = np.zeros((9, 12)), np.zeros((9, 12))
    heat[0, 11], convection[8, 11] = 1.0, 1.0
    conductivity = np.ones((9, 12))
    found = Strip(heat, convection, free).solve(conductivity)
    wanted = Plate(heat, convection).solve(np.where(free, 1.0, 1e-9), tolerance=1e-12, max_iterations=500)
    np.testing.assert_allclose(found.nodes[:4], wanted.nodes[:4], rtol=1e-5)
    assert not found.energy[~free].any()
