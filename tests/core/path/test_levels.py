"""Ways from cell to cell, which lead round the corners of obstacles."""

import numpy as np

from toposeam.path.levels import _without_diagonals, shortest_ways


def test_a_diagonal_step_goes_over_the_side_that_is_free():
    way = np.array([[3, 2], [2, 3], [2, 4], [3, 5]])
    cost = np.ones((5, 6))
    np.testing.assert_array_equal(
        _without_diagonals(way, cost), [[3, 2], [3, 3], [2, 3], [2, 4], [2, 5], [3, 5]]
    )
    cost[3, 3] = cost[2, 5] = np.inf
    np.testing.assert_array_equal(
        _without_diagonals(way, cost), [[3, 2], [2, 2], [2, 3], [2, 4], [3, 4], [3, 5]]
    )
    cost[2, 2] = np.inf  # now the first step leads between two obstacles
    assert _without_diagonals(way, cost) is None


def test_the_shortest_way_goes_round_obstacles_that_touch():
    """Its steps are over sides; the diagonal gap in the wall is none."""
    cost = np.full((7, 9), 2.0)
    cost[:4, 4] = cost[4:6, 5] = np.inf
    (way,) = shortest_ways(cost, [(3, 1)], [(3, 7)])
    assert sorted(way[[0, -1]].tolist()) == [[3, 1], [3, 7]]
    assert (np.abs(np.diff(way, axis=0)).sum(axis=1) == 1).all()
    assert np.isfinite(cost[tuple(way.T)]).all()
    assert [6, 5] in way.tolist()


def test_every_source_finds_the_sink_that_is_cheapest():
    cost = np.ones((5, 12))
    cost[:, 4] = 100.0
    ways = shortest_ways(cost, [(2, 3), (4, 11)], [(0, 0), (1, 7)])
    assert [sorted(way[[0, -1]].tolist()) for way in ways] == [[[0, 0], [2, 3]], [[1, 7], [4, 11]]]
    assert [len(way) for way in ways] == [6, 8]
