"""What is allowed where, what a move costs, and what a reduced problem says."""

import dataclasses
import math
import pickle

import numpy as np
import pytest
from skimage import data

import toposeam as ts
from toposeam.layers.canvas import Box, extent_of
from toposeam.layers.canvas import tile_map as maps
from toposeam.layers.labelling import Labelling, TableCost, meets, pair_cost, pose_labelling
from toposeam.layers.search import SearchOptions
from toposeam.layers.search import cost_coarsening as reduction
from toposeam.layers.search.local_search import beside_seams
from toposeam.seam.problem import STEP, Reach


def posed(layers, **options):
    return pose_labelling(extent_of(layers), **options)


def reduced(labelling, wandering=0.6):
    """The problem at half the size, the costs of small overlaps kept."""
    tables = reduction.Tables(labelling.costs, 1, None, wandering)
    return tables.kept([reduction.halved(labelling, wandering)])[0]


def row_of_four(costs):
    """Three layers on one row of four pixels: only the first, any, any, only the third; `costs` by pair."""
    canvas = Box(0, 0, 1, 4)
    allowed = [np.array([row], bool) for row in ([1, 1, 1, 0], [0, 1, 1, 0], [0, 1, 1, 1])]
    tables = {}
    for pair, cost in costs.items():
        right, down = np.zeros((3, 5), np.float32), np.zeros((2, 6), np.float32)
        right[1, 1:4] = cost
        tables[pair] = TableCost(canvas.grown(1), right, down)
    return Labelling(canvas, [canvas] * 3, allowed, tables)


def flat(shape, at, value=0.5, **more):
    return ts.Layer(np.full(shape, value), at=at, name=str(at), **more)


def may_show(layers, x, y, **options):
    """Which layers are to be chosen from at a pixel of the canvas, whose first layer lies at its origin."""
    labelling = posed(layers, **options)
    box = Box(y, x, y + 1, x + 1)
    return {layer.name for k, layer in enumerate(layers) if labelling.allowed_in(k, box).any()}


def three_with_holes(keep=None):
    """Three layers none of which lies in others, and where each of them has pixels on the canvas."""
    rng, layers, covers = np.random.default_rng(6), [], []
    for k, (at, (height, width)) in enumerate((((-2, 1), (13, 17)), ((6, -3), (14, 15)), ((3, 7), (11, 22)))):
        alpha = np.where(rng.random((height, width)) < 0.08, 0.0, 1.0)
        kept = None if keep is None else keep[k][: height * width].reshape(height, width)
        layers.append(ts.Layer(rng.random((height, width)), at=at, alpha=alpha, keep=kept, name=str(k)))
        covers.append(np.zeros((21, 27), bool))
        covers[k][at[1] + 3 : at[1] + 3 + height, at[0] + 2 : at[0] + 2 + width] = alpha > 0
    return layers, np.array(covers)


def test_layers_show_at_their_ends_only_where_all_end():
    layers, covers = three_with_holes()
    ground, away = np.pad(covers.any(axis=0), 1), covers.copy()
    for k, y, x in np.argwhere(covers):
        beside = ((y + 1, x), (y - 1, x), (y, x + 1), (y, x - 1))
        around = np.pad(covers[k], 1)
        away[k, y, x] = not any(ground[v + 1, u + 1] and not around[v + 1, u + 1] for v, u in beside)
    expected = np.where(away.any(axis=0), away, covers)
    labelling = posed(layers)
    found = np.array([labelling.allowed_in(k, labelling.canvas) for k in range(3)])
    np.testing.assert_array_equal(found, expected)
    assert (covers & ~away & expected).any()
    assert set(labelling.costs) == {(0, 1), (0, 2), (1, 2)}
    for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
        own = labelling.costs[i, j].shared(labelling.canvas)
        np.testing.assert_array_equal(own, covers[i] & covers[j], err_msg=str(k))
        assert meets(labelling.places, [layer.covered for layer in layers], i, j)


def test_what_a_layer_keeps_no_other_one_may_show():
    keep = np.random.default_rng(7).random((3, 300)) < 0.25
    layers, covers = three_with_holes(keep)
    canvas = extent_of(layers)
    kept = np.zeros(covers.shape, bool)
    for k, layer in enumerate(layers):
        kept[k][canvas.place(layer).slices] = layer.keep
        kept[k] &= covers[k] & ~kept[:k].any(axis=0)
        layers[k] = dataclasses.replace(layer, keep=kept[k][canvas.place(layer).slices])
    places = [canvas.place(layer) for layer in layers]
    for k, found in enumerate(extent_of(layers).covers):
        others = np.delete(kept, k, 0).any(axis=0)
        np.testing.assert_array_equal(found, (covers[k] & ~others)[places[k].slices])
    both = dataclasses.replace(layers[2], keep=layers[2].covered)
    count = np.count_nonzero((kept[0] | kept[1]) & covers[2])
    with pytest.raises(ts.OptionError, match=f"1 and 2 are both to be kept at {count} pixels"):
        extent_of([*layers[:2], both]).covers  # noqa: B018


@pytest.mark.parametrize("gap", [-1, 0, 1])
def test_layers_meet_where_they_share_a_pixel(gap):
    alpha = np.ones((9, 12))
    alpha[:, 11], alpha[0, 11] = 0, 1  # one pixel of its last column
    first, second = flat((9, 12), (0, 0), alpha=alpha), flat((5, 7), (11 + gap, -4))
    canvas = extent_of([first, second])
    places, covers = [canvas.place(first), canvas.place(second)], [first.covered, second.covered]
    assert meets(places, covers, 0, 1) == (gap <= 0)
    assert set(posed([first, second]).costs) == ({(0, 1)} if gap <= 0 else set())


def test_of_equal_cores_the_later_layer_s_counts():
    layers = [ts.Layer(np.full((30, 40), value), at=(3, 3), name=str(value)) for value in (0.2, 0.4, 0.6)]
    allowed = posed(layers).allowed
    assert [bool(mask[15, 20]) for mask in allowed] == [False, False, True]
    assert [bool(mask[1, 1]) for mask in allowed] == [True, True, True]
    assert [bool(mask[15, 20]) for mask in posed(layers[::-1]).allowed] == [False, False, True]


@pytest.mark.parametrize("order", [(0, 1, 2), (0, 2, 1)])
def test_layers_may_show_where_their_cores_meet_in_any_order(order):
    layers = [flat((60, 120), (0, 0)), flat((40, 60), (10, 10)), flat((40, 60), (30, 10))]
    layers = [layers[k] for k in order]
    assert may_show(layers, 22, 30) == {"(10, 10)"}
    assert may_show(layers, 50, 30) == {"(10, 10)", "(30, 10)"}
    assert may_show(layers, 78, 30) == {"(30, 10)"}
    assert may_show(layers, 50, 13) == {"(0, 0)", "(10, 10)", "(30, 10)"}


@pytest.mark.parametrize("order", [(0, 1, 2), (0, 2, 1)])
def test_a_core_between_two_pieces_of_a_layer_is_outside_of_it(order):
    alpha = np.zeros((30, 90))
    alpha[:, :30] = alpha[:, 60:] = 1
    layers = [flat((100, 200), (0, 0)), flat((30, 90), (40, 40), alpha=alpha), flat((20, 40), (45, 45))]
    layers = [layers[k] for k in order]
    assert may_show(layers, 55, 55) == {"(40, 40)", "(45, 45)"}
    assert may_show(layers, 70, 55) == {"(45, 45)"}


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (0, 3, 2, 1)])
def test_a_core_that_lies_in_another_has_its_place_alone(order):
    alpha = np.zeros((30, 90))
    alpha[:, :30] = alpha[:, 60:] = 1  # two pieces, of which one lies in another layer's core
    layers = [flat((100, 200), (0, 0)), flat((90, 90), (5, 5)), flat((30, 90), (40, 40), alpha=alpha)]
    layers = [[*layers, flat((10, 10), (50, 50))][k] for k in order]
    assert may_show(layers, 55, 55) == {"(50, 50)"}
    assert may_show(layers, 48, 55) == {"(40, 40)"}
    assert may_show(layers, 115, 55) == {"(40, 40)"}
    assert may_show(layers, 35, 55) == {"(5, 5)"}


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0)])
def test_a_layer_covered_by_several_keeps_a_core_on_request(order):
    halves = [flat((60, 100), (0, 0)), flat((60, 100), (80, 0))]
    layers = [[*halves, flat((30, 60), (60, 15))][k] for k in order]
    assert may_show(layers, 90, 30) == {"(0, 0)", "(80, 0)", "(60, 15)"}
    assert may_show(layers, 90, 30, core=0.5) == {"(60, 15)"}
    assert may_show(layers, 90, 21) == may_show(layers, 90, 21, core=0.5)  # outside of its core
    assert may_show(layers, 90, 21, core=0.8) == {"(60, 15)"}
    layers = [[*halves, flat((30, 60), (110, 15))][k] for k in order]
    assert may_show(layers, 140, 30) == {"(110, 15)"}


def test_each_piece_of_a_layer_is_tested_for_containment():
    alpha = np.zeros((30, 160))
    alpha[:, :40] = alpha[:, 60:100] = 1  # in the first one, and in both together
    halves = [flat((60, 100), (0, 0)), flat((60, 100), (80, 0))]
    layers = [*halves, flat((30, 160), (10, 15), alpha=alpha)]
    assert may_show(layers, 30, 30) == {"(10, 15)"}
    assert may_show(layers, 90, 30) == {"(0, 0)", "(80, 0)", "(10, 15)"}
    hole = np.ones((60, 100))
    hole[:5, :5] = 0  # outside of the piece
    assert may_show([flat((60, 100), (0, 0), alpha=hole), *layers[1:]], 30, 30) == {"(10, 15)"}
    hole[20, 20] = 0  # inside of it
    layers = [flat((60, 100), (0, 0), alpha=hole), *layers[1:]]
    assert may_show(layers, 30, 30) == {"(0, 0)", "(10, 15)"}


def test_cores_of_large_layers_are_those_of_small_ones(monkeypatch):
    shapes = ((60, 120), (0, 0)), ((40, 60), (10, 10)), ((40, 60), (30, 10)), ((10, 14), (40, 22))
    layers = [flat(*shape) for shape in shapes]
    small = posed(layers).allowed
    for name, value in {"DENSE_PIXELS": 100, "TILE": 16}.items():
        monkeypatch.setattr(maps, name, value)
    for one, other in zip(small, posed(layers).allowed, strict=True):
        assert isinstance(other, maps.TileMap)
        np.testing.assert_array_equal(one, maps.dense(other))


def test_a_layer_that_reaches_out_by_one_pixel_keeps_no_core():
    large = ts.Layer(np.full((20, 20), 0.2))
    alpha = np.ones((10, 10))
    alpha[:, 6:] = 0
    inside = ts.Layer(np.full((10, 10), 0.4), at=(14, 5), alpha=alpha)
    assert not posed([large, inside]).allowed[0][10, 16]  # its core, where no other layer may show
    alpha = alpha.copy()
    alpha[4, 6] = 1
    reaching = ts.Layer(np.full((10, 10), 0.4), at=(14, 5), alpha=alpha)
    assert posed([large, reaching]).allowed[0][10, 16]


@pytest.mark.parametrize(("reach", "chosen"), [(0, [0, 0, 1, 1]), (1, [0, 1, 1, 1]), (2, [1, 1, 1, 1])])
def test_pixels_beside_seams_are_opened(reach, chosen):
    assert beside_seams(np.array([[0, 0, 0, 2]], np.int16), reach).tolist() == [list(map(bool, chosen))]


def test_costs_of_a_band_are_those_of_the_whole(monkeypatch):
    photograph = data.coffee()[:90, :120]
    layers = [ts.Layer(photograph[:, :80].copy()), ts.Layer(photograph[:, 30:].copy() // 2, at=(30, 4))]
    cost = posed(layers).costs[0, 1]
    whole = cost.on(cost.box)
    monkeypatch.setattr(pair_cost, "KEPT_PIXELS", 0)
    cost = posed(layers).costs[0, 1]
    np.testing.assert_array_equal(cost.on(cost.box)[0], whole[0])
    box = Box(10, 40, 70, 75)
    beside = np.zeros(box.shape, bool)
    beside[np.arange(60), np.arange(60) // 2 + 2] = True
    part = box.within(cost.box)
    for axis, (banded, full) in enumerate(zip(cost.on(box, beside), whole, strict=True)):
        expected = full[part[0].start :, part[1].start :][: banded.shape[0], : banded.shape[1]]
        near = beside[:, :-1] | beside[:, 1:] if axis == 0 else beside[:-1] | beside[1:]
        np.testing.assert_array_equal(banded[near], expected[near])


class Sparse(ts.Windows):
    """Pixels of an array, and how many were looked at."""

    def __init__(self, values):
        super().__init__(values.shape, values.dtype)
        self.values, self.seen = values, 0

    def read(self, rows, columns):
        part = self.values[rows, columns].copy()
        self.seen += part[..., 0].size
        return part


@pytest.mark.parametrize("at", [(31, 4), (40, -7), (35, 0), (0, 21)])
def test_reach_is_computed_from_every_second_row_and_column(at):
    photograph = data.coffee()[:150, :160]
    first, second = photograph[:90, :80], photograph[50:140, 50:130] // 2
    images = [Sparse(first.copy()), Sparse(second.copy())]
    cost = posed([ts.Layer(images[0]), ts.Layer(images[1], at=at)]).costs[0, 1]
    for image in images:
        image.seen = 0
    found = cost._computed_reach(16.0)
    canvas = extent_of([ts.Layer(first), ts.Layer(second, at=at)])
    colours, both = [], True
    for pixels, place in zip((first, second), cost._pictures.places, strict=True):
        whole = np.zeros((*canvas.shape, 3), np.float32)
        whole[place.slices] = pixels / np.float32(255)
        here = np.zeros(canvas.shape, bool)
        here[place.slices] = True
        colours.append(np.pad(whole, [(1, 1), (1, 1), (0, 0)])[cost.box.moved(1, 1).slices])
        both = both & np.pad(here, 1)[cost.box.moved(1, 1).slices]
    difference = np.where(both[..., np.newaxis], colours[0] - colours[1], np.float32(0))
    expected = Reach(
        both.shape, [(0, difference[::STEP, ::STEP], both[::STEP, ::STEP], ~both[::STEP, ::STEP])], 16.0
    )
    np.testing.assert_allclose(found._values, expected._values, atol=1e-6)
    assert max(image.seen for image in images) <= np.prod([side // STEP + 1 for side in cost.box.shape])


def test_costs_of_layers_on_their_side_are_the_same():
    """Large overlaps are looked at some rows at a time, and those of one are the columns of the other."""
    a, b = np.random.default_rng(3).random((2, 300, 300), np.float32)
    found = []
    for one, other, at in ((a, b, (20, 8)), (a.T, b.T, (8, 20))):
        labelling = posed([ts.Layer(one), ts.Layer(other, at=at)], match=ts.seam.MatchCost(reach=32))
        cost = labelling.costs[0, 1]
        found.append(cost.on(cost.box))
    (right, down), (beside, below) = found
    np.testing.assert_allclose(right, below.T, rtol=1e-4)
    np.testing.assert_allclose(down, beside.T, rtol=1e-4)


def test_costs_of_reduced_overlaps_are_kept_as_far_as_they_may(monkeypatch):
    photograph = data.coffee()[:150, :330]
    layers = [
        ts.Layer(photograph[:, 70 * k : 70 * k + 110].copy() // (k + 1), at=(70 * k, k)) for k in range(4)
    ]
    fine = posed(layers)
    half = reduced(fine)
    assert all(isinstance(cost, TableCost) for cost in half.costs.values())
    kept = math.prod(half.costs[0, 1].box.shape)
    for together, tables in ((0, 0), (kept, 1), (2 * kept + 1, 2)):
        monkeypatch.setattr(reduction, "KEPT_TOGETHER", together)
        sparing = reduced(fine)
        assert [isinstance(cost, TableCost) for cost in sparing.costs.values()] == [
            k < tables for k in range(len(sparing.costs))
        ]
        for pair, cost in sparing.costs.items():
            for found, expected in zip(cost.on(cost.box), half.costs[pair].on(cost.box), strict=True):
                np.testing.assert_array_equal(found, expected)
    search = SearchOptions(coarsest=500)
    spared = ts.stitch(layers, effort=search)
    monkeypatch.undo()
    for mask, expected in zip(spared.masks, ts.stitch(layers, effort=search).masks, strict=True):
        np.testing.assert_array_equal(mask, expected)


class Order:
    """An executor that notes how large what it is given is."""

    def __init__(self):
        self.sizes, self.at_work = [], False

    def map(self, function, items):
        for item in items:
            finest, _ = item
            while isinstance(finest, reduction.ReducedCost):
                finest = finest.finer
            self.sizes.append(math.prod(finest.box.shape))
            self.at_work = True
            found = function(copied(item))
            self.at_work = False
            yield found


def copied(item):
    return pickle.loads(pickle.dumps(item))  # noqa: S301 - what this test has made


@pytest.mark.parametrize(
    ("most", "together", "kinds"),
    [
        (3000, 10_000, ["-+++", "++++", "++++"]),
        (4000, 2750, ["-+--", "++++", "++++"]),
        (4000, 1600, ["----", "++--", "++++"]),
    ],
)
def test_kept_tables_of_all_sizes_equal_reduced_costs(monkeypatch, most, together, kinds):
    photograph = data.coffee()[:150, :400]
    cuts = [(0, 200), (100, 240), (190, 330), (310, 400)]  # of which the first two have most in common
    layers = [ts.Layer(photograph[:, a:b].copy() // (k + 1), at=(a, k)) for k, (a, b) in enumerate(cuts)]
    fine = posed(layers, match=ts.seam.MatchCost(reach=16))
    one = [fine]
    for _ in range(3):
        one.append(reduced(one[-1]))
    monkeypatch.setattr(reduction, "KEPT_PIXELS", most)
    monkeypatch.setattr(reduction, "KEPT_TOGETHER", together)
    executor = Order()
    table, where = reduction._table, []
    monkeypatch.setattr(reduction, "_table", lambda cost: where.append(executor.at_work) or table(cost))
    fine = posed(layers, match=ts.seam.MatchCost(reach=16))
    tables = reduction.Tables(fine.costs, 3, executor, 0.6)
    sizes = [fine]
    for _ in range(3):
        sizes.append(reduction.halved(sizes[-1], 0.6))
    kept = tables.kept(sizes[1:])
    assert executor.sizes == sorted(executor.sizes, reverse=True)
    assert len(executor.sizes) == len(fine.costs)
    assert where == [True] * "".join(kinds).count("+"), "workers make the small ones, too"
    for found, expected, kind in zip(kept, one[1:], kinds, strict=True):
        assert "".join("-+"[isinstance(cost, TableCost)] for cost in found.costs.values()) == kind
        for pair, cost in expected.costs.items():
            assert found.costs[pair].box == cost.box
            for here, there in zip(found.costs[pair].on(cost.box), cost.on(cost.box), strict=True):
                np.testing.assert_array_equal(here, there)
    assert all(cost.looked_at() is not None for cost in fine.costs.values())


def test_a_reduced_label_map_costs_the_same_when_enlarged():
    photograph = data.chelsea()[:100, :160]
    layers = [
        ts.Layer(photograph[y : y + 60, x : x + 100].copy() + np.uint8(3 * x // 10), at=(x, y), name=str(x))
        for x, y in ((0, 0), (50, 2), (20, 40))
    ]
    fine = posed(layers)
    coarse = reduced(fine, wandering=0.0)
    small = coarse.on_top()
    large = reduction.enlarged(small, fine)
    inner = np.repeat(np.repeat(small, 2, 0), 2, 1)[: large.shape[0], : large.shape[1]]
    assert (large != inner).mean() < 0.03  # only where the reduced layer is not allowed
    assert coarse.total(small, coarse.canvas) == pytest.approx(fine.total(large, fine.canvas), rel=0.05)


def test_a_reduced_interface_mixes_minimum_and_middle_of_three():
    cost = np.array([[5.0, 3, 9, 4, 1, 2, 8]], np.float32)
    w = 0.6
    expected = [[w * 3 + (1 - w) * 3, w * 1 + (1 - w) * 4, 0.0]]
    expected[0][2] = w * 1 + (1 - w) * 2
    np.testing.assert_allclose(reduction._reduced_columns(cost, w), expected, rtol=1e-6)
    cost[0, 3] = 0  # the overlap ends inside of the second pair and begins again inside of the third
    expected[0][1] = w * 1 + (1 - w) * 1
    np.testing.assert_allclose(reduction._reduced_columns(cost, w), expected, rtol=1e-6)
    cost[0, 2:5] = 0
    assert reduction._reduced_columns(cost, w)[0, 1] == 0


def sliver(left, height=120):
    """A picture across two others that overlap by two columns of pixels; the first one shows something else
    than they do, but for its upper rows.
    """
    rng = np.random.default_rng(7)
    whole = np.clip(data.coffee()[40 : 40 + height, 100:340] + rng.normal(0, 2, (height, 240, 3)), 0, 255)
    across = whole[: height - 16, 48:192].copy()
    across[height // 4 :] = rng.uniform(0, 255, across[height // 4 :].shape)
    crops = ((across, (48, 0)), (whole[16:, : left + 2], (0, 16)), (whole[16:, left:], (left, 16)))
    return [ts.Layer(crop.astype(np.uint8), at=at) for crop, at in crops]


@pytest.mark.parametrize("left", range(118, 126))
def test_two_that_only_just_overlap_still_meet_at_every_size(left):
    coarse = posed(sliver(left))
    for factor in (1, 2, 4, 8):
        first, second = (coarse.allowed_in(k, coarse.canvas) for k in (1, 2))
        right, _ = coarse.costs[1, 2].on(coarse.canvas)
        meeting = first[:, :-1] & second[:, 1:] & (right > 0)
        inside = slice(-(-17 // factor), 103 // factor)  # rows of the first picture
        assert meeting[inside].any(axis=1).all()
        assert not (first[:, :-1] & second[:, 1:] & (right == 0))[inside].any()
        coarse = reduced(coarse)


@pytest.mark.medium
@pytest.mark.parametrize("left", [118, 124])
def test_a_seam_along_a_sliver_is_found_as_at_full_size(left):
    quick = ts.stitch(sliver(left))
    whole = ts.stitch(sliver(left), effort=SearchOptions(coarsest=10**9))
    beside = whole.masks[1][:, : 240 - 1] & whole.masks[2][:, 1:]
    assert beside.sum() > 60  # it runs along the sliver
    assert quick.cost <= 1.01 * whole.cost


@pytest.mark.medium
def test_small_problems_expand_all_pixels_at_half_size():
    """Of these pixels 10,036 have several layers at half the size, and 40,664 at full size."""
    rng = np.random.default_rng(7)
    photograph = data.coffee()[54:334, 29:369]
    places = (38, 132), (104, 43), (2, 66), (47, 19), (129, 146)
    sizes = (220, 125), (205, 153), (217, 136), (202, 114), (210, 118)
    layers = []
    for (x, y), (width, height) in zip(places, sizes, strict=True):
        crop = photograph[y : y + height, x : x + width] * (1 + rng.uniform(-0.1, 0.1))
        crop = np.clip(np.rint(crop + rng.integers(-3, 4, crop.shape)), 0, 255)
        layers.append(ts.Layer(crop.astype(np.uint8), at=(x, y), name=f"{x},{y}"))
    assert 40_000 < posed(layers).contested(10**9) <= SearchOptions().small
    quick = ts.stitch(layers, gradient=True).cost
    assert quick <= 1.005 * ts.stitch(layers, gradient=True, effort=SearchOptions(coarsest=10**9)).cost


@pytest.mark.medium
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_reduced_first_ends_within_two_percent_of_all_at_once(seed):
    rng = np.random.default_rng(seed)
    photograph = (data.coffee(), data.astronaut(), data.chelsea())[seed][:290, :440]
    layers = []
    for y in (0, 130):
        for x in (0, 150, 290):
            crop = photograph[y : y + 180, x : x + 200].astype(int)
            crop = crop + rng.integers(-9, 10, crop.shape) + rng.integers(-12, 12)
            layers.append(ts.Layer(np.clip(crop, 0, 255).astype(np.uint8), at=(x, y), name=f"{x},{y}"))
    quick = ts.stitch(layers).cost
    assert quick <= 1.02 * ts.stitch(layers, effort=SearchOptions(coarsest=10**9)).cost
