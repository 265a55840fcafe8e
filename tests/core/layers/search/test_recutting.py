"""Searching again after strokes: as good as a search from nothing, nothing else changed, kept costs exact."""

import dataclasses

import numpy as np
import pytest
from skimage import data

import toposeam as ts
from toposeam.layers.labelling import Stroke, apply_strokes
from toposeam.layers.search import Problem, keep_costs, minimise, search_options

PHOTOGRAPH = data.astronaut()


def noisy(rows, columns, seed):
    part = PHOTOGRAPH[rows, columns].astype(float)
    moved = np.roll(part, 3 * seed % 5, axis=1) * (0.9 + 0.05 * seed)
    return np.clip(moved + np.random.default_rng(seed).normal(0, 4, part.shape), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def joined():
    """Four photographs with large overlaps, which disagree a little."""
    places = [(0, 0), (0, 180), (140, 20), (150, 190)]
    return ts.stitch(
        [
            ts.Layer(noisy(slice(y, y + 300), slice(x, x + 300), k), at=(x, y))
            for k, (y, x) in enumerate(places)
        ],
    )


def drawn(joined, seed):
    """Draw a stroke over a seam that asks for one of its two layers beyond it."""
    rng = np.random.default_rng(seed)
    (i, j), x, y, *_ = list(joined.labelling.interfaces(joined.label_map, joined.canvas.box))[seed % 4]
    at = rng.integers(len(x))
    layer = (i, j)[seed % 2]
    start = np.array([x[at], y[at]]) - joined.layers[layer].at
    angle = rng.uniform(0, 2 * np.pi)
    way = np.array([np.cos(angle), np.sin(angle)]) * rng.uniform(20, 80)
    return Stroke(points=[start - 0.2 * way, start + way], radius=rng.uniform(3, 12), layer=layer)


def cost_of(labelling, found):
    return labelling.total(np.asarray(found.labels[:, :]), labelling.canvas)


@pytest.mark.medium
@pytest.mark.parametrize("seed", range(8))
def test_all_searched_again_costs_as_little_as_from_nothing(joined, seed):
    asked, lost = apply_strokes(keep_costs(joined.labelling), [drawn(joined, seed)], joined.canvas)
    assert lost == ()
    window = ts.layers.recut(asked, joined.solution)
    again = ts.layers.recut(asked, window, whole=True)
    fresh = minimise(Problem.of(asked, "auto", {}, search_options("fast", 4)), range(4), 10)
    assert cost_of(asked, again) <= cost_of(asked, window) * (1 + 1e-6)
    assert cost_of(asked, again) <= 1.005 * cost_of(asked, fresh)
    for k, place in enumerate(asked.places):
        shows = again.labels[place.slices] == k
        assert not (shows & ~asked.allowed[k]).any()


@pytest.mark.parametrize("seed", range(4))
def test_a_window_changes_and_the_rest_stays(joined, seed):
    stroke = drawn(joined, seed)
    asked, _ = apply_strokes(joined.labelling, [stroke], joined.canvas)
    again = ts.layers.recut(asked, joined.solution)
    changed = again.labels != joined.label_map
    reach = np.zeros(changed.shape, bool)
    at = stroke.points + joined.layers[stroke.layer].at
    size = np.ptp(at, axis=0).max() + 2 * stroke.radius
    margin = max(96, size / 2) + stroke.radius + 2
    low, high = np.maximum(at.min(axis=0) - margin, 0).astype(int), (at.max(axis=0) + margin).astype(int)
    reach[low[1] : high[1] + 1, low[0] : high[0] + 1] = True
    assert changed.any()
    assert not (changed & ~reach).any()


def test_nothing_to_be_done_is_nothing_changed(joined):
    assert ts.layers.recut(joined.labelling, joined.solution) is joined.solution


def test_fixed_layers_that_show_already_change_nothing(joined):
    """Even where the label map shows what the problem does not allow, as masks that were painted may."""
    painted = np.array(joined.label_map)
    y, x = 150, 200
    painted[y, x] = next(k for k in range(4) if k != painted[y, x])
    asked, _ = apply_strokes(joined.labelling, [drawn(joined, 0)], joined.canvas)
    solution = dataclasses.replace(joined.solution, labels=painted)
    fixed = np.full(painted.shape, -1, np.int16)
    fixed[y, x] = painted[y, x]
    assert ts.layers.recut(asked, solution, fixed=fixed) is solution


def test_kept_costs_are_the_costs(joined):
    kept = keep_costs(joined.labelling)
    box = kept.canvas
    for pair, cost in joined.labelling.costs.items():
        for one, other in zip(cost.on(box), kept.costs[pair].on(box), strict=True):
            np.testing.assert_array_equal(one, other)
    stroke = drawn(joined, 3)
    solutions = [
        ts.layers.recut(apply_strokes(one, [stroke], joined.canvas)[0], joined.solution, whole=True)
        for one in (joined.labelling, kept)
    ]
    np.testing.assert_array_equal(*(one.labels for one in solutions))


def test_kept_costs_keep_to_their_memory(joined):
    areas = {pair: np.prod(cost.box.shape) for pair, cost in joined.labelling.costs.items()}
    smallest = min(areas, key=areas.get)
    few = keep_costs(joined.labelling, megabytes=areas[smallest] * 12e-6)
    assert [pair for pair in areas if few.costs[pair] is not joined.labelling.costs[pair]] == [smallest]
    assert keep_costs(joined.labelling, megabytes=0).costs == dict(joined.labelling.costs)


def test_a_search_is_given_up_between_cuts(joined):
    asked, _ = apply_strokes(joined.labelling, [drawn(joined, 0)], joined.canvas)

    def stop(share):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ts.layers.recut(asked, joined.solution, whole=True, progress=stop)
    with pytest.raises(KeyboardInterrupt):
        ts.layers.recut(asked, joined.solution, progress=stop)


def distances_from(edge_map, rows, columns):
    from scipy.ndimage import distance_transform_edt

    return distance_transform_edt(~edge_map)[rows, columns]


@pytest.mark.medium
@pytest.mark.parametrize("count", [2, 4])
def test_large_seams_stay_by_those_of_a_small_label_map(joined, count):
    small = [
        dataclasses.replace(layer, image=layer.image[::2, ::2], at=(layer.at[0] // 2, layer.at[1] // 2))
        for layer in joined.layers[:count]
    ]
    stroke = Stroke(points=[(130, 100), (100, 140)], radius=8, layer=1)
    half = dataclasses.replace(stroke, points=stroke.points / 2, radius=stroke.radius / 2)
    preview = ts.stitch(small, strokes=[half])
    start = dataclasses.replace(preview.solution, scale=2.0)
    large = ts.stitch(joined.layers[:count], strokes=[stroke], preview=start)
    labels = np.asarray(preview.label_map)
    edge = np.zeros(labels.shape, bool)
    edge[:, 1:] |= labels[:, 1:] != labels[:, :-1]
    edge[1:] |= labels[1:] != labels[:-1]
    far = [
        distances_from(edge, np.minimum(y // 2, edge.shape[0] - 1), np.minimum(x // 2, edge.shape[1] - 1))
        for _, x, y, *_ in large.labelling.interfaces(large.label_map, large.canvas.box)
    ]
    assert (np.concatenate(far) <= 3).mean() >= 0.99
    shown = np.asarray(large.label_map)
    for box, mask in stroke.on(large.canvas):
        assert (shown[box.slices][mask] == 1).all()


def test_strokes_of_a_stitch_say_which_change_nothing(joined):
    strokes = [Stroke(points=[(-50, -50)], radius=5, layer=0), drawn(joined, 1)]
    again = ts.stitch(joined.layers, strokes=strokes)
    assert again.solution.lost_strokes == (0,)


@pytest.mark.medium
def test_strokes_hold_on_a_round_canvas():
    layers = [
        ts.Layer(noisy(slice(0, 120), slice(x, x + 160), k), at=(x, 0)) for k, x in enumerate((0, 120, 240))
    ]
    plain = ts.stitch(layers, wrap=360)
    stroke = Stroke(points=[(150, 20), (158, 60)], radius=6, layer=2)  # the layer fills 240 to 400
    again = ts.stitch(layers, wrap=360, strokes=[stroke])
    shown = np.asarray(again.label_map)
    columns = np.arange(390 - 360 - 4, 398 - 360 - 2)
    assert (np.asarray(plain.label_map)[20:60, columns] != 2).any()
    assert (shown[25:55, 33] == 2).all()


def test_a_canvas_larger_than_a_dense_map_is_searched_whole(joined, monkeypatch):
    asked, _ = apply_strokes(joined.labelling, [drawn(joined, 1)], joined.canvas)
    usual = ts.layers.recut(asked, joined.solution, whole=True).labels
    monkeypatch.setattr("toposeam.layers.canvas.tile_map.DENSE_PIXELS", 1 << 12)
    np.testing.assert_array_equal(ts.layers.recut(asked, joined.solution, whole=True).labels, usual)
