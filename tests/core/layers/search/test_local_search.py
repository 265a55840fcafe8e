"""Many layers: total cost against α-expansion, and what holds of every labelling."""

import dataclasses
import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from alpha_expansion import Expansion
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage import data

import toposeam as ts
from toposeam.layers.blending import blending_of
from toposeam.layers.canvas import Box
from toposeam.layers.composite.seams_of_map import SeamsOfMap
from toposeam.layers.labelling import beside_steps, junctions, pose_labelling
from toposeam.layers.search import (
    BEST,
    Choices,
    Problem,
    SearchOptions,
    minimise,
    recut,
    recutting,
    refine,
    search_options,
)
from toposeam.layers.search.local_search import settle
from toposeam.layers.search.options import BEST_FROM, FAST
from toposeam.seam.exact import minimum_cut

PHOTOGRAPHS = (data.coffee(), data.chelsea(), data.astronaut(), data.rocket())


def pile(seed, alike):
    """Three to six noisy crops of a photograph, each brighter or darker, in their own places (alike) or in
    any.
    """
    rng = np.random.default_rng(seed)
    photograph = PHOTOGRAPHS[seed % len(PHOTOGRAPHS)]
    layers = []
    for index in range(rng.integers(3, 7)):
        height, width, x, y = (
            int(rng.integers(low, high)) for low, high in ((40, 80), (40, 90), (0, 80), (0, 60))
        )
        if alike:
            row, column = 100 + y, 100 + x
        else:
            row, column = (
                rng.integers(0, photograph.shape[0] - height),
                rng.integers(0, photograph.shape[1] - width),
            )
        image = photograph[row : row + height, column : column + width].astype(int)
        image = image + rng.integers(-9, 10, image.shape) + rng.integers(-12, 12)
        layers.append(ts.Layer(image=np.clip(image, 0, 255).astype(np.uint8), at=(x, y), name=str(index)))
    return layers


def labelling_of(layers, match=None):
    return pose_labelling(ts.layers.common_canvas(layers), match=match)


def label_map_of(stitched):
    label_map = np.full(stitched.masks[0].shape, -1, np.int16)
    for index, mask in enumerate(stitched.masks):
        label_map[mask] = index
    return label_map


@pytest.mark.parametrize(
    "seed", [1, 2, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(3, 11))]
)
def test_total_cost_is_that_of_alpha_expansion(seed):
    pytest.importorskip("maxflow")
    layers = pile(seed, alike=seed % 2)
    stitched, joined = ts.stitch(layers), ts.stitch(layers, max_rounds=0)
    labelling = labelling_of(layers)
    peer = Expansion(labelling)
    assert peer.energy(label_map_of(stitched)) == pytest.approx(stitched.cost, rel=1e-6)
    assert stitched.cost <= 1.02 * min(peer.minimise(label_map_of(joined)), peer.minimise(labelling.on_top()))
    assert stitched.cost <= joined.cost


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 4])
def test_the_order_does_not_matter(seed):
    layers = pile(seed, alike=seed % 2)
    costs = [
        ts.stitch([layers[k] for k in np.random.default_rng(order).permutation(len(layers))]).cost
        for order in range(3)
    ]
    assert max(costs) <= 1.002 * min(costs)


def problem_of(labelling, search=FAST, executor=None):
    return Problem.of(labelling, "auto", {}, search, executor)


@pytest.mark.medium
@pytest.mark.parametrize("seed", [3, 5])
def test_best_costs_no_more_than_fast_and_is_a_local_optimum(seed):
    labelling = labelling_of(pile(seed, alike=True), ts.seam.MatchCost(law="gradient"))
    totals = {}
    for search in (FAST, BEST):
        label_map = minimise(problem_of(labelling, search), range(len(labelling.places)), 20)
        found = label_map.labels
        totals[search] = labelling.total(found, labelling.canvas)
        assert 1 <= label_map.rounds <= 20
    assert totals[BEST] <= totals[FAST]
    before = found.copy()
    settle(problem_of(labelling, BEST), found)
    np.testing.assert_array_equal(found, before)


@pytest.mark.parametrize(
    ("most", "large", "settled"), [(3, 1 << 22, True), (3, 1 << 10, False), (0, 1 << 22, False)]
)
def test_only_what_is_searched_in_rounds_and_small_is_settled(most, large, settled):
    labelling = labelling_of(pile(5, alike=True))
    found = []
    for windows in (False, True):
        search = SearchOptions(windows=windows, large_canvas=large)
        order = range(len(labelling.places))
        found.append(minimise(problem_of(labelling, search), order, most).labels)
    assert (found[0] != found[1]).any() == settled


def test_windows_are_settled_alike_by_other_processes():
    labelling = labelling_of(pile(5, alike=True))
    ends = []
    with ThreadPoolExecutor(2) as executor:
        for one in (None, executor):
            ends.append(labelling.on_top())
            settle(problem_of(labelling, BEST, one), ends[-1])
    np.testing.assert_array_equal(*ends)
    assert labelling.total(ends[0], labelling.canvas) < labelling.total(labelling.on_top(), labelling.canvas)


def test_effort_goes_by_the_number_of_layers_and_can_be_chosen():
    assert search_options(None, BEST_FROM - 1) == search_options("fast", BEST_FROM) == FAST
    assert search_options(None, BEST_FROM) == search_options("best", 3) == BEST
    assert search_options(SearchOptions(band=4), 30) == SearchOptions(band=4)
    with pytest.raises(ts.OptionError, match="effort"):
        ts.stitch(three(), effort="some")


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_pile_whose_best_seams_few_starts_lead_to(seed):
    """Three crops of a cat. The second one has to leave a hundred rows to the two others at once."""
    rng = np.random.default_rng(seed)
    layers = []
    for (x, y, width, height), gain in zip(
        ((116, 22, 189, 164), (32, 85, 212, 134), (47, 9, 180, 142)),
        ((1.025, 1.026, 1.037), (0.976, 0.965, 0.968), (0.986, 0.981, 0.996)),
        strict=True,
    ):
        crop = data.chelsea()[8 + y : 8 + y + height, 38 + x : 38 + x + width] * gain
        image = np.clip(np.rint(crop + rng.normal(0, 1.5, crop.shape)), 0, 255).astype(np.uint8)
        layers.append(ts.Layer(image, at=(x, y)))
    labelling, ends = labelling_of(layers), []
    allowed = [labelling.allowed_in(k, labelling.canvas) for k in range(3)]
    for order in itertools.permutations(range(3)):
        shows = np.full(labelling.canvas.shape, -1, np.int16)
        for k in order:
            shows[allowed[k]] = k
        choices = Choices(labelling, labelling.canvas, shows, allowed, range(3))
        choices.run(minimum_cut, 100)
        ends.append(choices.total())
    assert ts.stitch(layers).cost <= 1.02 * min(ends)


def test_a_search_from_a_few_pixels_on_ends_about_as_cheap():
    labelling = labelling_of(pile(3, alike=True), ts.seam.MatchCost(law="gradient"))
    totals = []
    for coarsest in (1 << 16, 300, 100):  # one size, three and four
        problem = problem_of(labelling, SearchOptions(coarsest=coarsest, shortest=4))
        found = minimise(problem, range(len(labelling.places)), 20).labels
        totals.append(labelling.total(found, labelling.canvas))
    assert max(totals) <= 1.05 * totals[0]


@pytest.mark.medium
@pytest.mark.parametrize("method", ["heat", "graph-cut", "shortest-path"])
def test_every_method_that_knows_networks_ends_at_the_same_cost(method):
    pytest.importorskip("maxflow")
    layers = pile(3, alike=True)
    assert ts.stitch(layers, method=method).cost == pytest.approx(ts.stitch(layers).cost, rel=0.01)


RECTANGLES = st.lists(
    st.tuples(
        st.integers(0, 25), st.integers(0, 20), st.integers(1, 24), st.integers(1, 20), st.integers(0, 2**31)
    ),
    min_size=3,
    max_size=6,
)


@pytest.mark.medium
@settings(deadline=None, max_examples=40, derandomize=True)
@given(RECTANGLES, st.booleans(), st.sampled_from(["none", "feather", "multiband", "gradient", "soft"]))
def test_no_hole_no_double_cover_no_pixel_unassigned(rectangles, holes, blend):
    layers = []
    for x, y, width, height, seed in rectangles:
        rng = np.random.default_rng(seed)
        alpha = (
            np.where(rng.random((height, width)) < 0.1, 0, rng.integers(1, 256)).astype(np.uint8)
            if holes
            else None
        )
        layers.append(
            ts.Layer(image=rng.integers(0, 256, (height, width, 3), np.uint8), alpha=alpha, at=(x, y))
        )
    try:
        stitched = ts.stitch(layers, blend=blend)
    except ts.OverlapError:
        return  # some layer touches no other, or nothing divides two of them
    covered = np.zeros(stitched.masks[0].shape, bool)
    for layer, mask in zip(layers, stitched.masks, strict=True):
        x, y = layer.at[0] - stitched.origin[0], layer.at[1] - stitched.origin[1]
        place = np.s_[y : y + layer.image.shape[0], x : x + layer.image.shape[1]]
        assert mask.sum() == mask[place].sum() <= layer.covered.sum()
        assert not (mask[place] & ~layer.covered).any()
        covered[place] |= layer.covered
    np.testing.assert_array_equal(np.sum(stitched.masks, axis=0), covered)
    assert not stitched.image[~covered].any()
    alpha = np.full(covered.shape, 255) if stitched.alpha is None else stitched.alpha
    np.testing.assert_array_equal(alpha > 0, covered)
    reach = blending_of(blend).reach
    if len(layers) == 2 and reach:
        return  # their window is that of the overlap, cells lie elsewhere
    total = labelling_of(layers, ts.seam.MatchCost(reach=reach)).total(
        label_map_of(stitched), ts.layers.common_canvas(layers).box
    )
    assert stitched.cost == pytest.approx(total, rel=1e-5, abs=1e-6)


def test_seams_say_which_layers_they_divide():
    layers = pile(5, alike=True)
    stitched = ts.stitch(layers, gradient=True)
    label_map = label_map_of(stitched)
    for (i, j), seam in zip(stitched.pairs, stitched.seams, strict=True):
        np.testing.assert_array_equal(seam.labels & ((label_map == i) | (label_map == j)), label_map == j)
        for line in seam.paths:
            middle = (line.points[:-1] + line.points[1:]) / 2
            for x, y in middle:
                around = label_map[int(np.ceil(y)) - 1 : int(y) + 1, int(np.ceil(x)) - 1 : int(x) + 1]
                assert {i, j} <= set(around.ravel().tolist())
        assert seam.optimum_ratio() <= 1.01
        assert 0 <= seam.soft.min() <= seam.soft.max() <= 1


def test_seams_of_many_record_the_options_of_their_method():
    by_heat = ts.stitch(three(), method="heat", tolerance=0.25, max_iterations=77, max_rounds=0)
    for seam in by_heat.seams:
        assert (seam.settings["tolerance"], seam.settings["max_iterations"]) == (0.25, 77)
    for method in ("auto", "graph-cut"):
        for seam in ts.stitch(three(), method=method, max_rounds=0).seams:
            assert "tolerance" not in seam.settings


def test_svg_names_the_pairs():
    layers = pile(5, alike=True)
    stitched = ts.stitch(layers)
    drawing = ts.vector.read_svg(stitched.to_svg())
    assert set(drawing.names) == {
        ts.layers.pair_name(str(i), str(j))
        for (i, j), seam in zip(stitched.pairs, stitched.seams, strict=True)
        if seam.paths
    }


def test_a_layer_that_reaches_none_before_it_waits_for_a_bridge():
    photograph = data.coffee()
    layers = [ts.Layer(image=photograph[:40, x : x + 50].copy(), at=(x, 0), name=str(x)) for x in (0, 80, 40)]
    stitched = ts.stitch(layers)
    assert all(mask.any() for mask in stitched.masks)
    assert stitched.pairs == ((0, 2), (1, 2))


# Masks, and seams given by hand


def three():
    photograph = data.coffee()[60:, 150:]
    return [
        ts.Layer(image=photograph[y : y + 60, x : x + 70].copy(), at=(x, y), name=name)
        for name, x, y in (("a", 0, 0), ("b", 40, 5), ("c", 20, 35))
    ]


@pytest.mark.parametrize("count", [2, 3])
def test_a_layer_shows_only_where_its_mask_lets_it(count):
    layers = three()[:count]
    mask = np.ones((60, 70), bool)
    mask[:, :20] = False
    layers[1] = ts.Layer(image=layers[1].image, at=(40, 5), mask=mask)
    stitched = ts.stitch(layers)
    assert not stitched.masks[1][:, :60].any()
    assert (np.sum(stitched.masks, axis=0) <= 1).all()


@pytest.mark.parametrize("count", [2, 3])
def test_a_layer_keeps_what_it_must(count):
    layers = three()[:count]
    free = ts.stitch(layers)
    shows = [mask[15:35, 42:68].all() for mask in free.masks]
    assert not all(shows[:2])
    index = shows.index(False)  # of a and b, one that does not show all of this part of their overlap
    keep = np.zeros((60, 70), bool)
    x, y = layers[index].at
    keep[15 - y : 35 - y, 42 - x : 68 - x] = True
    layers[index] = ts.Layer(image=layers[index].image, at=(x, y), keep=keep)
    assert ts.stitch(layers).masks[index][15:35, 42:68].all()


def test_what_two_layers_must_keep_is_refused():
    layers = [
        ts.Layer(image=layer.image, at=layer.at, name=layer.name, keep=np.ones((60, 70))) for layer in three()
    ]
    with pytest.raises(ts.OptionError, match="a and b are both to be kept"):
        ts.stitch(layers)
    nothing = ts.Layer(image=layers[0].image, keep=np.zeros((60, 70)), name="nothing")
    with pytest.raises(ts.OptionError, match="nothing is to be kept where it has no pixels"):
        ts.stitch([nothing, three()[1]])
    with pytest.raises(ts.ImageError, match="mask has shape"):
        ts.Layer(image=layers[0].image, mask=np.ones((3, 3)))


def test_no_seam_of_many_touches_what_is_to_be_avoided():
    layers = three()
    free = label_map_of(ts.stitch(layers))
    edge = np.zeros(free.shape, bool)
    edge[:, 1:] |= free[:, 1:] != free[:, :-1]
    avoid = np.zeros(free.shape, bool)
    row = 20
    column = np.flatnonzero(edge[row])[0]
    avoid[row - 4 : row + 4, column - 2 : column + 2] = True
    label_map = label_map_of(ts.stitch(layers, avoid=avoid))
    touched = (label_map[:, 1:] != label_map[:, :-1]) & (avoid[:, 1:] | avoid[:, :-1])
    assert not touched.any()
    assert (label_map != free).any()


def test_excluded_pixels_blocking_a_seam_of_many_are_refused():
    layers = [ts.Layer(data.coffee()[:60, x : x + 50], at=(x, 0)) for x in (0, 40, 80)]
    avoid = np.zeros((60, 130), bool)
    avoid[28:32] = True
    with pytest.raises(ts.OverlapError, match="no seam avoids the pixels you excluded"):
        ts.stitch(layers, avoid=avoid)


def test_seams_of_many_are_made_once_when_they_are_asked_for(monkeypatch):
    asked = []
    made = SeamsOfMap.seam

    def counted(self, pair, beside=False):
        asked.append(pair)
        return made(self, pair, beside)

    monkeypatch.setattr(SeamsOfMap, "seam", counted)
    stitched = ts.stitch(three(), blend="multiband")
    assert not asked
    assert len(stitched.seams) == len(stitched.pairs) > 1
    assert stitched.seams is stitched.seams
    assert asked == list(stitched.pairs)


def test_a_given_seam_of_one_pair_is_kept_and_others_are_found():
    layers = three()
    svg = '<svg xmlns="http://www.w3.org/2000/svg" width="110" height="95"><path d="M55 0 V95"/></svg>'
    stitched = ts.stitch(layers, use_path={(1, 0): ts.vector.read_svg(svg)})
    label_map = label_map_of(stitched)
    overlap = label_map[5:35, 40:70]  # of a and b only
    assert (overlap[:28, :15] == 0).all()
    assert (overlap[1:28, 15:] == 1).all()  # in row 0 b ends, and a shows
    given = stitched.seams[stitched.pairs.index((0, 1))]
    assert given.method == "path"
    assert given.termination == ts.optimize.Termination.GIVEN
    assert given.cost > 0
    with pytest.raises(ts.OptionError, match="choose two different ones from 0 to 2"):
        ts.stitch(layers, use_path={(0, 3): ts.vector.read_svg(svg)})


def test_beside_steps_marks_both_pixels_of_a_differing_pair():
    values = np.tile(np.array([5, 5, 6, 6, 9, 9], np.int16), (3, 1))
    for turned in (False, True):
        found = beside_steps(values.T if turned else values)
        assert np.flatnonzero(found.all(axis=1 if turned else 0)).tolist() == [1, 2, 3, 4]
        assert found.sum() == 3 * 4


def test_label_potentials_of_many_part_them_at_seams():
    joined = ts.stitch(pile(1, alike=True))
    for (_, second), seam in zip(joined.pairs, joined.seams, strict=True):
        beside = beside_steps(joined.label_map == second) & seam.labels
        assert 0 <= seam.soft.min() <= seam.soft.max() <= 1
        assert seam.soft[beside].mean() > 0.5


def opened_in(shape, *box):
    opened = np.zeros(shape, bool)
    opened[Box(*box).slices] = True
    return opened


@pytest.mark.parametrize("small", [True, False])
def test_a_part_is_searched_again_and_the_rest_stays(small, monkeypatch):
    monkeypatch.setattr(recutting, "_EXPANDED_PIXELS", 10**6 if small else 0)
    labelling = labelling_of(pile(3, alike=True))
    found = minimise(problem_of(labelling), range(len(labelling.places)), 20)
    worse = labelling.on_top()
    opened = opened_in(worse.shape, 20, 30, worse.shape[0] - 20, worse.shape[1] - 30)
    worse[~opened] = found.labels[~opened]
    search = SearchOptions(shortest=8, coarsest=500)
    again = recut(labelling, dataclasses.replace(found, labels=worse), opened, search=search)
    np.testing.assert_array_equal(again.labels[~opened], found.labels[~opened])
    best, before, after = (
        labelling.total(one, labelling.canvas) for one in (found.labels, worse, again.labels)
    )
    assert after < 0.9 * before
    assert after <= 1.05 * best


@pytest.mark.parametrize("small", [True, False])
def test_fixed_layers_show_and_seams_go_round_them(small, monkeypatch):
    monkeypatch.setattr(recutting, "_EXPANDED_PIXELS", 10**6 if small else 0)
    labelling = labelling_of(pile(3, alike=True))
    found = minimise(problem_of(labelling), range(len(labelling.places)), 20)
    fixed = np.full(found.labels.shape, -1, np.int16)
    for k in range(len(labelling.places)):  # each layer, where another one shows
        others = labelling_covers(labelling, k, fixed.shape) & (found.labels != k)
        rows, columns = np.nonzero(others)
        fixed[rows[len(rows) // 2], columns[len(rows) // 2]] = k
    again = recut(labelling, found, np.ones(fixed.shape, bool), fixed, search=SearchOptions(shortest=8))
    assert (again.labels[fixed >= 0] == fixed[fixed >= 0]).all()
    stamped = np.where(fixed >= 0, fixed, found.labels)
    assert labelling.total(again.labels, labelling.canvas) <= labelling.total(stamped, labelling.canvas)


def labelling_covers(labelling, index, shape):
    covers = np.zeros(shape, bool)
    place = labelling.places[index]
    covers[place.slices] = labelling.allowed[index][:, :]
    return covers


def test_where_nothing_is_open_nothing_is_searched():
    labelling = labelling_of(three())
    found = minimise(problem_of(labelling), range(3), 3)
    assert recut(labelling, found, np.zeros(found.labels.shape, bool)) is found


def test_junctions_are_where_three_layers_meet():
    labels = np.zeros((90, 120), np.int16)
    labels[40:] = 1
    assert junctions(labels, 24) == []
    labels[40:, 70:] = 2
    assert junctions(labels, 24) == [Box(39, 69, 41, 71).grown(24)]
    labels[:40] = -1  # nothing is no layer
    assert junctions(labels, 24) == []


@pytest.mark.parametrize("everywhere", [False, True])
def test_near_ties_are_looked_for_among_the_open_pixels_or_all(everywhere):
    labelling = labelling_of(pile(1, alike=True))
    shows, before = labelling.on_top(), labelling.total(labelling.on_top(), labelling.canvas)
    nothing = np.zeros(shows.shape, bool)
    ties = refine(problem_of(labelling), shows, nothing, 5, ties=True, everywhere=everywhere)
    found = sum(len(rows) for rows, _ in ties.values())
    assert set(ties) == set(range(len(labelling.places)))
    assert (found > 0) == everywhere
    after = labelling.total(shows, labelling.canvas)
    assert after < 0.9 * before if everywhere else after == before


def test_of_few_pixels_all_are_asked_for_near_ties():
    """At half the size 2088 in the first block of pixels, and 3030 in all, have several layers."""
    rng, layers = np.random.default_rng(0), []
    ends = (0, 300), (180, 320), (200, 1200), (1100, 2200), (2060, 2160), (2080, 2200)
    for k, (left, right) in enumerate(ends):
        image = np.tile(PHOTOGRAPHS[0][100 + 7 * k : 136 + 7 * k, :350], (1, 4, 1))[:, : right - left]
        noisy = image + rng.integers(-9, 10, image.shape)
        layers.append(ts.Layer(np.clip(noisy, 0, 255).astype(np.uint8), at=(left, 0), name=str(k)))
    labelling, costs = labelling_of(layers), []
    for few in (0, 2088, 3029, 3030):
        search = SearchOptions(coarsest=50, shortest=8, near_ties=few)
        found = minimise(problem_of(labelling, search), range(len(layers)), 3).labels
        costs.append(labelling.total(found, labelling.canvas))
    assert costs[0] == costs[1] == costs[2] > costs[3]


def test_nearly_shown_layers_at_half_size_may_show_at_full_size():
    labelling = labelling_of(pile(1, alike=True))
    canvas = labelling.canvas
    everywhere = np.nonzero(np.ones((canvas.shape[0] // 2, canvas.shape[1] // 2)))
    costs = []
    for ties in ({}, dict.fromkeys(range(len(labelling.places)), everywhere)):
        shows = labelling.on_top()
        refine(problem_of(labelling), shows, np.zeros(shows.shape, bool), 5, tied=ties)
        costs.append(labelling.total(shows, canvas))
    assert costs[1] < 0.9 * costs[0]


def test_expansions_by_flow_end_as_those_by_heat_do(monkeypatch):
    layers = pile(3, alike=True)
    by_flow = ts.stitch(layers).cost
    monkeypatch.setattr("toposeam.seam.cut_solver.FLOW_PIXELS", 0)
    assert ts.stitch(layers).cost == pytest.approx(by_flow, rel=5e-3)
