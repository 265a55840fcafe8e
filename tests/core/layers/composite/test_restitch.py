"""Paths changed by hand, applied to layers that were stitched."""

import numpy as np
import pytest

import toposeam as ts


@pytest.fixture
def layers():
    """Three pictures in a row, 20 px of overlap each; the third begins where the first ends."""
    rng = np.random.default_rng(2)
    return [
        ts.Layer(rng.random((40, 50)), at=(x - 10, 5), name=name)
        for x, name in ((0, "left"), (30, "middle"), (60, "right"))
    ]


def straight(x, width, height=40, name="seam"):
    return ts.vector.SvgSeam((ts.vector.Polyline([(x, 0), (x, height)]),), width, height, None, (name,))


def test_one_pair_is_divided_and_the_rest_stays(layers):
    before = ts.stitch(layers)
    after = ts.layers.restitch(layers, before.masks, {(0, 1): straight(41, 110)})
    assert (after.masks[0].sum(axis=1) == 41).all()
    np.testing.assert_array_equal(after.masks[2], before.masks[2])
    np.testing.assert_array_equal(sum(mask.astype(int) for mask in after.masks), 1)
    assert after.pairs == before.pairs
    assert [seam.method for seam in after.seams] == ["path", "masks"]
    assert after.origin == (-10, 5)
    np.testing.assert_array_equal(after.seams[0].paths[0].points, [[41, 40], [41, 0]])


def test_what_was_found_applied_again_is_the_same(layers):
    before = ts.stitch(layers[:2])
    drawing = ts.vector.read_svg(before.to_svg())
    after = ts.layers.restitch(layers[:2], before.masks, {(0, 1): drawing})
    np.testing.assert_array_equal(after.image, before.image)
    assert after.cost == pytest.approx(before.cost)


def test_strokes_that_ask_for_what_shows_leave_a_path_as_it_is(layers):
    before = ts.stitch(layers[:2])
    path = {(0, 1): straight(41, 80)}
    bent = ts.layers.restitch(layers[:2], before.masks, path)
    fixed = np.full(bent.shape, -1, np.int16)
    fixed[10:20, 35:38] = 0
    after = ts.layers.restitch(layers[:2], before.masks, path, fixed=fixed)
    np.testing.assert_array_equal(after.label_map, bent.label_map)
    assert after.seams[0].settings == bent.seams[0].settings
    assert after.cost == bent.cost


def test_soft_blending_feathers_along_a_path(layers):
    before = ts.stitch(layers[:2])
    path = {(0, 1): straight(41, 80)}
    soft, feather, hard = (
        ts.layers.restitch(layers[:2], before.masks, path, blend=blend).image
        for blend in ("soft", "feather", "none")
    )
    np.testing.assert_array_equal(soft, feather)
    assert (soft != hard).any()


def test_a_path_that_does_not_part_names_the_pair(layers):
    masks = ts.stitch(layers).masks
    drawing = ts.vector.SvgSeam(
        (ts.vector.Polyline([(35, 10), (37, 12), (35, 14)], closed=True),), 110, 40, None, ("x",)
    )
    with pytest.raises(ts.PathError, match="left : middle: the path does not separate"):
        ts.layers.restitch(layers, masks, {(0, 1): drawing})


@pytest.mark.parametrize(
    ("change", "phrase"),
    [
        ({"masks": 2}, "2 masks were given for 3 layers"),
        ({"pair": (0, 7)}, "between layers 0 and 7"),
        ({"width": 99}, "canvas of 99 × 40 px, but the layers make one of 110 × 40"),
    ],
)
def test_what_does_not_fit_is_refused(layers, change, phrase):
    masks = ts.stitch(layers).masks[: change.get("masks", 3)]
    paths = {change.get("pair", (0, 1)): straight(41, change.get("width", 110))}
    with pytest.raises(ts.TopoSeamError, match=phrase):
        ts.layers.restitch(layers, masks, paths)


def test_what_is_cut_out_of_larger_layers_keeps_no_core():
    rng = np.random.default_rng(4)
    layers = [ts.Layer(rng.random((40, 60))), ts.Layer(rng.random((30, 40)), at=(12, 5))]
    masks = [np.zeros((40, 60), bool)] * 2
    cored, free = (
        ts.layers.restitch(layers, masks, {}, cut_out=cut_out).labelling.allowed[0]
        for cut_out in (False, True)
    )
    assert free[6:34, 13:51].all()
    assert not cored[20, 30]
