"""Moves on lists of pixels: they cost what the labelling does, and gain what moves on pictures do."""

import itertools

import numpy as np
import pytest
from alpha_expansion import Expansion
from scipy import ndimage
from skimage import data

import toposeam as ts
from toposeam.layers.canvas import Box
from toposeam.layers.labelling import (
    Labelling,
    TableCost,
    pose_labelling,
    reached,
    square_dilation,
)
from toposeam.layers.search import Choices
from toposeam.seam.exact import minimum_cut
from toposeam.seam.heat import gather_heat

by_flow = minimum_cut


def by_heat(network, cost):
    return gather_heat(network, cost, 1e-6, 100).hot[:-2]


def four(seed=0):
    """Four noisy crops of a photograph that all meet."""
    rng = np.random.default_rng(seed)
    photograph = data.coffee()[100:, 150:]
    layers = []
    for x, y in ((0, 0), (30, 4), (6, 28), (33, 30)):
        crop = photograph[y : y + 50, x : x + 60].astype(int) + rng.integers(-25, 26, (50, 60, 3))
        layers.append(ts.Layer(np.clip(crop, 0, 255).astype(np.uint8), at=(x, y), name=f"{x},{y}"))
    return pose_labelling(ts.layers.common_canvas(layers))


def choices_of(labelling, label_map, box=None):
    box = labelling.canvas if box is None else box
    count = len(labelling.places)
    allowed = [labelling.allowed_in(k, box) for k in range(count)]
    return Choices(labelling, box, label_map[box.slices], allowed, range(count))


def test_a_change_costs_what_the_labelling_says():
    labelling = four()
    choices = choices_of(labelling, labelling.on_top())
    rng = np.random.default_rng(1)
    before, own = labelling.total(choices.label_map(), labelling.canvas), choices.total()
    for _ in range(3):
        for k in rng.permutation(4):
            turned = choices.may[k] & (rng.random(len(choices.shows)) < 0.4)
            choices.shows[turned] = k
        after = labelling.total(choices.label_map(), labelling.canvas)
        assert after - before == pytest.approx(choices.total() - own, rel=1e-5)
        assert after != before


@pytest.mark.parametrize("decide", [by_flow, by_heat])
@pytest.mark.parametrize("seed", range(3))
def test_expansions_are_those_of_the_peer(decide, seed):
    pytest.importorskip("maxflow")
    labelling = four(seed)
    peer, label_map = Expansion(labelling), labelling.on_top()
    choices = choices_of(labelling, label_map)
    for k in (0, 1, 2, 3, 1, 0):
        new = peer.expand(label_map, k)
        gains = peer.energy(new) < peer.energy(label_map) * (1 - 1e-7)
        assert choices.expand(k, decide) == gains
        label_map = new if gains else label_map
        assert peer.energy(choices.label_map()) == pytest.approx(peer.energy(label_map), rel=1e-4)


@pytest.mark.parametrize("costs", [(5, 1, 3), (2, 3, 4), (1, 1, 1), (9, 1, 2)])
@pytest.mark.parametrize("middle", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_expansion_of_a_row_of_four_is_optimal(middle, costs):
    canvas = Box(0, 0, 1, 4)
    allowed = [np.array([row], bool) for row in ([1, 1, 1, 0], [0, 1, 1, 0], [0, 1, 1, 1])]
    tables = {}
    for pair, cost in zip(((0, 1), (0, 2), (1, 2)), costs, strict=True):
        right, down = np.zeros((3, 5), np.float32), np.zeros((2, 6), np.float32)
        right[1, 1:4] = cost
        tables[pair] = TableCost(canvas.grown(1), right, down)
    labelling = Labelling(canvas, [canvas] * 3, allowed, tables)
    before = np.array([[0, *middle, 2]], np.int16)
    best = min(
        labelling.total(np.array([[0, *pixels, 2]], np.int16), canvas)
        for pixels in itertools.product(*({now, 2} for now in middle))
    )
    choices = choices_of(labelling, before)
    choices.expand(2, by_flow)
    if sum(costs) > 9 and middle in ((0, 1), (1, 0)):  # not submodular: told too low, judged by what it is
        assert labelling.total(choices.label_map(), canvas) <= labelling.total(before, canvas)
    else:
        assert labelling.total(choices.label_map(), canvas) == pytest.approx(best)


@pytest.mark.parametrize("way", [1, -1])
def test_neighbours_turn_together_across_a_costly_interface(way):
    """Turning the one beside what shows the layer already would cost 6, both 5, and none 4 + 9."""
    canvas = Box(0, 0, 1, 4)
    allowed = [np.array([row[::way]], bool) for row in ([1, 1, 0, 0], [0, 0, 1, 0], [0, 1, 1, 1])]
    tables = {}
    for pair, costs in {(0, 1): (0, 4, 0), (0, 2): (5, 6, 0), (1, 2): (0, 6, 9)}.items():
        right, down = np.zeros((3, 5), np.float32), np.zeros((2, 6), np.float32)
        right[1, 1:4] = costs[::way]
        tables[pair] = TableCost(canvas.grown(1), right, down)
    labelling = Labelling(canvas, [canvas] * 3, allowed, tables)
    choices = choices_of(labelling, np.array([[0, 0, 1, 2][::way]], np.int16))
    assert choices.expand(2, by_flow)
    assert choices.label_map()[0].tolist() == [0, 2, 2, 2][::way]


def test_dividing_all_seams_together_gains_as_much_as_singly():
    labelling = four()
    label_map = labelling.on_top()
    labels = [
        square_dilation(label_map == k, 3) & labelling.allowed_in(k, labelling.canvas) for k in range(4)
    ]
    together = Choices(labelling, labelling.canvas, label_map, labels, range(4))
    free = together.divide_all(by_heat, labels)
    apart = Choices(labelling, labelling.canvas, label_map, labels, range(4))
    for i, j in itertools.combinations(range(4), 2):
        own = free & apart.may[i] & apart.may[j]
        one, other = (np.full(len(own), k, np.int16) for k in (i, j))
        apart.divide(own, one, other, by_heat)
    assert together.total() == pytest.approx(apart.total(), rel=1e-5)
    assert together.total() < choices_of(labelling, label_map).total() - 1
    changed = together.label_map() != label_map
    assert not (changed.ravel() & ~free).any()


@pytest.mark.parametrize("seed", range(2))
def test_pixels_of_two_layers_beside_no_others_are_divided(seed):
    labelling = four()
    box, rng = Box(3, 20, 71, 85), np.random.default_rng(seed)
    label_map = with_spots(labelling, seed)[box.slices]
    label_map[rng.random(label_map.shape) < 0.01] = -1
    allowed = [labelling.allowed_in(k, box) for k in range(4)]
    labels = [square_dilation(label_map == k, 2) & mask for k, mask in enumerate(allowed)]
    choices = Choices(labelling, box, label_map, allowed, range(4))
    found = choices.divide_all(by_flow, labels).reshape(box.shape)
    may = np.array(labels)
    two = (may.sum(axis=0) == 2) & (label_map >= 0)
    expected = two.copy()
    for y, x in np.argwhere(two):
        for beside in ((y + 1, x), (y - 1, x), (y, x + 1), (y, x - 1)):
            if two[max(0, min(beside[0], len(two) - 1)), max(0, min(beside[1], two.shape[1] - 1))]:
                there = may[:, max(0, min(beside[0], len(two) - 1)), max(0, min(beside[1], two.shape[1] - 1))]
                expected[y, x] &= (there == may[:, y, x]).all()
    np.testing.assert_array_equal(found, expected)
    assert two[~expected].any()
    changed = choices.label_map() != label_map
    assert changed.any()
    assert not changed[~expected].any()


def test_a_part_with_some_layers_costs_what_the_whole_does():
    labelling = four()
    box, layers = Box(9, 32, 41, 88), [1, 3]
    label_map = labelling.on_top()[box.slices]
    label_map[~np.isin(label_map, layers)] = -1
    allowed = [labelling.allowed_in(k, box) & (label_map >= 0) for k in layers]
    choices = Choices(labelling, box, label_map, allowed, layers)
    whole = np.full(labelling.canvas.shape, -1, np.int16)

    def both():
        whole[box.slices] = choices.label_map()
        return choices.total(), labelling.total(whole, labelling.canvas)

    np.testing.assert_array_equal(choices.label_map(), label_map)
    rng, before = np.random.default_rng(0), both()
    for _ in range(3):
        turned = choices.several & (rng.random(len(choices.shows)) < 0.5)
        choices.shows[turned] = rng.integers(2, size=turned.sum())
        after = both()
        assert after[0] - before[0] == pytest.approx(after[1] - before[1], rel=1e-5)
    for k in (0, 1):
        choices.expand(k, by_flow)
    assert both()[1] < after[1]


def test_rounds_are_made_until_none_gains():
    labelling = four()
    first, again = (choices_of(labelling, with_spots(labelling, 3)) for _ in range(2))
    rounds = first.run(by_flow, 100)
    assert 2 <= rounds < 100
    assert again.run(by_flow, rounds) == rounds
    np.testing.assert_array_equal(first.shows, again.shows)
    assert first.run(by_flow, 100) == 1
    assert first.run(by_flow, 0) == 0


def test_only_pixels_within_a_mask_expand():
    labelling = four()
    choices = choices_of(labelling, with_spots(labelling, 5))
    shows, before = choices.shows.copy(), choices.total()
    within = np.zeros(labelling.canvas.shape, bool)
    within[10:50, 22:61] = True
    choices.run(by_flow, 100, [2, 0, 3, 1], within.ravel())
    changed = choices.shows != shows
    assert changed.any()
    assert not changed[~within.ravel()].any()
    assert choices.total() < before
    ended = choices.total()
    choices.run(by_flow, 100)
    assert choices.total() < ended


def test_more_would_turn_the_more_the_present_seams_cost():
    labelling = four()
    choices = choices_of(labelling, labelling.on_top())
    choices.run(by_flow, 100)
    ended, sizes = choices.shows.copy(), []
    for dearer in (0.0, 0.1, 0.4):
        sizes.append(sum(len(choices.would_expand(k, by_flow, dearer)) for k in range(4)))
        np.testing.assert_array_equal(choices.shows, ended)
    assert sizes[0] < sizes[1] < sizes[2]


def with_spots(labelling, seed, count=7):
    """A label map that shows another layer in some squares."""
    rng = np.random.default_rng(seed)
    result = labelling.on_top()
    height, width = result.shape
    for _ in range(count):
        y, x, k = rng.integers(height), rng.integers(width), rng.integers(4)
        part = np.s_[max(y - 6, 0) : y + 6, max(x - 6, 0) : x + 6]
        allowed = labelling.allowed_in(k, labelling.canvas)[part]
        result[part][allowed] = k
    return result


@pytest.mark.parametrize("seed", range(4))
def test_fusion_finds_the_best_mixture_of_two_solutions(seed):
    labelling = four()
    one, other = with_spots(labelling, seed), with_spots(labelling, seed + 100)
    patch, count = ndimage.label(one != other)
    assert 2 <= count <= 14
    costs = []
    for chosen in itertools.product((False, True), repeat=count):
        mixed = np.where(np.array([False, *chosen])[patch], other, one)
        costs.append(labelling.total(mixed, labelling.canvas))
    choices = choices_of(labelling, one)
    choices.fuse(other.ravel())
    assert labelling.total(choices.label_map(), labelling.canvas) == pytest.approx(min(costs), rel=1e-6)
    assert min(costs) <= min(costs[0], costs[-1])


def test_a_pixel_with_nothing_known_beside_it_stays():
    labelling = four()
    choices = choices_of(labelling, labelling.on_top())
    alone = np.flatnonzero(choices.may[0] & choices.may[1])[0]
    choices.shows[:] = len(choices.layers)
    choices.shows[alone] = 0
    assert not choices.expand(1, by_flow)
    assert choices.shows[alone] == 0


@pytest.mark.parametrize("count", [3, 8, 9, 70])
def test_layers_reach_as_far_however_many_there_are(count):
    rng = np.random.default_rng(count)
    label_map = rng.integers(-1, count, (20, 30)).astype(np.int16)
    for k, near in enumerate(reached(label_map, count, 2)):
        assert np.array_equal(near, square_dilation(label_map == k, 2))


def total_of(choices, shows):
    choices.shows = shows
    return choices.total()


def test_pixels_that_nothing_pulls_at_stay():
    canvas = Box(0, 0, 1, 3)
    allowed = [np.ones((1, 3), bool)] * 2
    table = TableCost(canvas.grown(1), np.zeros((3, 4), np.float32), np.zeros((2, 5), np.float32))
    labelling = Labelling(canvas, [canvas] * 2, allowed, {(0, 1): table})
    for label_map in np.array([[[0, 1, 0]], [[1, 1, 0]]], np.int16):
        choices = choices_of(labelling, label_map)
        choices.divide_all(by_flow, allowed)
        assert (choices.label_map() == label_map).all()


@pytest.mark.parametrize("reach", [1, 2, 3, 4, 8])
def test_a_square_dilation_reaches_as_far_as_it_is_told_to(reach):
    mask = np.zeros((25, 31), bool)
    mask[11, 14] = True
    expected = np.zeros_like(mask)
    expected[11 - reach : 12 + reach, 14 - reach : 15 + reach] = True
    np.testing.assert_array_equal(square_dilation(mask, reach), expected)
    assert mask.sum() == 1
