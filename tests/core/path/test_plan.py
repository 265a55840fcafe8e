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
    samples = np.concatenate(
        [a + (b - a) * share for a, b in zip(path.points[:-1], path.points[1:], strict=True)]
    )
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


@pytest.mark.medium
@pytest.mark.parametrize("seed", range(4))
def test_terrain_costs_no_more_than_the_grid_s_shortest_way(seed):
    rng = np.random.default_rng(seed)
    height = ndimage.gaussian_filter(rng.random((56, 64)), 5)
    cost = 1 + 6 * (height - height.min()) / np.ptp(height)
    cost[20:26, 20:50] = np.inf
    found = ts.plan_path(cost, (5, 5), (58, 50))
    assert np.isfinite(found.cost)
    assert found.cost <= 1.01 * dijkstra_cost(cost, (5, 5), (58, 50))


@pytest.mark.medium
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


def test_no_way_squeezes_between_obstacles_that_touch_at_a_corner():
    wall = np.zeros((24, 24), bool)
    wall[:12, 12], wall[12:, 13] = True, True  # a wall with a corner, no gap
    wall[23, 13] = False
    found = ts.plan_path((24, 24), (4, 10), (20, 10), obstacles=wall)
    assert found.paths[0].points[:, 1].max() > 22  # through the opening below, not through the corner
    wall[23, 13] = True
    with pytest.raises(ts.PathError, match="part the point"):
        ts.plan_path((24, 24), (4, 10), (20, 10), obstacles=wall)


def test_heat_conducts_by_one_over_the_square_of_the_cost():
    """Two lanes between the same ends; the dearer one is taken once the other is longer by more than its
    price. With conductivities 1/cost, not its square, the straight lane of cost 2 would be taken too.
    """
    cost = np.full((31, 41), np.inf)
    cost[15, 1:40] = 2.0  # straight: 38 steps of 2
    cost[1, 1:40] = cost[1:16, 1] = cost[1:16, 39] = 1.0  # round: 66 steps of 1
    assert ts.plan_path(cost, (1, 15), (39, 15)).paths[0].points[:, 1].min() < 3
    cost[15, 2:39] = 1.5  # now 57
    assert ts.plan_path(cost, (1, 15), (39, 15)).paths[0].points[:, 1].min() > 15


def test_a_way_that_is_not_drawn_taut_goes_from_pixel_to_pixel():
    found = ts.plan_path((40, 60), (4, 5), (52, 30), taut=False)
    steps = np.abs(np.diff(found.paths[0].points, axis=0))
    assert steps.max() == 1.0
    taut = ts.plan_path((40, 60), (4, 5), (52, 30))
    assert len(taut.paths[0].points) < len(found.paths[0].points) / 2
    assert taut.length < found.length


def test_results_show_themselves():
    found = ts.plan_path((20, 30), [(2, 2), (2, 17)], (27, 10))
    assert repr(found).startswith("PlannedPath(2 ways of ")
    assert "\n" not in repr(found)
    drawn = ts.read_svg(found.to_svg())
    assert (drawn.width, drawn.height) == (30, 20)
    assert [line.points.tolist() for line in drawn.polylines] == [
        line.points.tolist() for line in found.paths
    ]
    assert found._repr_svg_() == found.to_svg()


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
    assert [found.history[0].penalty, found.history[-1].penalty] == [1.0, options.penalty]
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
        ({"gather": 1.5}, ts.OptionError, "gather"),
        ({"p": 3}, ts.OptionError, "does not know p"),
        ({"options": ts.PathOptions(), "penalty": 2}, ts.OptionError, "beside options"),
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
