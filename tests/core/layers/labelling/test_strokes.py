"""Strokes of a brush: where they lie, what they allow, and what they cannot change."""

import dataclasses

import numpy as np
import pytest

import toposeam as ts
from toposeam.layers.canvas import Box, PlaneTransform
from toposeam.layers.labelling import Stroke, apply_strokes

RNG = np.random.default_rng(5)
WHOLE = RNG.random((60, 140))


@pytest.fixture(scope="module")
def joined():
    """Two layers that share columns 40 to 100, and a third one that reaches beyond them."""
    return ts.stitch(
        [
            ts.Layer(WHOLE[:, :100]),
            ts.Layer(WHOLE[:, 40:], at=(40, 0)),
            ts.Layer(RNG.random((50, 90)), at=(55, 20)),
        ]
    )


def stroke(layer, *points, kind="show", radius=5.0):
    return Stroke(points=points, radius=radius, layer=layer, kind=kind)


def allowed_at(labelling, x, y):
    return [k for k in range(len(labelling.places)) if labelling.allowed_in(k, Box(y, x, y + 1, x + 1))[0, 0]]


def mask_of(stroke, canvas, transform=None):
    mask = np.zeros(canvas.shape, bool)
    for box, inside in stroke.on(canvas, transform):
        mask[box.slices] |= inside
    return mask


def test_a_stroke_is_what_lies_within_its_radius(joined):
    mask = mask_of(stroke(1, (10.5, 20.5), (30.5, 40.5)), joined.canvas)
    rows, columns = np.mgrid[:70, :145]
    x, y = columns - 50, rows - 20  # from the first point, on the canvas
    share = np.clip((x + y) / 40, 0, 1)
    np.testing.assert_array_equal(mask, np.hypot(x - 20 * share, y - 20 * share) <= 5)


def test_a_point_is_a_disc(joined):
    mask = mask_of(stroke(0, (20.5, 30.5), radius=4), joined.canvas)
    assert mask[30, 16]
    assert mask[26, 20]
    assert not mask[26, 16]
    assert mask.sum() == 49


def test_strokes_follow_the_warp_of_their_picture(joined):
    twice = PlaneTransform(np.array([[2.0, 0, 10], [0, 2.0, -4], [0, 0, 1]]))
    mask = mask_of(stroke(0, (10, 10), (20, 10), radius=3), joined.canvas, twice)
    rows, columns = np.nonzero(mask)
    # Picture pixel centres 9.5 … 19.5 lie at 29 … 49 on the canvas, the row at 15; the radius is 6 px.
    assert (columns.min(), columns.max(), rows.min(), rows.max()) == (23, 55, 9, 21)


def test_strokes_go_round_a_round_canvas():
    layers = [ts.Layer(RNG.random((40, 80)), at=(70 * k, 0)) for k in range(3)]
    canvas = ts.layers.common_canvas(layers, wrap=210)
    mask = mask_of(stroke(2, (60, 20), (78, 20), radius=3), canvas)  # the layer fills 140 to 220
    assert mask[20, [205, 5]].all()
    assert not mask[20, 30]


def test_shown_means_no_other(joined):
    asked, lost = apply_strokes(joined.labelling, [stroke(0, (70, 30))], joined.canvas)
    assert allowed_at(asked, 70, 30) == [0]
    assert allowed_at(asked, 85, 30) == allowed_at(joined.labelling, 85, 30) == [0, 1, 2]
    assert lost == ()


def test_hidden_means_any_other(joined):
    asked, lost = apply_strokes(joined.labelling, [stroke(0, (70, 30), kind="hide")], joined.canvas)
    assert allowed_at(asked, 70, 30) == [1, 2]
    assert lost == ()


def test_the_later_stroke_wins(joined):
    both = [stroke(0, (70, 30)), stroke(1, (30, 30))]  # both at 70, 30 of the canvas
    assert allowed_at(apply_strokes(joined.labelling, both, joined.canvas)[0], 70, 30) == [1]
    assert allowed_at(apply_strokes(joined.labelling, both[::-1], joined.canvas)[0], 70, 30) == [0]
    hidden = [stroke(0, (70, 30)), stroke(0, (70, 30), kind="hide")]
    assert allowed_at(apply_strokes(joined.labelling, hidden, joined.canvas)[0], 70, 30) == [1, 2]
    shown = apply_strokes(joined.labelling, hidden[::-1], joined.canvas)[0]
    assert allowed_at(shown, 70, 30) == [0]


def test_one_after_another_is_all_at_once(joined):
    strokes = [
        stroke(0, (50, 10), (90, 40)),
        stroke(1, (20, 20), (40, 50), kind="hide"),
        stroke(2, (5, 5), (40, 30)),
        stroke(2, (20, 20), kind="hide"),
    ]
    at_once, _ = apply_strokes(joined.labelling, strokes, joined.canvas)
    one_by_one = joined.labelling
    for one in strokes:
        one_by_one, _ = apply_strokes(one_by_one, [one], joined.canvas)
    for first, second in zip(at_once.allowed, one_by_one.allowed, strict=True):
        np.testing.assert_array_equal(first, second)


def test_strokes_that_change_nothing_are_named(joined):
    strokes = [
        stroke(2, (-40, 20)),  # the layer has no pixels there
        stroke(0, (10, 30), kind="hide"),  # no other one has
        stroke(0, (70, 30)),
        stroke(1, (500, 500), kind="away"),
    ]
    asked, lost = apply_strokes(joined.labelling, strokes, joined.canvas)
    assert lost == (0, 1, 3)
    assert allowed_at(asked, 10, 30) == [0]


def test_seams_keep_away(joined):
    x, y = next((x, y) for _, x, y, *_ in joined.labelling.interfaces(joined.label_map, joined.canvas.box))
    at = int(x[len(x) // 2]), int(y[len(y) // 2])
    asked, _ = apply_strokes(joined.labelling, [stroke(0, at, kind="away", radius=6)], joined.canvas)
    again = ts.layers.recut(asked, joined.solution, whole=True)
    mask = mask_of(stroke(0, at, radius=6), joined.canvas)
    for _, x, y, axis, cost in asked.interfaces(again.labels, joined.canvas.box):
        other = (y, x + 1) if axis else (y + 1, x)
        assert not (mask[y, x] | mask[other])[cost > 0].any()


def test_a_seam_that_finds_no_way_round_runs_through_a_stroke():
    layers = [ts.Layer(WHOLE[:, :100]), ts.Layer(WHOLE[:, 40:], at=(40, 0))]
    across = stroke(0, (30, 30), (110, 30), kind="away", radius=8)
    labels = np.asarray(ts.stitch(layers, strokes=[across]).label_map)
    assert labels[30, 10] == 0
    assert labels[30, 130] == 1
    avoid = mask_of(across, ts.stitch(layers).canvas)
    with pytest.raises(ts.OverlapError, match="no seam avoids"):  # of pixels it is stated
        ts.stitch(layers, avoid=avoid)


def test_the_problem_given_stays_as_it_is(joined):
    before = [mask.copy() for mask in joined.labelling.allowed]
    apply_strokes(joined.labelling, [stroke(0, (70, 30)), stroke(1, (20, 20), kind="away")], joined.canvas)
    for mask, kept in zip(joined.labelling.allowed, before, strict=True):
        np.testing.assert_array_equal(mask, kept)


def test_interfaces_cost_what_the_seams_do(joined):
    labelling, labels = joined.labelling, np.asarray(joined.label_map)
    costs = [cost.sum(dtype=float) for *_, cost in labelling.interfaces(labels, labelling.canvas)]
    assert sum(costs) == pytest.approx(labelling.total(labels, labelling.canvas))


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"points": [[1, 2, 3]]}, "points"),
        ({"points": []}, "points"),
        ({"points": "a"}, "points"),
        ({"points": [[1, np.nan]]}, "points"),
        ({"points": [[1, 1e9]]}, "points"),
        ({"radius": 0}, "radius"),
        ({"radius": float("inf")}, "radius"),
        ({"layer": -1}, "layer"),
        ({"layer": 1.5}, "layer"),
        ({"kind": "erase"}, "kind"),
    ],
)
def test_strokes_out_of_range(change, error):
    with pytest.raises(ts.OptionError, match=error):
        dataclasses.replace(stroke(0, (1, 2)), **change)


def test_strokes_of_no_layer(joined):
    with pytest.raises(ts.OptionError, match="layer 3"):
        apply_strokes(joined.labelling, [stroke(3, (1, 2))], joined.canvas)
    with pytest.raises(ts.OptionError, match="2 transforms"):
        apply_strokes(joined.labelling, [stroke(0, (1, 2))], joined.canvas, [None, None])
