"""Planned ways against the shortest ways that are known or that Dijkstra finds."""

from itertools import combinations, pairwise

import numpy as np
import pytest
from scipy import ndimage
from skimage.graph import MCP_Geometric

import toposeam as ts
from toposeam.heat.plate import Plate
from toposeam.path import levels
from toposeam.path.trace import cost_along, pull_taut, trace


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


def test_no_path_passes_between_obstacles_touching_at_a_corner():
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
    drawn = ts.vector.read_svg(found.to_svg())
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
    options = ts.path.PathOptions()
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


# Large grounds, led over from coarse to fine.


@pytest.mark.medium
def test_a_large_even_ground_gives_the_straight_line():
    found = ts.plan_path((210, 300), (9, 12), (280, 190))
    assert found.length == pytest.approx(np.hypot(271, 178), rel=1e-3)
    assert [record.cell_px for record in found.history][:: len(found.history) - 1] == [2, 1]
    assert found.density.shape == (210, 300)
    assert found.density[20, 280] == 0


@pytest.mark.medium
def test_a_large_terrain_costs_no_more_than_led_over_as_a_whole(monkeypatch):
    rng = np.random.default_rng(5)
    height = ndimage.gaussian_filter(rng.random((170, 190)), 7)
    cost = 1 + 6 * (height - height.min()) / np.ptp(height)
    cost[60:70, 40:] = np.inf
    found = ts.plan_path(cost, (150, 8), (170, 160))
    monkeypatch.setattr(levels, "WHOLE_PX", cost.size)
    whole = ts.plan_path(cost, (150, 8), (170, 160))
    assert {record.cell_px for record in whole.history} == {1}
    assert found.cost <= 1.01 * whole.cost
    assert found.cost <= dijkstra_cost(cost, (150, 8), (170, 160))


def test_reduced_ground_is_a_geometric_mean_and_keeps_obstacles():
    cost = np.array([[1.0, 4.0, 2.0], [16.0, 1.0, np.inf], [3.0, 3.0, 5.0]])
    np.testing.assert_allclose(levels.reduce_ground(cost, 2, []), [[8**0.5, np.inf], [3.0, 5.0]])
    # Where a way leads the obstacle is left out.
    assert levels.reduce_ground(cost, 2, [np.array([[0, 2]])])[0, 1] == pytest.approx(2.0)


def test_a_finer_ground_is_open_beside_the_ways_only():
    ground = levels._strip_along([np.array([[10, 12]])], np.ones((9, 11)), 2, 2)
    assert np.isfinite(ground).sum() == 25
    assert np.isfinite(ground[3:8, 4:9]).all()


@pytest.mark.medium
def test_a_gap_that_the_reduced_ground_does_not_have_is_found():
    wall = np.zeros((400, 420), bool)
    wall[:380, 200:203] = True
    wall[151, :] = False  # one pixel wide; the other way round is twice as long
    found = ts.plan_path(wall.shape, (100, 150), (300, 150), obstacles=wall)
    assert found.length < 201
    assert found.history[0].cell_px == 3


@pytest.mark.medium
def test_a_large_ground_in_pieces_leads_no_heat_where_none_gets():
    rng = np.random.default_rng(0)
    blocks = rng.random((60, 80)) < 0.62  # many pieces, many corners that touch
    ground = np.kron(np.where(blocks, 1.0, np.inf), np.ones((4, 4)))
    pieces, _ = ndimage.label(np.isfinite(ground))
    largest = np.argwhere(pieces == np.bincount(pieces[pieces > 0]).argmax())
    start, end = largest[0][::-1], largest[-1][::-1]
    found = ts.plan_path(ground, start, end)
    (line,) = trace(1 / ground, ground, [tuple(largest[0])], [tuple(largest[-1])])
    assert found.cost <= cost_along(line, ground)
    assert found.density[np.isfinite(ground) & (pieces != pieces[tuple(largest[0])])].max() == 0


def test_on_a_large_ground_a_sink_may_be_one_that_nobody_takes():
    found = ts.plan_path((180, 190), (20, 0), [(30, 5), (170, 160), (0, 0)])
    assert found.length == pytest.approx(np.hypot(10, 5))
    assert found.density[160, 170] == 0


@pytest.mark.slow
def test_on_a_large_ground_ends_may_be_near_and_many():
    near = ts.plan_path((260, 260), (50, 50), (51, 50))
    assert near.length == 1.0
    found = ts.plan_path((200, 260), [(5, 5), (5, 190), (250, 5)], [(130, 100), (10, 100)])
    assert [tuple(path.points[-1]) for path in found.paths] == [(10.5, 100.5)] * 2 + [(130.5, 100.5)]
    shares = []
    stops = ts.plan_path((200, 260), (5, 5), (250, 190), stopovers=[(250, 5)], progress=shares.append)
    assert stops.length == pytest.approx(245 + 185, rel=0.01)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.medium
def test_walls_that_multigrid_does_not_get_round_are_eliminated(monkeypatch):
    ground = np.ones((96, 120))
    for number in range(1, 12):
        ground[8 * number : 8 * number + 2] = np.inf
        gap = 100 if number % 2 else 10
        ground[8 * number : 8 * number + 2, gap : gap + 3] = 1
    solved = []
    solve = Plate.solve
    monkeypatch.setattr(Plate, "solve", lambda self, *given: solved.append(1) or solve(self, *given))
    found = ts.plan_path(ground, (60, 2), (60, 94))
    assert len(solved) < 10
    assert found.cost <= dijkstra_cost(ground, (60, 2), (60, 94))


@pytest.mark.medium
def test_a_long_line_is_drawn_taut_between_some_of_its_points():
    steps = np.repeat([[[3, 0], [0, 3]]], 90, axis=0).reshape(-1, 2)
    line = np.repeat(np.sign(steps), 3, axis=0).cumsum(axis=0) + 0.5  # 540 points of a stair
    cost = np.ones((272, 272))
    assert cost_along(pull_taut(line, cost), cost) == pytest.approx(np.hypot(*(line[-1] - line[0])))
    cost[:] = np.inf
    cost[line[:, 1].astype(int), line[:, 0].astype(int)] = 1  # the stair is all there is
    assert np.isfinite(cost_along(pull_taut(line, cost), cost))
    assert cost_along(pull_taut(line, cost), cost) <= cost_along(line, cost)
    even = ts.plan_path((2, 60_000), (3, 0), (59_000, 1))
    assert even.length == pytest.approx(58_997, abs=1)


# The cost of a line, and the line drawn taut.


LINES = {
    "up to the right": [(0.3, 4.6), (6.7, 0.2)],
    "back and forth": [(6.1, 1.2), (1.9, 4.4), (1.9, 0.5), (6.6, 0.5)],
    "along a border": [(7.0, 0.4), (7.0, 5.0), (0.0, 5.0)],
    "along a side of pixels": [(2.0, 0.5), (2.0, 4.5)],
    "in one pixel": [(3.2, 2.9), (3.9, 2.1)],
}


@pytest.mark.parametrize("line", LINES.values(), ids=LINES.keys())
def test_the_cost_of_a_line_is_what_its_samples_pay(line):
    cost = np.random.default_rng(3).uniform(1, 9, (5, 7))
    share = (np.arange(20_000) + 0.5)[:, None] / 20_000
    wanted = 0.0
    for start, end in pairwise(np.array(line)):
        x, y = np.minimum(np.floor(start + share * (end - start)).astype(int), (6, 4)).T
        wanted += np.hypot(*(end - start)) * cost[y, x].mean()
    assert ts.path.path_cost(ts.vector.Polyline(line), cost) == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize("line", [[(3, 0), (5, 2)], [(5, 2), (3, 0)], [(5, 0), (3, 2)], [(3, 2), (5, 0)]])
def test_a_line_through_a_corner_needs_one_free_side(line):
    rising = (line[1][0] - line[0][0]) * (line[1][1] - line[0][1]) < 0
    beside = [(0, 3), (1, 4)] if rising else [(0, 4), (1, 3)]
    cost = np.ones((4, 6))
    for pixel in beside:
        cost[pixel] = np.inf
        wanted = np.inf if pixel == beside[1] else np.hypot(2, 2)
        assert ts.path.path_cost(ts.vector.Polyline(line), cost) == pytest.approx(wanted)
    cost[beside[0]] = 1.0
    assert ts.path.path_cost(ts.vector.Polyline(line), cost) == pytest.approx(np.hypot(2, 2))


def test_a_traced_way_resists_least():
    rng = np.random.default_rng(8)
    density = rng.random((8, 11))
    resistance = 1 / (density + 1e-3)
    sources, sinks = [(0, 0), (7, 1), (2, 9)], [(6, 10), (1, 5)]
    reached, _ = MCP_Geometric(resistance).find_costs(sinks)
    for source, line in zip(sources, trace(density, np.ones((8, 11)), sources, sinks), strict=True):
        assert tuple(line[0, ::-1] - 0.5) == source
        assert tuple(line[-1, ::-1] - 0.5) in sinks
        columns, rows = (line - 0.5).astype(int).T
        along = resistance[rows, columns]
        paid = (np.hypot(*np.diff(line, axis=0).T) * (along[1:] + along[:-1]) / 2).sum()
        assert paid == pytest.approx(reached[source])


@pytest.mark.parametrize("seed", range(3))
def test_of_all_ways_to_leave_points_out_the_cheapest_is_drawn(seed):
    cost = np.random.default_rng(seed).uniform(1, 4, (6, 7))
    line = np.array([(0, 0), (1, 0), (2, 1), (2, 2), (3, 3), (4, 3), (5, 4), (5, 5)]) + 0.5
    kept = [(0, *inner, 7) for count in range(7) for inner in combinations(range(1, 7), count)]
    least = min(cost_along(line[list(some)], cost) for some in kept)
    assert cost_along(pull_taut(line, cost), cost) == pytest.approx(least)


def test_costs_of_several_ways_add_up():
    ground = 1 + np.arange(18 * 24).reshape(18, 24) % 7 / 3
    found = ts.plan_path(ground, [(2, 3), (3, 15)], (21, 8), gather=5, sharpen=2)
    assert found.costs == pytest.approx([ts.path.path_cost(path, ground) for path in found.paths])
    assert found.cost == pytest.approx(sum(found.costs))
    assert found.length == pytest.approx(found.paths[0].length + found.paths[1].length)


def test_every_source_has_a_stroke_and_the_penalty_grows():
    wall = np.zeros((12, 20), bool)
    wall[:6, 9] = True
    found = ts.plan_path(
        wall.shape, [(2, 3), (16, 2)], [(3, 10), (17, 9)], obstacles=wall, gather=4, sharpen=6, stroke_px=1.5
    )
    least = 1.5 * (np.hypot(1, 7) + np.hypot(1, 7))
    assert [record.bound for record in found.history] == pytest.approx(
        [max((12 * 20 - 6) / n**2, least) for n in range(1, 11)]
    )
    penalties = [record.penalty for record in found.history]
    assert penalties[:4] == [1, 1, 1, 1]
    assert np.diff(penalties[3:8]) == pytest.approx(0.5)
    assert penalties[7:] == [3, 3, 3]
    assert {record.leg for record in found.history} == {1}
    alone = ts.plan_path((12, 20), (2, 3), (17, 9), gather=3, sharpen=0)
    assert [record.penalty for record in alone.history] == [1, 1, 1]


def test_ends_may_lie_anywhere_on_the_ground():
    found = ts.plan_path((9, 10), (0, 0), (9.99, 8.99), gather=3, sharpen=0)
    assert found.paths[0].points[[0, -1]].tolist() == [[0.5, 0.5], [9.5, 8.5]]
    for point in ((10, 3), (3, 9), (-0.01, 3), (3, -0.01)):
        with pytest.raises(ts.OptionError, match="outside the ground of 10 × 9"):
            ts.plan_path((9, 10), (0, 0), point)


def test_grounds_have_two_rows_and_four_megapixels_at_most():
    line = ts.vector.Polyline([[0.5, 0.5], [1.5, 0.5]])
    assert ts.path.path_cost(line, np.full((2, 2), 3.0)) == 3.0
    assert ts.path.path_cost(line, (2000, 2000)) == 1.0
    with pytest.raises(ts.OptionError, match="2001 × 2000 px is too large"):
        ts.path.path_cost(line, (2000, 2001))
    for shape in ((1, 5), (5, 1), (2, 2, 2)):
        with pytest.raises(ts.ImageError, match="at least 2 × 2"):
            ts.path.path_cost(line, np.ones(shape))


@pytest.mark.parametrize(
    ("changes", "error", "phrase"),
    [
        ({"sources": (60, 5)}, ts.OptionError, "outside the ground"),
        ({"sinks": (30, 10)}, ts.OptionError, "on an obstacle"),
        ({"sinks": (5, 5)}, ts.OptionError, "same pixel"),
        ({"sinks": []}, ts.OptionError, "no sink"),
        ({"gather": 1.5}, ts.OptionError, "gather"),
        ({"p": 3}, ts.OptionError, "does not know p"),
        ({"options": ts.path.PathOptions(), "penalty": 2}, ts.OptionError, "beside options"),
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


@pytest.mark.parametrize(
    ("changes", "kind", "parameter", "value"),
    [
        ({"sources": (60, 5)}, "outside", "sources", (60, 5)),
        ({"sinks": (30, 10)}, "on obstacle", "sinks", (30, 10)),
        ({"sinks": []}, "count", "sinks", None),
        ({"stopovers": [(5, 5)]}, "same place", "stopovers", [(5, 5)]),
        ({"sinks": "{here}"}, "type", "sinks", "{here}"),
        ({"ground": (40, 41)}, "shape", "obstacles", None),
        ({"sources": (35, 30)}, "no way", None, None),
    ],
)
def test_what_leads_nowhere_is_told_as_data(changes, kind, parameter, value):
    obstacles = np.zeros((40, 40), bool)
    obstacles[:, 30:33] = True
    given = {"ground": (40, 40), "sources": (5, 5), "sinks": (20, 20), "obstacles": obstacles} | changes
    with pytest.raises(ts.TopoSeamError) as raised:
        ts.plan_path(**given)
    assert (raised.value.kind, raised.value.parameter, raised.value.value) == (kind, parameter, value)
