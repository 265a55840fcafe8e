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
        lambda: ts.random_recipe(32, edge=1.5),
        lambda: ts.random_recipe(32, base=PICTURE, base_law=np.ones((8, 8))),
        lambda: ts.random_recipe(32, base=PICTURE, base_strength="x"),
        lambda: ts.random_recipe(32, strengths=("a", "b")),
        lambda: ts.random_recipe(32, strengths=(1, float("inf"))),
        lambda: ts.join_volumes(None, 0, offset=2, block=4),
        lambda: ts.join_volumes([[["x"]]], np.zeros((4, 4, 4)), offset=(0, 0, 2), block=4),
        lambda: ts.join_volumes(np.array([[1, "a"]], object), 0, offset=(0, 0, 2), block=4),
        lambda: ts.join_volumes(np.ma.ones((4, 4, 4)), np.ones((4, 4, 4)), offset=(0, 0, 2), block=4),
        lambda: ts.join_volumes(np.ones((4, 4)), np.ones((4, 4, 4)), offset=(0, 0, 2), block=4),
        lambda: ts.random_recipe(32, sources=int),
        lambda: ts.make_tileable(PICTURE, band=float("nan")),
        lambda: ts.apply_coordinates(PICTURE, np.zeros((4, 4, 2), int), tileable=(1,)),
        lambda: ts.stitch([PICTURE, PICTURE]),
        lambda: ts.stitch([ts.Layer(PICTURE)] * 2, use_path=3),
        lambda: ts.Layer(PICTURE, alpha=[1, [2]]),
        lambda: ts.common_canvas([]),
        lambda: ts.common_canvas(3),
        lambda: ts.restitch([ts.Layer(PICTURE)] * 2, 3, {}),
        lambda: ts.plan_path((1e9, 1e9), [(1, 1)], [(2, 2)]),
        lambda: ts.plan_path("map", [(1, 1)], [(2, 2)]),
        lambda: ts.plan_path((9, 9), [(1, 1, 1)], [(2, 2)]),
        lambda: ts.plan_path((9, 9), [(1, 1)], [(2, 2)], obstacles=[1, [2]]),
        lambda: ts.path_cost(None, PICTURE),
        lambda: ts.draw_seams(PICTURE, 2),
        lambda: ts.draw_seams(PICTURE, [None]),
        lambda: ts.draw_svg(True),
        lambda: ts.repeat(b"x"),
        lambda: ts.border_mismatch(1, 2),
        lambda: ts.arrange([1], (2, 2)),
        lambda: ts.arrange([MOTIF], [1, [2]]),
        lambda: ts.arrange([MOTIF], ("a", "b")),
        lambda: ts.arrange([MOTIF], (float("nan"), 1)),
        lambda: ts.apply_coordinates(PICTURE, [1, [2]]),
        lambda: ts.apply_coordinates(PICTURE, np.zeros((4, 4, 2), int), [1, [2]]),
        lambda: ts.vary(3),
        lambda: ts.palette("fall", {}),
        lambda: ts.smooth_path(PICTURE),
        lambda: ts.seam_verdict((1, 2), PICTURE, PICTURE),
        lambda: ts.read_svg((1, 2)),
        lambda: ts.Polyline("ab"),
        lambda: ts.Polyline(np.ones((4, 2)), closed=np.ones(3)),
        lambda: ts.natural_patch(PICTURE, data_range=[1, [2]]),
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
    assert [layer.image.shape[2] for layer in ts.match_tones([colour, four])] == [3, 4]
