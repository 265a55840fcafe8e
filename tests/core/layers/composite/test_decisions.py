"""Where a round canvas is cut, where it begins, whether seams close over its edge, and which layer a closed
path leaves to show.
"""

import numpy as np
import pytest

import toposeam as ts
from toposeam.layers.canvas import common_canvas, narrowed

PERIOD = 360


def columns(start, stop, period):
    """A layer on a round canvas with pixels from one column up to another one, on either side of the edge."""
    alpha = np.zeros((4, period), np.uint8)
    alpha[:, np.arange(start, stop) % period] = 255
    return ts.Layer(np.zeros((4, period), np.uint8), alpha=alpha)


@pytest.mark.parametrize("turn", [0, 10, 30, 50, 70, 90])
def test_a_round_canvas_is_cut_in_its_widest_run(turn):
    """In 20, in 40 and in 14 columns in turn only one layer lies. A layer that lies at both edges and, apart,
    near the left one is put together over the edge, without the wider one of its two gaps.
    """
    layers = [columns(start + turn, stop + turn, 100) for start, stop in ((76, 106), (0, 36), (26, 86))]
    assert common_canvas(layers, wrap=100).sparsest_column() == ((56 + turn) % 100, 1)
    alpha = np.zeros((4, 100), np.uint8)
    alpha[:, :10] = alpha[:, 20:30] = alpha[:, 90:] = 255
    apart = ts.Layer(np.broadcast_to(np.arange(100, dtype=np.uint8), (4, 100)), alpha=alpha)
    whole = narrowed(apart, 100)
    assert whole.at == (90, 0)
    assert np.asarray(whole.image)[0, [0, 10, 39]].tolist() == [90, 0, 29]


@pytest.mark.parametrize(
    ("first", "origin"),
    [(0, 0), (30, 0), (-40, -40), (100, 100)],
    ids=["at 0", "right of 0", "left of 0", "over the end"],
)
def test_a_round_canvas_begins_at_0_where_all_layers_lie_on_it(first, origin):
    """Else it begins at the leftmost layer."""
    scene = np.random.default_rng(0).integers(0, 256, (30, PERIOD), np.uint8)
    layers = [ts.Layer(scene[:, x : x + 130], at=(first + x, 7), name=str(x)) for x in (0, 100, 200)]
    stitched = ts.stitch(layers, wrap=PERIOD)
    assert stitched.origin == (origin, 7)
    np.testing.assert_array_equal(stitched.image[:, first - origin : first - origin + 100], scene[:, :100])


def test_a_seam_cut_with_its_canvas_closes_over_the_edge():
    """Two layers all the way round agree along one row on the right, along another one on the left, along
    both beside the left edge, and between them at two columns. Cut open, the seam would take the left one's
    row up to the edge, where it does not meet that on the right.
    """
    first = np.random.default_rng(0).integers(80, 120, (60, PERIOD)).astype(np.uint8)
    unlike = np.full((60, PERIOD), 90, np.uint8)
    unlike[19:22, :180] = unlike[24:27, 180:] = unlike[24:27, :12] = 0
    unlike[19:27, 9:12] = unlike[19:27, 179:182] = 0
    layers = [ts.Layer(first[:50]), ts.Layer((first + unlike)[10:], at=(0, 10))]
    heights = (ts.stitch(layers, wrap=PERIOD).label_map == 0).sum(axis=0)
    assert set(heights[12:179]) <= {20, 21}
    assert set(np.r_[heights[:9], heights[182:]]) <= {25, 26}


@pytest.mark.parametrize("inner", [0, 1])
def test_a_closed_path_leaves_the_layer_inside_to_show_in_it(inner):
    """One layer lies wholly in the other, and the path is nearer to its border than to its middle."""
    rng = np.random.default_rng(1)
    layers = [ts.Layer(rng.random((60, 70)), name="outer")]
    layers.insert(inner, ts.Layer(rng.random((40, 40)), at=(15, 10), name="inner"))
    ring = ts.vector.Polyline([(18, 13), (24, 13), (24, 19), (18, 19)], closed=True)
    path = ts.vector.SvgSeam((ring,), 70, 60, None, ("seam",))
    joined = ts.layers.restitch(layers, ts.stitch(layers).masks, {(0, 1): path})
    expected = np.zeros((60, 70), bool)
    expected[13:19, 18:24] = True
    np.testing.assert_array_equal(joined.masks[inner], expected)
