"""Cheap paths by a lattice of corners, against all corners."""

from __future__ import annotations

import numpy as np
import pytest

from toposeam.seam.corner_graph import CornerGraph
from toposeam.seam.grid import CELL
from toposeam.seam.lattice import PITCH, Half, _graph, _node, beside_cheap_paths


def costs(rng, height, width):
    """Of going down and right between height × width corners, as the module says."""
    below, beside = rng.random((2, height, width)).astype(np.float32)
    below[-1], beside[:, -1] = np.inf, np.inf
    return below, beside


def shortest(below, beside, start, end, rows, columns):
    """From one corner to another through some rows and columns alone."""
    allowed = np.zeros(below.shape, bool)
    allowed[max(rows.start, 0) : rows.stop, max(columns.start, 0) : columns.stop] = True
    down, right = below.copy(), beside.copy()
    down[~allowed], right[~allowed] = np.inf, np.inf
    down[:-1][~allowed[1:]], right[:, :-1][~allowed[:, 1:]] = np.inf, np.inf
    width = below.shape[1]
    graph = CornerGraph.of(down, right, tuple(y * width + x for y, x in (start, end)))
    return np.inf if graph is None else graph.cheapest_path()[1]


@pytest.mark.parametrize(("y", "x"), [(0, 0), (1, 0), (2, 3)])
def test_edges_cost_what_the_cheapest_way_between_their_corners_does(y, x):
    below, beside = costs(np.random.default_rng(0), 15, 14)
    rows, columns = -(-(15 - y) // PITCH), -(-(14 - x) // PITCH)
    half = Half(below, beside, y, x, (rows, columns))
    for found, dy, dx, wide in (
        (half.downwards(4, 0, 1), 4, 0, (0, 1)),
        (half.right(4, 1), 0, 4, (1, 0)),
        (half.downwards(2, 2), 2, 2, (0, 0)),
        (half.downwards(2, -2), 2, -2, (0, 0)),
    ):
        assert found.shape == (rows, columns)
        for (a, b), cost in np.ndenumerate(found):
            start, end = (y + 4 * a, x + 4 * b), (y + 4 * a + dy, x + 4 * b + dx)
            if min(end) < 0 or end[0] >= 15 or end[1] >= 14:
                assert np.isinf(cost)
                continue
            within = [
                slice(min(one, other) - more, max(one, other) + more + 1)
                for one, other, more in zip(start, end, wide, strict=True)
            ]
            best = shortest(below, beside, start, end, *within)
            assert best <= cost * (1 + 1e-6)  # it never turns back, which pays now and then
            assert cost <= 1.3 * best


@pytest.mark.parametrize("ends", [((0, 140), (400, 33)), ((1, 1), (398, 319)), ((137, 0), (264, 320))])
def test_squares_hold_the_ends_and_the_valley_between_them(ends):
    rng = np.random.default_rng(3)
    below, beside = costs(rng, 401, 321)
    (top, left), (bottom, right) = ends
    below[top:bottom, left] = 0.01
    beside[bottom, min(left, right) : max(left, right)] = 0.01
    near = beside_cheap_paths(
        below, beside, tuple(y * 321 + x for y, x in ends), np.ones((400, 320), bool), 13
    )
    assert near[top:bottom:CELL, min(left, 319)].all()
    assert near[min(bottom, 399), min(left, right) : max(left, right)].all()
    assert 0 < near.mean() < 0.8


def test_where_nothing_joins_the_ends_nothing_is_near():
    below, beside = costs(np.random.default_rng(3), 41, 41)
    below[20] = np.inf
    free = np.ones((40, 40), bool)
    assert not beside_cheap_paths(below, beside, (20, 40 * 41 + 20), free, 13).any()
    below[:] = beside[:] = np.inf
    assert not beside_cheap_paths(below, beside, (20, 40 * 41 + 20), free, 13).any()


@pytest.mark.parametrize("step", [(0, 0), (0, 2), (0, -2), (2, 0), (-2, 0)])
def test_a_corner_that_is_joined_to_nothing_is_replaced_by_one_beside_it(step):
    shape = 5, 6
    graph = _graph(*costs(np.random.default_rng(0), 21, 25), (0, 0), shape)
    graph.data[:] = np.inf
    row, column = 4 + step[0], 8 + step[1]
    if (row - column) % PITCH:  # half way between corners: of no lattice
        row, column = row + step[1], column + step[0]
    node = (row % PITCH // 2 * shape[0] + row // PITCH) * shape[1] + column // PITCH
    graph.data[8 * node] = 1
    assert _node(graph, row - step[0], column - step[1], shape) == node
    graph.data[8 * node] = np.inf
    assert _node(graph, row - step[0], column - step[1], shape) is None
