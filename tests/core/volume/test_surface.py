"""Surfaces: exact small cases, planted ones found again, any topology, and what is refused."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.heat.bricks import along
from toposeam.heat.grid_flow import GridFlow
from toposeam.heat.sweeps import Part
from toposeam.seam.problem import A, B
from toposeam.volume.heat import SurfaceOptions, heat_surface, refine
from toposeam.volume.heat.levels import VolumeLevel, coarsen, refine_filling
from toposeam.volume.problem import face_areas
from toposeam.volume.problem.posing import end_to_end, surface_problem

pytest.importorskip("maxflow")


def noise(shape, seed, smooth=1.0):
    """Two volumes of smooth noise in [0, 1]."""
    rng = np.random.default_rng(seed)
    fields = [ndimage.gaussian_filter(rng.standard_normal(shape), smooth) for _ in range(2)]
    return [((field - field.min()) / np.ptp(field)).astype(np.float32) for field in fields]


def strip(shape):
    a, b = noise(shape, 1)
    return a, b, None, None


def ell(shape):
    a, b = noise(shape, 2)
    on_a = np.zeros(shape, bool)
    on_a[: shape[0] // 2] = on_a[:, : shape[1] // 2] = True
    return a, b, on_a, np.ones(shape, bool)


def ring(shape):
    a, b = noise(shape, 3)
    on_a = np.ones(shape, bool)
    on_a[:, shape[1] // 3 : 2 * shape[1] // 3, shape[2] // 3 : 2 * shape[2] // 3] = False
    on_b = np.zeros(shape, bool)
    on_b[:, 3:-3, 3:-3] = True
    return a, b, on_a, on_b


def islands(shape):
    a, b = noise(shape, 4)
    on_b = np.zeros(shape, bool)
    on_b[3:-3, 3:-3, 3 : shape[2] // 2 - 2] = on_b[3:-3, 3:-3, shape[2] // 2 + 2 : -3] = True
    return a, b, None, on_b


SHAPES = [strip, ell, ring, islands]


@pytest.mark.parametrize("seed", range(6))
def test_small_noise_is_cut_at_the_optimum(seed):
    a, b = np.random.default_rng(seed).random((2, 5, 6, 7))
    surface = ts.find_surface(a, b, tolerance=1e-5)
    assert surface.termination == ts.optimize.Termination.SINGLE_LINE
    assert surface.optimum_ratio() == pytest.approx(1, abs=1e-5)
    assert surface.bound <= surface.cost <= surface.bound * (1 + 2e-5)


@pytest.mark.parametrize("topology", SHAPES)
def test_any_topology_ends_near_the_optimum_and_says_how_near(topology):
    a, b, on_a, on_b = topology((14, 26, 24))
    surface = ts.find_surface(a, b, on_a, on_b)
    assert 1 <= surface.optimum_ratio() + 1e-6 <= 1 + 1e-3 + 1e-6
    assert surface.bound <= surface.cost / surface.optimum_ratio() * (1 + 1e-6)
    side = surface.problem.overlap.side
    assert not surface.shown[side == 0].any()
    assert surface.shown[side == 1].all()


@pytest.mark.medium
@pytest.mark.parametrize("topology", SHAPES)
def test_a_slab_loses_next_to_nothing(topology):
    a, b, on_a, on_b = topology((20, 40, 40))
    surface = ts.find_surface(a, b, on_a, on_b, whole=0)
    assert surface.optimum_ratio() <= 1.005
    assert surface.bound == 0  # nothing is proven of what lies outside


@pytest.mark.medium
def test_a_slab_that_is_too_thin_grows(monkeypatch):
    problem, _ = surface_problem(
        *noise((48, 48, 48), 0, 2.0), None, None, 0, ts.seam.MatchCost(law="gradient")
    )
    best, _ = heat_surface(problem, SurfaceOptions())

    def ratio():
        solution, _ = heat_surface(problem, SurfaceOptions(whole=0))
        return problem.cost(solution.labels) / problem.cost(best.labels)

    monkeypatch.setattr("toposeam.volume.heat.method._SLAB_REACH", 2)
    grown = ratio()
    monkeypatch.setattr("toposeam.volume.heat.method._MAX_GROWTHS", 0)
    assert grown < ratio() - 1e-3
    assert grown < 1 + 1e-3


def test_one_column_is_cut_where_it_is_cheapest():
    a, b = np.zeros((9, 1, 1)), np.array([5, 4, 6, 1, 2, 5, 7, 3, 6]).reshape(9, 1, 1) / 10
    surface = ts.find_surface(a, b, gradient=False)
    assert surface.labels.ravel().tolist() == [False] * 4 + [True] * 5
    assert surface.cost == pytest.approx(0.1 + 0.2 + 1e-3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_surfaces_turn_with_the_volumes(axis):
    a, b = noise((12, 14, 13), 5)
    straight = ts.find_surface(a, b)
    turned = ts.find_surface(np.moveaxis(a, 0, axis), np.moveaxis(b, 0, axis), axis=axis)
    assert turned.cost == pytest.approx(straight.cost, rel=2e-3)
    assert not turned.labels[along(axis, slice(1))].any()
    assert turned.labels[along(axis, slice(-1, None))].all()


def test_volumes_that_change_places_keep_their_surface():
    a, b = noise((12, 14, 13), 6)
    one, other = ts.find_surface(a, b), ts.find_surface(b[::-1], a[::-1])
    assert other.cost == pytest.approx(one.cost, rel=2e-3)


def test_a_planted_tilted_sheet_is_found():
    a, b = noise((30, 24, 24), 7, 0.5)
    z, y, x = np.indices(a.shape)
    sheet = np.round(8 + 0.4 * y + 0.15 * x)
    same = (z >= sheet - 1) & (z <= sheet)
    b[same] = a[same]
    surface = ts.find_surface(a, b, gradient=False)
    assert (surface.labels == (z >= sheet)).mean() > 0.999


def test_channels_and_integers_count_as_floats_do():
    a, b = noise((8, 10, 9), 8)
    gray = ts.find_surface(a, b)
    coarse = [np.rint(volume * 65535).astype(np.uint16) for volume in (a, b)]
    assert ts.find_surface(*coarse).cost == pytest.approx(gray.cost, rel=2e-3)
    rgb = [np.repeat(volume[..., None], 3, -1) for volume in (a, b)]
    first = [np.moveaxis(volume, -1, 0) for volume in rgb]
    assert ts.find_surface(*first, channel_axis=0).cost == pytest.approx(ts.find_surface(*rgb).cost)
    assert ts.find_surface(rgb[0], b).cost == pytest.approx(ts.find_surface(*rgb).cost)


def test_every_voxel_of_a_weight_counts():
    a, b = np.zeros((10, 6, 6)), np.full((10, 6, 6), 0.2)
    weight = np.ones(a.shape)
    weight[4:6] = 0.1
    surface = ts.find_surface(a, b, weight=weight)
    assert surface.labels[5].all()
    assert not surface.labels[4].any()


def test_faces_cost_as_much_as_they_are_large():
    assert np.prod(face_areas((3, 0.5, 2))) == pytest.approx(1)
    a, b = noise((10, 8, 8), 9)
    one = surface_problem(a, b, None, None, 0, ts.seam.MatchCost(law="gradient"))[0].costs
    deep = surface_problem(a, b, None, None, 0, ts.seam.MatchCost(law="gradient"), (8, 1, 1))[0].costs
    for axis, share in enumerate((0.25, 2, 2)):
        np.testing.assert_allclose(deep[axis], share * one[axis], rtol=1e-5)


def test_excluded_voxels_are_not_touched():
    a, b = noise((14, 20, 20), 10)
    free = ts.find_surface(a, b)
    avoid = np.zeros(a.shape, bool)
    avoid[4:9, 5:14, 5:14] = True
    for whole in (10**9, 0):
        surface = ts.find_surface(a, b, avoid=avoid, whole=whole)
        assert surface.labels[avoid].all() or not surface.labels[avoid].any()
        assert surface.cost >= free.cost / 1.001
        assert surface.optimum_ratio() <= 1.003


def test_excluding_a_whole_slice_leaves_no_way():
    a, b = noise((10, 8, 8), 11)
    avoid = np.zeros(a.shape, bool)
    avoid[1:-1] = True
    with pytest.raises(ts.OverlapError, match="leave it a way through"):
        ts.find_surface(a, b, avoid=avoid)


def test_soft_labels_are_shares_and_progress_grows_to_one():
    seen = []
    a, b = noise((16, 24, 24), 12)
    surface = ts.find_surface(a, b, progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1
    assert 0 <= surface.soft.min() < surface.soft.max() <= 1
    assert ((surface.soft > 0.01) & (surface.soft < 0.99)).any()
    assert [record.stage for record in surface.history] == sorted(
        (record.stage for record in surface.history), reverse=True
    )


def test_a_surface_is_one_line_and_a_picture():
    surface = ts.find_surface(*noise((6, 8, 9), 1))
    assert repr(surface).startswith("Surface(6 × 8 × 9 voxels, cost ")
    assert surface._repr_png_().startswith(b"\x89PNG")


def test_the_same_again_is_the_same():
    a, b = noise((12, 20, 20), 13)
    assert (ts.find_surface(a, b).labels == ts.find_surface(a, b).labels).all()


def test_graph_cut_is_the_optimum():
    a, b = noise((10, 12, 12), 14)
    cut = ts.find_surface(a, b, method="graph-cut")
    assert cut.optimum_ratio() == pytest.approx(1, abs=1e-9)
    assert cut.cost <= ts.find_surface(a, b).cost * (1 + 1e-6)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"b": np.zeros((4, 4, 5))}, "one canvas"),
        ({"a": np.zeros((4, 4))}, "pass a non-empty"),
        ({"a": np.full((4, 4, 4), np.nan)}, "NaN"),
        ({"a": np.full((4, 4, 4), 200.0)}, "data_range="),
        ({"a": np.zeros((4, 4, 4), np.int32)}, "data_range="),
        ({"axis": 3}, "choose one of"),
        ({"axis": 1, "mask_a": np.ones((4, 4, 4))}, "leave one or the other out"),
        ({"mask_a": np.ones((4, 4))}, "one value per voxel"),
        ({"weight": np.zeros((4, 4, 4))}, "use avoid"),
        ({"weight": "x"}, "one value per voxel"),
        ({"spacing": (1, 1)}, "three"),
        ({"spacing": (1, 0, 1)}, "spacing is 0"),
        ({"spacing": 2}, "one length per axis"),
        ({"method": "dp"}, "choose one of"),
        ({"method": "graph-cut", "tolerance": 0.1}, "takes no options"),
        ({"cost": ts.seam.MatchCost(law="gradient"), "gradient": True}, "leave gradient out"),
        ({"tolerence": 0.1}, "does not know"),
        ({"channel_axis": 0}, "without channels"),
        ({"a": np.zeros((4, 4, 4, 2)), "b": np.zeros((4, 4, 4, 3))}, "channels"),
    ],
)
def test_bad_input_is_one_sentence(change, text):
    arguments = {"a": np.zeros((4, 4, 4)), "b": np.ones((4, 4, 4)), **change}
    a, b = arguments.pop("a"), arguments.pop("b")
    with pytest.raises(ts.TopoSeamError, match=text):
        ts.find_surface(a, b, **arguments)


@pytest.mark.parametrize(
    ("call", "kind", "parameter", "value"),
    [
        (lambda v: ts.find_surface(v, v, method="graph-cut", tolerance=0.1), "conflict", "tolerance", None),
        (lambda v: ts.find_surface(v[:1], v[:1]), "narrow", None, None),
        (lambda v: ts.loop(v[:3]), "count", "frames", None),
        (lambda v: ts.loop(v, grow=20, length=5), "conflict", "grow", 20),
        (lambda v: ts.loop(v, still=np.ones(v.shape[1:])), "nothing moves", "still", None),
    ],
)
def test_what_has_no_surface_is_told_as_data(call, kind, parameter, value):
    with pytest.raises(ts.TopoSeamError) as raised:
        call(np.random.default_rng(0).random((6, 8, 8)))
    assert (raised.value.kind, raised.value.parameter, raised.value.value) == (kind, parameter, value)


def test_volumes_that_do_not_meet_have_no_surface():
    on_a, on_b = np.zeros((2, 6, 6, 6), bool)
    on_a[:3], on_b[3:] = True, True
    with pytest.raises(ts.OverlapError, match="do not overlap"):
        ts.find_surface(*np.zeros((2, 6, 6, 6)), on_a, on_b)
    with pytest.raises(ts.OverlapError, match="at least 2"):
        ts.find_surface(*np.zeros((2, 1, 6, 6)))


# What the sweeps are made of


def cube(seed, shape):
    rng = np.random.default_rng(seed)
    cost = [
        rng.random([n - (axis == k) for k, n in enumerate(shape)]).astype(np.float32) + np.float32(0.01)
        for axis in range(len(shape))
    ]
    fixed, hot = np.zeros((2, *shape), bool)
    fixed[0] = fixed[-1] = hot[-1] = True
    return cost, fixed, hot


def test_the_bound_holds_after_every_sweep():
    cost, fixed, hot = cube(0, (6, 7, 5))
    flow = GridFlow(cost, fixed, hot)
    bounds, cuts = [], []
    for _ in range(600):
        flow.sweep()
        bounds.append(flow.bound())
        cuts.append(flow.look().cut)
    assert max(bounds) <= min(cuts) * (1 + 1e-6)
    assert max(bounds) >= 0.999 * min(cuts)
    assert flow.look().objective == pytest.approx(min(cuts), rel=1e-2)


@pytest.mark.parametrize("never", ["grid_flow._MOST_AWAKE", "sweeps._MOVED"])  # no copies, or copies of all
@pytest.mark.parametrize("shape", [(9, 11, 8), (1, 17, 20), (12, 9), (30,)])
def test_bricks_do_not_change_what_a_sweep_does(monkeypatch, shape, never):
    cost, fixed, hot = cube(1, shape)
    if len(shape) == 3:
        fixed[3:6, 2:9, 1:7] = True
    monkeypatch.setattr("toposeam.heat.bricks._SIDES", {len(shape): shape})
    whole = GridFlow(cost, fixed, hot)
    monkeypatch.setattr("toposeam.heat.bricks._SIDES", {3: (2, 3, 4), 2: (3, 2), 1: (4,)})
    monkeypatch.setattr("toposeam.heat.sweeps._BLOCK_VOXELS", 60)
    monkeypatch.setattr(f"toposeam.heat.{never}", -1)
    bricks = GridFlow(cost, fixed, hot)
    whole.sweep(60)
    bricks.sweep(60)
    assert np.array_equal(bricks.potential, whole.potential)
    assert all(np.array_equal(*pair) for pair in zip(bricks.filled, whole.filled, strict=True))
    assert bricks.look() == pytest.approx(whole.look())
    assert bricks.bound() == pytest.approx(whole.bound())


def test_bricks_at_rest_are_left_out_and_nothing_is_lost(monkeypatch):
    cost, fixed, hot = cube(4, (16, 24, 24))
    cost[0][8] *= 0.1
    monkeypatch.setattr("toposeam.heat.bricks._SIDES", {3: (2, 4, 4)})
    flow = GridFlow(cost, fixed, hot)
    swept = []

    def give_back(part, everything, really=Part.give_back):
        swept.append(part.sweeps.count)
        really(part, everything)

    monkeypatch.setattr(Part, "give_back", give_back)
    flow.sweep(600)
    assert min(swept) < 0.3 * flow._all.count
    # The cheapest cut of all, by the flow of all bricks.
    assert flow.bound() >= 0.999 * flow.look().cut
    every = GridFlow(cost, fixed, hot)
    monkeypatch.setattr("toposeam.heat.grid_flow._MOST_AWAKE", -1)
    every.sweep(600)
    assert flow.look().cut == pytest.approx(every.look().cut, rel=1e-4)


@pytest.mark.parametrize("awake", [4, 5])
def test_four_fifths_of_the_bricks_are_swept_alone(monkeypatch, awake):
    """Five bricks that nothing joins; in one that is not awake heat hardly moves."""
    monkeypatch.setattr("toposeam.heat.bricks._SIDES", {1: (4,)})
    cost = np.ones(19, np.float32)
    cost[2::4] = cost[3::4] = 0
    start = np.random.default_rng(0).random((5, 4))
    start[awake:] = [0.5, 0.5 + 8e-7, 0.5, 0.5]
    once, often = (
        GridFlow([cost], *np.zeros((2, 20), bool), start.astype(np.float32).ravel()) for _ in range(2)
    )
    once.sweep(1)
    often.sweep(24)
    moved = (once.potential != often.potential).reshape(5, 4).any(axis=1)
    assert moved.tolist() == [k < awake for k in range(5)]


def test_bricks_swept_alone_receive_flow_of_resting_ones(monkeypatch):
    monkeypatch.setattr("toposeam.heat.bricks._SIDES", {3: (2, 4, 4)})
    monkeypatch.setattr("toposeam.heat.grid_flow._MOST_AWAKE", -1)
    cost, fixed, hot = cube(5, (8, 16, 16))
    cost[0][3] *= 0.01
    flow = GridFlow(cost, fixed, hot)
    flow.sweep(2000)
    flow.look()
    flow.sweep(10)
    assert flow.look().change < 1e-6  # everything rests
    before, flows = flow.potential, flow.filled
    part = Part(flow._all, np.arange(len(flow._bricks)) % 3 == 0)
    for _ in range(5):
        part.sweeps.sweep()
    part.give_back(flow._all)
    np.testing.assert_allclose(flow.potential, before, atol=1e-5)
    for one, other in zip(flow.filled, flows, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-5)


def test_heat_awakes_the_brick_that_it_reaches_next():
    shape = (8, 8, 24)
    cost = [np.ones([n - (axis == k) for k, n in enumerate(shape)], np.float32) for axis in range(3)]
    fixed, hot = np.zeros((2, *shape), bool)
    fixed[..., 0] = fixed[..., -1] = hot[..., 0] = True
    flow = GridFlow(cost, fixed, hot, np.zeros(shape, np.float32))
    awake = []
    for _ in range(8):
        flow._all.sweep()
        awake.append(int(np.count_nonzero(flow._all.awake())))
    # After sweep k the heat is at place k.
    assert awake == [1] * 6 + [2] * 2


def test_on_a_plane_the_sweeps_find_the_best_seam():
    a, b = np.random.default_rng(2).random((2, 12, 9))
    seam = ts.find_seam(a, b, method="shortest-path")
    problem = seam.problem
    side = problem.overlap.side
    flow = GridFlow([problem.down, problem.right], side < 2, side == 1)
    flow.sweep(1500)
    assert flow.look().cut == pytest.approx(seam.cost, rel=1e-4)


def test_voxel_blocks_are_joined_by_the_sum_of_their_interfaces():
    cost, fixed, hot = cube(3, (18, 17, 16))
    level = coarsen(VolumeLevel(tuple(cost), fixed, hot, (1, 1, 1)))
    assert level.span == (2, 2, 2)
    assert level.fixed.shape == (9, 9, 8)
    assert level.cost[0][3, 2, 1] == pytest.approx(cost[0][7, 4:6, 2:4].sum())
    assert level.cost[1][2, 7, 5] == pytest.approx(cost[1][4:6, 15, 10:12].sum())
    assert level.fixed[0].all()
    assert level.hot[-1].all()
    assert coarsen(VolumeLevel(level.cost, level.fixed, level.hot, (2, 2, 2))) is None


def test_what_blocks_found_spreads_to_their_voxels():
    values = np.arange(6, dtype=np.float32).reshape(3, 2)
    fine = refine(values, (2, 1), (5, 2))
    assert fine.tolist() == [[0, 1], [0, 1], [2, 3], [2, 3], [4, 5]]
    filled = [np.array([[0.2, 0.4], [0.6, 0.8]], np.float32)]
    along_rows = refine_filling(filled, (2, 1), (5, 2))[0]
    np.testing.assert_allclose(along_rows[:, 0], [0.2, 0.2, 0.4, 0.6])


def test_only_three_axes_have_two_ends():
    with pytest.raises(ts.OptionError, match="choose one of"):
        end_to_end((4, 4, 4), 3)
    overlap = end_to_end((4, 2, 3), 1)
    assert overlap.side.ravel().tolist() == ([A] * 3 + [B] * 3) * 4
