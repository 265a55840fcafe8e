"""Layers recede along several others at once, and what nearly changes is told."""

import itertools

import numpy as np
import pytest
from skimage import data

import toposeam as ts
from toposeam.layers.choices import Choices
from toposeam.layers.labelling import Labelling
from toposeam.layers.layer import Box
from toposeam.layers.posing import exclusive_covers, pose_labelling
from toposeam.layers.receding import fusion, nearly, recede, settle
from toposeam.layers.table_costs import TableCost
from toposeam.seam.flow import minimum_cut


def by_flow(network, cost):
    hot = minimum_cut(network, cost)
    return hot, hot.astype(float)


def posed(layers):
    canvas = ts.common_canvas(layers)
    covers = exclusive_covers(layers, [canvas.place(layer) for layer in layers], canvas)
    return pose_labelling(layers, canvas, covers)


def four(seed=0):
    """Four noisy crops of a photograph that all meet."""
    rng = np.random.default_rng(seed)
    layers = []
    for x, y in ((0, 0), (30, 4), (6, 28), (33, 30)):
        crop = data.coffee()[100 + y : 150 + y, 150 + x : 210 + x] + rng.integers(-25, 26, (50, 60, 3))
        layers.append(ts.Layer(np.clip(crop, 0, 255).astype(np.uint8), at=(x, y)))
    return posed(layers)


def choices_of(labelling, label_map):
    count, box = len(labelling.places), labelling.canvas
    return Choices(
        labelling, box, label_map, [labelling.allowed_in(k, box) for k in range(count)], range(count)
    )


def between_two(cost_of_others=1.0, columns=60, split=30):
    """A layer in the middle, 2, of whose columns the left ones may show 0 and the right ones 1."""
    canvas = Box(0, 0, 2, columns)
    allowed = np.zeros((3, 2, columns), bool)
    allowed[0, :, :split] = allowed[1, :, split:] = allowed[2, :, 1:-1] = True
    tables = {}
    for pair, cost in {(0, 1): cost_of_others, (0, 2): 5.0, (1, 2): 5.0}.items():
        right, down = np.zeros((4, columns + 1), np.float32), np.zeros((3, columns + 2), np.float32)
        right[1:-1, 1:-1] = down[1:-1, 1:-1] = cost
        right[1:-1, [1, -2]] = 4.6
        tables[pair] = TableCost(canvas.grown(1), right, down)
    return Labelling(canvas, [canvas] * 3, list(allowed), tables)


def test_a_layer_recedes_along_two_others_where_neither_expands():
    labelling = between_two()
    choices = choices_of(labelling, labelling.on_top())
    choices.run(by_flow, 10)
    assert choices.total() == pytest.approx(2 * (4.6 + 4.6))  # half of the way costs as much as none
    assert settle(choices, by_flow, range(3), 0.0) == []
    assert choices.total() == 2 * 1
    assert set(choices.shows) == {0, 1}


@pytest.mark.parametrize(("others", "dearer", "asked"), [(9.9, 0.1, [2]), (9.9, 0.0, []), (9.9, 0.05, [])])
def test_what_recedes_if_all_cost_more_is_asked_again(others, dearer, asked):
    labelling = between_two(others)
    choices = choices_of(labelling, labelling.on_top())
    assert settle(choices, by_flow, range(3), dearer) == asked
    assert choices.total() == pytest.approx(2 * (4.6 + 4.6))
    found = nearly(choices, by_flow, range(3), asked, (dearer, dearer))
    at = [set(zip(*map(list, found[k,]), strict=True)) for k in (0, 1)]
    assert (len(at[0]) > 20 and len(at[1]) > 20) == bool(asked)
    assert choices.total() == pytest.approx(2 * (4.6 + 4.6))


def test_what_one_layer_takes_nearly_all_of_is_not_asked_again():
    labelling = between_two(9.9, split=50)
    choices = choices_of(labelling, labelling.on_top())
    _, left = recede(choices, by_flow, range(3), range(3), 0.1)
    assert np.bincount(left[2][1]).tolist() == [98, 18]
    assert settle(choices, by_flow, range(3), 0.1) == []


@pytest.mark.parametrize("seed", range(6))
def test_a_fusion_move_is_the_best_mixture_of_two_solutions(seed):
    rng = np.random.default_rng(seed)
    canvas, count = Box(0, 0, 3, 4), 4
    places = rng.random((count, 3))  # distances: two unlike layers never cost more than by way of a third one
    tables = {}
    for i, j in itertools.combinations(range(count), 2):
        distance = np.linalg.norm(places[i] - places[j])
        tables[i, j] = TableCost(
            canvas.grown(1), np.full((5, 5), distance, np.float32), np.full((4, 6), distance, np.float32)
        )
    labelling = Labelling(canvas, [canvas] * count, [np.ones(canvas.shape, bool)] * count, tables)
    one = np.full(canvas.shape, seed % count, np.int16)  # one layer, as where it recedes
    one[:, 0], one[0] = rng.integers(count, size=3), rng.integers(count, size=4)
    other = np.where(rng.random(canvas.shape) < 0.2, one, rng.integers(count, size=canvas.shape))
    other[:, 0], other[0] = one[:, 0], one[0]
    apart = np.flatnonzero((one != other).ravel())
    best = np.inf
    for bits in itertools.product((False, True), repeat=len(apart)):
        mixed = one.ravel().copy()
        mixed[apart[list(bits)]] = other.ravel()[apart[list(bits)]]
        best = min(best, labelling.total(mixed.reshape(canvas.shape), canvas))
    # As a layer recedes, and as it expands.
    for before, after in ((one, other.astype(np.int16)), (other.astype(np.int16), one)):
        turned, _ = fusion(choices_of(labelling, before), after.ravel(), by_flow)
        shows = before.ravel().copy()
        shows[turned] = after.ravel()[turned]
        assert labelling.total(shows.reshape(canvas.shape), canvas) == pytest.approx(best, rel=1e-5)


def test_what_would_turn_if_all_cost_more_is_told_and_what_gains_turns():
    labelling = four()
    choices = choices_of(labelling, labelling.on_top())
    choices.run(by_flow, 100)
    ended, before = choices.shows.copy(), choices.total()
    told = [
        {layers: set(zip(*map(list, pixels), strict=True)) for layers, pixels in found.items()}
        for found in (nearly(choices, by_flow, range(4), (), (0.0, dearer)) for dearer in (0.0, 0.1, 0.4))
    ]
    assert [list(found) for found in told] == [[(0,), (1,), (2,), (3,)]] * 3
    sizes = [sum(map(len, found.values())) for found in told]
    assert sizes[0] < sizes[1] < sizes[2]
    assert choices.total() <= before
    choices.shows = labelling.on_top().ravel().copy()  # far from any end
    first = choices.total()
    nearly(choices, by_flow, range(4), (), (0.0, 0.1))
    assert choices.total() < 0.95 * first
    assert not np.array_equal(choices.shows, ended)


def test_all_layers_asked_together_never_cost_more():
    labelling = four(2)
    choices = choices_of(labelling, labelling.on_top())
    before = choices.total()
    gained, _ = recede(choices, by_flow, range(4), range(4), 0.0)
    assert gained
    assert choices.total() < before
    for _ in range(9):
        ended = choices.shows.copy()
        gained, left = recede(choices, by_flow, range(4), range(4), 0.0)
    assert not gained
    np.testing.assert_array_equal(choices.shows, ended)
    assert set(left) == {k for k in range(4) if (ended == k).any()}


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_pile_whose_best_seams_no_expansion_leads_to(seed):
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
    labelling = posed(layers)
    ends = []
    for order in itertools.permutations(range(3)):
        shows = np.full(labelling.canvas.shape, -1, np.int16)
        for k in order:
            shows[labelling.allowed_in(k, labelling.canvas)] = k
        choices = choices_of(labelling, shows)
        choices.run(by_flow, 100)
        ends.append(choices.total())
    assert ts.stitch(layers).cost <= 1.02 * min(ends)
