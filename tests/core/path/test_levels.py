"""Ways from cell to cell, which lead round the corners of obstacles."""

import numpy as np

from toposeam.path.levels import _over_sides


def test_a_diagonal_step_goes_over_the_side_that_is_free():
    way = np.array([[3, 2], [2, 3], [2, 4], [3, 5]])
    cost = np.ones((5, 6))
    np.testing.assert_array_equal(_over_sides(way, cost), [[3, 2], [3, 3], [2, 3], [2, 4], [2, 5], [3, 5]])
    cost[3, 3] = cost[2, 5] = np.inf
    np.testing.assert_array_equal(_over_sides(way, cost), [[3, 2], [2, 2], [2, 3], [2, 4], [3, 4], [3, 5]])
    cost[2, 2] = np.inf  # now the first step leads between two obstacles
    assert _over_sides(way, cost) is None
