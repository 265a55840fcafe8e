"""Plates of triangles: rhombi of two equilateral ones."""

import numpy as np
import pytest

from toposeam.heat.plate_triangles import _COUPLING, TrianglePlate


@pytest.mark.parametrize(
    ("slope", "expected"),
    [((1.0, 0.0), 2.0), ((0.0, 1.0), 2.0), ((1.0, -1.0), 2.0), ((1.0, 1.0), 6.0)],
)
def test_a_slope_has_equal_energy_along_each_triangle_side(slope, expected):
    """Along one side of the triangles two of three sides have the difference 1; between two, one has 2."""
    h, w = 4, 6
    plate = TrianglePlate(np.ones((h, w)), np.ones((h, w)))
    y, x = np.mgrid[: h + 1, : w + 1].astype(float)
    energy = plate.energy(slope[0] * x + slope[1] * y)
    assert energy.shape == (2, h, w)
    np.testing.assert_allclose(energy, expected * _COUPLING)
