"""Planned ways against the shortest ways that are known or that Dijkstra finds."""

import numpy as np
import pytest
from scipy import ndimage
from skimage.graph import MCP_Geometric

import toposeam as ts


def dijkstra_cost(cost, start, end):
    """Least cost along the grid's eight directions."""
    reached, _ = MCP_Geometric(np.where(np.isinf(cost), -1, cost)).find_costs([start[::-1]])
    return reached[end[::-1]]


def free_line(path, blocked):
    """Whether no sample of a line lies in a blocked pixel."""
    share = np.linspace(0, 1, 400)[:, None]
    samples = np.concatenate([a + (b - a) * share for a, b in zip(path.points[:-1], path.points[1:], strict=True)])
    return not blocked[samples[:, 1].astype(int), samples[:, 0].astype(int)].any()


def test_an_even_ground_gives_the_straight_line():
    found = ts.plan_path((40, 60), (4, 5), (52, 30))
    assert found.length == pytest.approx(np.hypot(48, 25), rel=1e-3)
    assert found.cost == pytest.approx(found.length)


def test_round_a_wall_through_its_nearer_end():
    wall = np.zeros((48, 64), bool)
    wall[:30, 30:33] = True
    found = ts.plan_path((48, 64), (8, 20), (56, 20), obstacles=wall)
    shortest = np.hypot(30 - 8.5, 30 - 20.5) + 3 + np.hypot(56.5 - 33, 30 - 20.5)
    assert free_line(found.paths[0], wall)
    assert shortest - 1e-6 <= found.length < 1.02 * shortest


@pytest.mark.parametrize("seed", range(4))
def test_terrain_costs_no_more_than_the_grid_s_shortest_way(seed):
    rng = np.random.default_rng(seed)
    height = ndimage.gaussian_filter(rng.random((56, 64)), 5)
    cost = 1 + 6 * (height - height.min()) / np.ptp(height)
    cost[20:26, 20:50] = np.inf
    found = ts.plan_path(cost, (5, 5), (58, 50))
    assert np.isfinite(found.cost)
    assert found.cost <= 1.01 * dijkstra_cost(cost, (5, 5), (58, 50))


def test_stopovers_are_visited_in_order():
    stops = [(50, 6), (8, 34)]
    found = ts.plan_path((40, 60), (5, 5), (50, 34), stopovers=stops)
    points = found.paths[0].points
    visited = [int(np.hypot(*(points - np.array(stop) - 0.5).T).argmin()) for stop in stops]
    assert visited == sorted(visited)
    for stop in stops:
        assert np.hypot(*(points - np.array(stop) - 0.5).T).min() < 1e-9
    assert found.length == pytest.approx(np.hypot(45, 1) + np.hypot(42, 28) + 42, rel=0.01)
    assert {record.leg for record in found.history} == {1, 2, 3}


def test_several_sources_share_a_sink():
    found = ts.plan_path((40, 60), [(5, 5), (5, 34), (55, 5)], (30, 20))
    assert len(found.paths) == 3
    for path, (x, y) in zip(found.paths, [(5, 5), (5, 34), (55, 5)], strict=True):
        np.testing.assert_array_equal(path.points[[0, -1]], [(x + 0.5, y + 0.5), (30.5, 20.5)])


def test_the_mass_bound_falls_as_the_thesis_has_it():
    options = ts.PathOptions()
    found = ts.plan_path((40, 60), (4, 5), (52, 30), options=options)
    least = options.stroke_px * np.hypot(48, 25)
    for n, record in enumerate(found.history, 1):
        assert record.bound == pytest.approx(max(40 * 60 / n**2, least))
        assert record.mass <= record.bound * (1 + 1e-6)
    assert [found.history[0].p, found.history[-1].p] == [1.0, options.p]
    assert found.density[20, 0] < 0.01


def test_progress_reaches_the_end():
    shares = []
    ts.plan_path((20, 20), (2, 2), (17, 17), stopovers=[(2, 17)], progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.parametrize(
    ("changes", "error", "phrase"),
    [
        ({"sources": (60, 5)}, ts.OptionError, "outside the ground"),
        ({"sinks": (30, 10)}, ts.OptionError, "on an obstacle"),
        ({"sinks": (5, 5)}, ts.OptionError, "same pixel"),
        ({"sinks": []}, ts.OptionError, "no sink"),
        ({"sources": (35, 30)}, ts.PathError, "part the point"),
        ({"stopovers": [(5, 5)]}, ts.OptionError, "leave one out"),
        ({"stopovers": [(9, 9)], "sinks": [(20, 2), (2, 20)]}, ts.OptionError, "one by one"),
        ({"ground": np.zeros((40, 40))}, ts.ImageError, "above 0"),
        ({"ground": (40, 41)}, ts.ImageError, "one value per pixel"),
    ],
)
def test_bad_input(changes, error, phrase):
    obstacles = np.zeros((40, 40), bool)
    obstacles[:, 30:33] = True
    given = {"ground": (40, 40), "sources": (5, 5), "sinks": (20, 20), "obstacles": obstacles} | changes
    with pytest.raises(error, match=phrase):
        ts.plan_path(**given)
