"""What a caller can pass by mistake ends in one sentence of ours: seen by the fuzzer, kept small."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.checks import check_items, check_kind, check_numbers
from toposeam.images import as_mask

MOTIF = ts.generate_motif(16, layers=1, iterations=1)
PICTURE = np.random.default_rng(0).random((24, 32, 3))


def test_a_mask_is_true_where_it_is_not_zero():
    mask = np.array([[-1, 0], [0.25, np.nan]])
    np.testing.assert_array_equal(as_mask(mask, (2, 2), "mask"), [[True, False], [True, True]])
    np.testing.assert_array_equal(as_mask(np.int8([[-128, 0]]), (1, 2), "mask"), [[True, False]])


@pytest.mark.parametrize("value", ["x", b"x", ["1"], [[1], [1, 2]], None, object(), 1j, 2**70])
def test_what_is_no_number_is_named(value):
    with pytest.raises(ts.OptionError, match=r"^points is .*; pass numbers$"):
        check_numbers("points", value)


@pytest.mark.parametrize("values", [1, None, "ab", 1.5, 7, [1, "x"]])
def test_what_is_no_sequence_of_a_kind_is_named(values):
    with pytest.raises(ts.OptionError, match="pass whole numbers"):
        check_items("values", values, int, "whole numbers")
    assert check_items("values", iter([1, 2]), int, "whole numbers") == (1, 2)


def test_a_value_that_is_shown_stays_on_one_line():
    with pytest.raises(ts.OptionError) as error:
        check_kind("motif", np.zeros((9, 9)), int, "a Motif")
    assert "\n" not in str(error.value)


@pytest.mark.medium
@pytest.mark.parametrize(
    "call",
    [
        lambda: ts.fill(PICTURE, np.eye(24, 32) > 0, smooth=2**31, patch=4),
        lambda: ts.find_seam(PICTURE, PICTURE, max_iterations=2.5),
        lambda: ts.find_seam(PICTURE, PICTURE, tolerance="x"),
        lambda: ts.find_seam(PICTURE, PICTURE, side=np.ones(2)),
        lambda: ts.synthesize(PICTURE, 32, patch=float("inf")),
        lambda: ts.synthesize(PICTURE, 32, patch="auto"),
        lambda: ts.synthesize(PICTURE, 32, seed=-3),
        lambda: ts.generate_motif(0),
        lambda: ts.generate_motif(32, size=3),
        lambda: ts.motif.random_recipe(32, edge=1.5),
        lambda: ts.motif.random_recipe(32, base=PICTURE, base_law=np.ones((8, 8))),
        lambda: ts.motif.random_recipe(32, base=PICTURE, base_strength="x"),
        lambda: ts.motif.random_recipe(32, strengths=("a", "b")),
        lambda: ts.motif.random_recipe(32, strengths=(1, float("inf"))),
        lambda: ts.join_volumes(None, 0, offset=2, block=4),
        lambda: ts.join_volumes([[["x"]]], np.zeros((4, 4, 4)), offset=(0, 0, 2), block=4),
        lambda: ts.join_volumes(np.array([[1, "a"]], object), 0, offset=(0, 0, 2), block=4),
        lambda: ts.join_volumes(np.ma.ones((4, 4, 4)), np.ones((4, 4, 4)), offset=(0, 0, 2), block=4),
        lambda: ts.join_volumes(np.ones((4, 4)), np.ones((4, 4, 4)), offset=(0, 0, 2), block=4),
        lambda: ts.motif.random_recipe(32, sources=int),
        lambda: ts.make_tileable(PICTURE, band=float("nan")),
        lambda: ts.texture.apply_coordinates(PICTURE, np.zeros((4, 4, 2), int), tileable=(1,)),
        lambda: ts.stitch([PICTURE, PICTURE]),
        lambda: ts.stitch([ts.Layer(PICTURE)] * 2, use_path=3),
        lambda: ts.Layer(PICTURE, alpha=[1, [2]]),
        lambda: ts.layers.common_canvas([]),
        lambda: ts.layers.common_canvas(3),
        lambda: ts.layers.restitch([ts.Layer(PICTURE)] * 2, 3, {}),
        lambda: ts.plan_path((1e9, 1e9), [(1, 1)], [(2, 2)]),
        lambda: ts.plan_path("map", [(1, 1)], [(2, 2)]),
        lambda: ts.plan_path((9, 9), [(1, 1, 1)], [(2, 2)]),
        lambda: ts.plan_path((9, 9), [(1, 1)], [(2, 2)], obstacles=[1, [2]]),
        lambda: ts.path.path_cost(None, PICTURE),
        lambda: ts.seam.draw_seams(PICTURE, 2),
        lambda: ts.seam.draw_seams(PICTURE, [None]),
        lambda: ts.motif.draw_svg(True),
        lambda: ts.repeat(b"x"),
        lambda: ts.motif.border_mismatch(1, 2),
        lambda: ts.motif.arrange([1], (2, 2)),
        lambda: ts.motif.arrange([MOTIF], [1, [2]]),
        lambda: ts.motif.arrange([MOTIF], ("a", "b")),
        lambda: ts.motif.arrange([MOTIF], (float("nan"), 1)),
        lambda: ts.texture.apply_coordinates(PICTURE, [1, [2]]),
        lambda: ts.texture.apply_coordinates(PICTURE, np.zeros((4, 4, 2), int), [1, [2]]),
        lambda: ts.motif.vary(3),
        lambda: ts.motif.palette("fall", {}),
        lambda: ts.vector.smooth_path(PICTURE),
        lambda: ts.seam.seam_verdict((1, 2), PICTURE, PICTURE),
        lambda: ts.vector.read_svg((1, 2)),
        lambda: ts.vector.Polyline("ab"),
        lambda: ts.vector.Polyline(np.ones((4, 2)), closed=np.ones(3)),
        lambda: ts.texture.natural_patch(PICTURE, data_range=[1, [2]]),
    ],
)
def test_wrong_types_and_numbers_are_one_sentence(call):
    with pytest.raises(ts.TopoSeamError) as error:
        call()
    assert "\n" not in str(error.value)
    assert len(str(error.value)) > 15


def test_tones_of_layers_with_unlike_channels_are_matched():
    colour = ts.Layer(np.full((20, 30, 3), 100, np.uint8))
    four = ts.Layer(np.full((20, 30, 4), 121, np.uint8), at=(20, 0))
    assert [layer.image.shape[2] for layer in ts.layers.match_tones([colour, four])] == [3, 4]


SEAM = ts.find_seam(PICTURE, PICTURE)
LAYERS = [ts.Layer(PICTURE), ts.Layer(PICTURE, at=(16, 0))]
#: Twelve gigapixels that take no memory until they are walked through.
ENDLESS = np.broadcast_to(np.float32(0.5), (10**6, 10**6))


@pytest.mark.parametrize(
    ("call", "phrase"),
    [
        (
            lambda: ts.path.path_cost(ts.vector.Polyline([[0, 0], [1e7, 1e7]]), np.ones((20, 20))),
            "keep it within",
        ),
        (
            lambda: ts.path.path_cost(ts.vector.Polyline([[0, 0], [1e300, 0]]), np.ones((20, 20))),
            "keep it within",
        ),
        (lambda: ts.vector.smooth_path(ts.vector.Polyline([[0, 0], [1e11, 1e11]])), "keep it within"),
        (lambda: ts.motif.random_arrangement((10**12, 1), 3), "ask for at most"),
        (lambda: ts.motif.random_arrangement((10**4, 10**4), 3), "ask for at most"),
        (lambda: ts.motif.kaleidoscope(PICTURE, "p1", (10**12, 2)), "ask for at most"),
        (lambda: ts.Layer(PICTURE, data_range=[]), r"data_range is \[\]"),
        (lambda: ts.Layer(PICTURE, data_range=np.ones(2)), "data_range is array"),
        (lambda: ts.find_seam(PICTURE * 1e300, PICTURE, data_range=1e300), "data_range is 1e"),
        (lambda: ts.find_seam(PICTURE, PICTURE, data_range=1e-300), "data_range is 1e-300"),
        (
            lambda: ts.find_seam(np.uint8(PICTURE * 9), np.uint8(PICTURE), data_range=1e-30),
            "data_range is 1e-30",
        ),
        (lambda: ts.find_seam(PICTURE * 1e32, PICTURE, data_range=1e30), "values beyond"),
        (lambda: ts.layers.placed(LAYERS[0], at=(np.inf, 0)), "at is inf"),
        (lambda: ts.layers.placed(LAYERS[0], at=(np.nan, 0)), "at is nan"),
        (lambda: ts.layers.placed(LAYERS[0], at=(0, 0), scale=1e308), "scale is 1e"),
        (lambda: ts.stitch(LAYERS, wrap=2**63), "wrap is 9223372036854775808"),
        (lambda: ts.motif.draw_svg(MOTIF, note={"a": object()}), "pass a mapping of what JSON can hold"),
        (lambda: ts.seam.draw_seams(ENDLESS, []), "more than are taken at once"),
        (lambda: ts.texture.flatten_light(ENDLESS), "more than are taken at once"),
        (lambda: ts.texture.natural_patch(ENDLESS), "more than are taken at once"),
        (lambda: ts.synthesize(ENDLESS, 32), "more than are taken at once"),
    ],
)
def test_what_is_far_too_much_is_refused_at_once(call, phrase):
    with pytest.raises(ts.TopoSeamError, match=phrase):
        call()


@pytest.mark.parametrize(
    "call",
    [
        lambda given: ts.find_seam(PICTURE, PICTURE, progress=given),
        lambda given: ts.stitch(LAYERS, progress=given),
        lambda given: ts.synthesize(PICTURE, 32, progress=given),
        lambda given: ts.synthesize(PICTURE, 32, preview=given),
        lambda given: ts.make_tileable(PICTURE, progress=given),
        lambda given: ts.fill(PICTURE, np.eye(24, 32) > 0, progress=given),
        lambda given: ts.generate_motif(16, progress=given),
        lambda given: ts.solid.generate_solid(MOTIF.recipe, 8, progress=given),
        lambda given: ts.motif.join_motifs([MOTIF.recipe], progress=given),
        lambda given: ts.find_surface(np.ones((4, 4, 4)), np.ones((4, 4, 4)), progress=given),
        lambda given: ts.join_volumes(
            np.ones((4, 4, 4)), np.ones((4, 4, 4)), offset=(0, 0, 2), progress=given
        ),
        lambda given: ts.loop(np.ones((8, 4, 4)), progress=given),
        lambda given: ts.plan_path((8, 8), (1, 1), (6, 6), progress=given),
    ],
)
@pytest.mark.parametrize("given", [3, "x"])
def test_what_cannot_be_called_is_refused_before_work(call, given):
    with pytest.raises(ts.OptionError, match="pass a function, or None"):
        call(given)


def test_numbers_of_few_bits_do_not_overflow():
    rng = np.random.default_rng(0)
    whole = rng.random((40, 80))
    layers = [ts.Layer(whole[:, :50]), ts.Layer(whole[:, 30:], at=(29, 1))]
    assert ts.layers.align(layers, radius=np.int8(8)).layers[1].at == (30, 0)


@pytest.mark.parametrize("reach", [None, 1, 2])
def test_neighbours_in_an_arrangement_are_within_reach(reach):
    grid = ts.motif.random_arrangement((9, 11), 6, seed=3, reach=reach)
    assert set(np.unique(grid)) <= set(range(6))
    for axis in (0, 1):
        assert np.abs(np.diff(grid, axis=axis)).max() <= (reach or 5)
    assert ts.motif.random_arrangement((2, 2), 10**15, seed=3).max() > 10**12
