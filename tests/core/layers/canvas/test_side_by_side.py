"""Two layers placed by how far they overlap."""

from __future__ import annotations

import numpy as np
import pytest

import toposeam as ts


def places(overlap, side, a=(30, 40), b=(20, 50)):
    layers = ts.layers.overlapping(np.zeros(a), np.zeros(b), overlap=overlap, side=side)
    return [ts.layers.common_canvas(layers).place(layer) for layer in layers]


@pytest.mark.parametrize("overlap", [8, 8.0, "20%", "20 %", np.int64(8)])
@pytest.mark.parametrize(("side", "across"), [("right", 1), ("left", 1)])
def test_neighbours_share_the_overlap_on_the_side_of_b(overlap, side, across):
    a, b = places(overlap, side)
    assert a.shared(b).shape == (20, 8)
    assert (b.left > a.left) == (side == "right")
    assert a.top == b.top == 0


@pytest.mark.parametrize("side", ["top", "bottom"])
def test_they_share_so_many_rows_below_or_above(side):
    a, b = places("50%", side, b=(35, 50))
    assert a.shared(b).shape == (15, 40)
    assert (b.top > a.top) == (side == "bottom")
    assert a.left == b.left == 0


def test_layers_keep_what_they_are_and_the_first_one_its_place():
    first = ts.Layer(image=np.zeros((5, 9)), name="map")
    second = ts.Layer(image=np.ones((5, 9)), alpha=np.ones((5, 9)))
    a, b = ts.layers.overlapping(first, second, overlap=4)
    assert a is first
    assert b.alpha is second.alpha


def test_they_are_stitched_at_once():
    rng = np.random.default_rng(0)
    a, b = rng.random((2, 30, 40, 3))
    stitched = ts.stitch(ts.layers.overlapping(a, b, overlap="25%"))
    assert stitched.image.shape == (30, 70, 3)
    np.testing.assert_array_equal(stitched.image[:, :30], a[:, :30])
    np.testing.assert_array_equal(stitched.image[:, 40:], b[:, 10:])


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"overlap": 0}, "choose 1 to 9 px"),
        ({"overlap": 10}, "choose 1 to 9 px"),
        ({"overlap": 2.5}, "whole"),
        ({"overlap": "12"}, "'25%'"),
        ({"overlap": "101%"}, "a share"),
        ({"overlap": None}, "number"),
        ({"overlap": 3, "side": "up"}, "choose one of"),
    ],
)
def test_what_is_no_overlap_is_refused(options, text):
    with pytest.raises(ts.OptionError, match=text):
        ts.layers.overlapping(np.zeros((5, 9)), np.zeros((5, 9)), **options)
