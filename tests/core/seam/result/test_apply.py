"""Labels from paths that were bent by hand."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import ndimage

from toposeam.errors import OptionError, PathError
from toposeam.seam.result import labels_from_paths
from toposeam.seam.result.apply import _Cut
from toposeam.vector.polyline import Polyline, trace_boundary

A, B, FREE, NONE = 0, 1, 2, 3


def strip(height=20, width=12):
    """An overlap that fills the picture, a on the left and b on the right: overlap, side."""
    side = np.full((height, width), FREE, np.uint8)
    side[:, 0], side[:, -1] = A, B
    return np.ones(side.shape, bool), side


def diagonal_patches():
    """Two rectangles that overlap by their corners, overlap pixels beside only one patch fixed: overlap,
    side.
    """
    a, b = np.zeros((30, 40), bool), np.zeros((30, 40), bool)
    a[2:22, 2:26] = True
    b[9:28, 12:38] = True
    return between(a, b)


def between(a, b):
    overlap = a & b
    side = np.full(a.shape, NONE, np.uint8)
    side[a], side[b] = A, B
    cross = ndimage.generate_binary_structure(2, 1)
    beside_a, beside_b = (ndimage.binary_dilation(ground, cross) & overlap for ground in (a & ~b, b & ~a))
    side[overlap] = FREE
    side[beside_a & ~beside_b], side[beside_b & ~beside_a] = A, B
    return overlap, side


def drawn(*points, closed=False):
    return Polyline(np.array(points, float), closed)


def assert_round_trip(labels, overlap, side, valid=None):
    """Tracing valid labels and applying the paths changes nothing."""
    labels = np.where(side == FREE, labels, side == B)
    paths = trace_boundary(labels, overlap if valid is None else valid)
    np.testing.assert_array_equal(labels_from_paths(paths, overlap, side), labels)
    return paths


# --- round trips


def test_seam_of_a_strip_survives():
    overlap, side = strip()
    rng = np.random.default_rng(0)
    across = np.clip(6 + np.cumsum(rng.integers(-2, 3, 20)), 1, 11)
    assert len(assert_round_trip(np.arange(12) >= across[:, np.newaxis], overlap, side)) == 1


def test_seam_of_an_l_shaped_overlap_survives():
    overlap = np.zeros((30, 30), bool)
    overlap[:, :10] = overlap[:10] = True
    side = np.full(overlap.shape, B, np.uint8)
    side[overlap] = FREE
    side[0], side[:, 0] = A, A
    y, x = np.indices(overlap.shape)
    assert len(assert_round_trip(np.minimum(x, y) > 4 + (x + y) % 3 // 2, overlap, side)) >= 1


def test_closed_seam_of_a_ring_survives():
    y, x = np.indices((40, 40)) - 19.5
    radius = np.hypot(x, y)
    overlap = (radius > 6) & (radius < 18)
    side = np.where(radius <= 6, B, A).astype(np.uint8)
    side[overlap] = FREE
    paths = assert_round_trip(radius < 11 + np.sin(3 * np.arctan2(y, x)), overlap, side)
    assert [path.closed for path in paths] == [True]


def test_several_seams_survive():
    # b lies across a like a plank: one seam on each side of it, and a second gap further right
    side = np.full((20, 50), NONE, np.uint8)
    side[:, :22], side[:, 28:] = FREE, FREE
    side[:, 0], side[:, 21], side[:, 10:12] = A, A, B
    side[:, 28], side[:, 49] = B, A
    overlap = np.ones(side.shape, bool)
    overlap[:, 22:28] = False
    x = np.indices(side.shape)[1]
    paths = assert_round_trip(((x > 4) & (x < 17)) | ((x >= 28) & (x < 40)), overlap, side)
    assert len(paths) == 3


def test_overlap_one_pixel_wide_survives():
    side = np.full((8, 7), NONE, np.uint8)
    side[:, 1:3], side[:, 3], side[:, 4:6] = A, FREE, B
    labels = np.arange(8)[:, np.newaxis] % 3 == np.zeros(7)
    assert_round_trip(labels, side == FREE, side, valid=side != NONE)


def test_seam_of_patches_that_overlap_by_a_corner_survives():
    overlap, side = diagonal_patches()
    y, x = np.indices(side.shape)
    assert_round_trip((x - 12) * 13 + (y - 9) * 14 > 13 * 13, overlap, side, valid=side != NONE)


@pytest.mark.medium
@settings(deadline=None)
@given(st.data())
def test_any_labels_with_a_fixed_pixel_per_component_survive(data):
    shape = data.draw(st.tuples(st.integers(1, 8), st.integers(1, 8)))
    labels, overlap = data.draw(hnp.arrays(bool, shape)), data.draw(hnp.arrays(bool, shape))
    fixed = data.draw(hnp.arrays(bool, shape)) & data.draw(hnp.arrays(bool, shape)) & overlap
    component, count = ndimage.label(overlap)
    for index in range(1, count + 1):
        fixed.ravel()[np.flatnonzero(component == index)[0]] = True
    side = np.where(overlap, FREE, NONE).astype(np.uint8)
    side[fixed] = labels[fixed]
    assert_round_trip(labels, overlap, side)


@pytest.mark.medium
@settings(deadline=None)
@given(st.integers(0, 3), st.booleans(), st.integers(0, 2**32 - 1))
def test_rotated_or_mirrored_paths_give_such_labels(turns, flip, seed):
    rng = np.random.default_rng(seed)
    overlap, side = strip(9, 9)
    across = np.clip(4 + np.cumsum(rng.integers(-2, 3, 9)), 1, 8)
    labels = np.arange(9) >= across[:, np.newaxis]
    labels, side = (np.rot90(array, turns) for array in (labels, side))
    if flip:
        labels, side = labels.T, side.T
    assert_round_trip(labels, overlap, side)


# --- exactness


@pytest.mark.parametrize("slope", [-0.3, -0.05, 0.0, 0.1, 0.25])
def test_straight_line_gives_a_half_plane(slope):
    overlap, side = strip(21, 30)
    y, x = np.indices(side.shape) + 0.5
    line = drawn([15.2 + slope * -5, -5], [15.2 + slope * 30, 30])
    expected = np.where(side == FREE, x > 15.2 + slope * y, side == B)
    np.testing.assert_array_equal(labels_from_paths([line], overlap, side), expected)


def centres_inside(points, shape):
    """Even-odd rule for pixel centres moved by 1/1024 px, exactly, an edge right on a centre being right of
    it: the plain reference.
    """
    inside = np.zeros(shape, bool)
    corners = [[Fraction(round(value * 512), 512) for value in point] for point in points]
    for row in range(shape[0]):
        for column in range(shape[1]):
            x, y = Fraction(column * 1024 + 513, 1024), Fraction(row * 1024 + 513, 1024)
            for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
                if (ay > y) != (by > y) and x > ax + (y - ay) / (by - ay) * (bx - ax):
                    inside[row, column] ^= True
    return inside


coordinates = st.one_of(
    st.integers(-3, 12), st.integers(-6, 24).map(lambda value: value / 2), st.floats(-4, 13)
)


@pytest.mark.medium
@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=8))
def test_any_closed_path_follows_the_even_odd_rule(points):
    # One fixed pixel far away stands for "outside".
    side = np.full((10, 16), FREE, np.uint8)
    side[0, 15] = A
    expected = centres_inside(points, side.shape)
    np.testing.assert_array_equal(
        labels_from_paths([Polyline(points, closed=True)], np.ones(side.shape, bool), side), expected
    )


def test_path_along_pixel_centres_does_not_leak():
    overlap, side = strip(12, 12)
    for line in (
        drawn([0.5, 0.5], [11.5, 11.5]),
        drawn([11.5, 0.5], [0.5, 11.5]),
        drawn([6.5, 0], [6.5, 12]),
        drawn([3.5, 0.5], [8.5, 11.5]),
    ):
        labels = labels_from_paths([line], overlap, side)
        inner = labels[1:-1]
        assert (inner[:, 1:] >= inner[:, :-1]).all()  # a, then b, in every row


def test_path_reversed_or_with_points_added_changes_nothing():
    overlap, side = strip()
    line = drawn([6.3, 0], [4.1, 7.7], [8.2, 13.1], [5, 20])
    expected = labels_from_paths([line], overlap, side)
    share = np.linspace(0, 1, 9)[:, np.newaxis]
    dense = np.concatenate(
        [p + share * (q - p) for p, q in zip(line.points[:-1], line.points[1:], strict=True)]
    )
    for other in (line.points[::-1], dense, np.repeat(line.points, 3, axis=0)):
        np.testing.assert_array_equal(labels_from_paths([Polyline(other)], overlap, side), expected)


# --- what a hand does


def test_ends_that_stop_short_are_extended_straight_on():
    overlap, side = strip()
    expected = labels_from_paths([drawn([5, -1], [7, 21])], overlap, side)
    np.testing.assert_array_equal(
        labels_from_paths([drawn([5 + 2 * 5 / 22, 4], [5 + 2 * 15 / 22, 14])], overlap, side), expected
    )


def test_extension_leaves_the_other_arm_of_an_l_alone():
    overlap = np.zeros((30, 30), bool)
    overlap[:10, :] = overlap[:, :10] = True
    overlap[20:, :] = True  # a U: the third arm lies below the first
    side = np.where(overlap, FREE, NONE).astype(np.uint8)
    side[:, 0] = A
    side[:10, 29], side[20:, 29] = B, B
    upper, lower = drawn([20, 0], [20, 9]), drawn([15, 21], [15, 30])
    labels = labels_from_paths([upper, lower], overlap, side)
    x = np.indices(side.shape)[1]
    np.testing.assert_array_equal(
        labels, overlap & np.where(np.arange(30)[:, np.newaxis] < 15, x >= 20, x >= 15)
    )


def test_path_that_stops_in_a_hole_goes_on_behind_it():
    overlap, side = strip(30, 20)
    overlap[12:15, 9:12], side[12:15, 9:12] = False, NONE
    labels = labels_from_paths([drawn([10, 0], [10, 13])], overlap, side)
    np.testing.assert_array_equal(
        labels, np.where(side == NONE, False, np.arange(20) >= np.full((30, 1), 10))
    )


def test_path_bent_over_the_edge_stops_at_the_fixed_pixels():
    overlap, side = strip()
    labels = labels_from_paths([drawn([6, 0], [6, 6], [-4, 8], [-4, 11], [6, 13], [6, 20])], overlap, side)
    assert not labels[:, 0].any()
    assert labels[9, 1:].all()
    np.testing.assert_array_equal(labels[:5], np.arange(12) >= np.full((5, 1), 6))


def test_a_path_narrowly_missing_the_corner_is_understood():
    overlap, side = diagonal_patches()
    labels = labels_from_paths([drawn([22, 7], [18, 15], [14, 23])], overlap, side)
    np.testing.assert_array_equal(labels[side != FREE], side[side != FREE] == B)
    assert labels[12, 24]
    assert labels[16, 24]
    assert not labels[16, 14]


def test_path_need_not_go_round_specks_in_a_mask():
    overlap, side = strip(100, 40)
    side[10, 30], side[60, 33], side[80, 5] = A, A, B
    labels = labels_from_paths([drawn([20, 0], [20, 100])], overlap, side)
    np.testing.assert_array_equal(
        labels, np.where(side == FREE, np.arange(40) >= np.full((100, 1), 20), side == B)
    )


def test_nested_isolated_loops_alternate_the_two_patches():
    overlap, side = strip(20, 30)
    seam = drawn([25, 0], [25, 20])
    outer = drawn([4, 4], [20, 4], [20, 16], [4, 16], closed=True)
    inner = drawn([8, 8], [14, 8], [14, 12], [8, 12], closed=True)
    labels = labels_from_paths([seam, outer, inner], overlap, side)
    expected = np.arange(30) >= np.full((20, 1), 25)
    expected[4:16, 4:20] = True
    expected[8:12, 8:14] = False
    np.testing.assert_array_equal(labels, expected)


def test_open_path_whose_ends_meet_is_a_loop():
    overlap, side = strip()
    seam = drawn([9, 0], [9, 20])
    loop = [3, 3], [6, 3], [6, 8], [3, 8]
    expected = labels_from_paths([seam, drawn(*loop, closed=True)], overlap, side)
    np.testing.assert_array_equal(labels_from_paths([seam, drawn(*loop, loop[0])], overlap, side), expected)


def test_an_overlap_without_ground_shows_a_in_the_largest_part():
    side = np.full((6, 10), FREE, np.uint8)
    labels = labels_from_paths([drawn([7, 0], [7, 6])], np.ones(side.shape, bool), side)
    np.testing.assert_array_equal(labels, np.arange(10) >= np.full((6, 1), 7))


def test_picture_without_free_pixels_keeps_its_sides():
    side = np.array([[A, B, NONE]], np.uint8)
    assert labels_from_paths([], np.zeros(side.shape, bool), side).tolist() == [[False, True, False]]


def test_empty_picture_is_no_problem():
    assert labels_from_paths([], np.zeros((0, 5), bool), np.zeros((0, 5), np.uint8)).shape == (0, 5)


def test_ground_of_one_patch_only_needs_no_path():
    side = np.full((4, 5), FREE, np.uint8)
    side[:, 0] = B
    assert labels_from_paths([], np.ones(side.shape, bool), side).all()


# --- what cannot be understood

DOES_NOT_SEPARATE = {
    "no path": [],
    "beside the overlap": [drawn([-9, 0], [-9, 20])],
    "in and out at the same end": [drawn([4, -1], [4, 9], [8, 9], [8, -1])],
    "out through the side": [drawn([6, -1], [6, 3], [-5, 3])],
    "twice the same": [drawn([6, 0], [6, 20]), drawn([6, 0], [6, 20])],
    "across instead of along": [drawn([-1, 10], [13, 10])],
    "a loop only": [drawn([4, 4], [8, 4], [8, 9], closed=True)],
}


@pytest.mark.parametrize("paths", DOES_NOT_SEPARATE.values(), ids=DOES_NOT_SEPARATE.keys())
def test_path_that_does_not_separate_the_patches_is_refused(paths):
    overlap, side = strip()
    with pytest.raises(
        PathError, match=r"does not separate the patches: along \d+ of \d+ px .* draw it right across"
    ):
        labels_from_paths(paths, overlap, side)


def test_each_gap_needs_its_own_path():
    side = np.full((20, 30), NONE, np.uint8)
    side[:, :12], side[:, 18:] = FREE, FREE
    side[:, 0], side[:, 11], side[:, 18], side[:, 29] = A, B, A, B
    overlap = side != NONE
    with pytest.raises(PathError, match="20 of 20 px"):
        labels_from_paths([drawn([6, 0], [6, 20])], overlap, side)
    labels_from_paths([drawn([6, 0], [6, 20]), drawn([24, 0], [24, 20])], overlap, side)


def test_closed_seam_that_was_pulled_off_its_ring_is_refused():
    y, x = np.indices((40, 40)) - 19.5
    radius = np.hypot(x, y)
    side = np.where(radius <= 6, B, np.where(radius < 18, FREE, A)).astype(np.uint8)
    ring = np.array([[np.cos(t), np.sin(t)] for t in np.linspace(0, 2 * np.pi, 40)]) * 12 + 20
    assert labels_from_paths([Polyline(ring[:-1], closed=True)], side == FREE, side)[20, 10]
    with pytest.raises(PathError, match="patch b"):
        labels_from_paths([Polyline(ring[:-1] + 100, closed=True)], side == FREE, side)


def test_path_in_another_country_is_refused():
    overlap, side = strip()
    with pytest.raises(PathError, match="px from the upper left corner"):
        labels_from_paths([drawn([6, 0], [6, 1e12])], overlap, side)


@pytest.mark.parametrize("shape", [(3, 4), (4, 3, 1), (4,)])
def test_shapes_that_do_not_fit_are_refused(shape):
    with pytest.raises(OptionError, match="shape"):
        labels_from_paths([], np.ones((4, 3), bool), np.zeros(shape, np.uint8))


def test_unknown_side_is_refused():
    with pytest.raises(OptionError, match="value 4"):
        labels_from_paths([], np.ones((1, 1), bool), np.full((1, 1), 4, np.uint8))


def test_a_short_edge_counts_where_all_are_short():
    """Three rows: no edge is as long as a speck may be, and yet the path has to part them."""
    overlap, side = strip(3, 12)
    labels_from_paths([drawn([6, 0], [6, 3])], overlap, side)
    with pytest.raises(PathError, match="of 3 px"):
        labels_from_paths([drawn([0, 1], [12, 1])], overlap, side)


def test_a_path_beyond_the_window_keeps_nothing_in_it_apart():
    cut = _Cut([np.array([[5.7, -1.0], [5.7, 9.0]])], (4, 5))
    assert not cut.right.any()
    assert not cut.down.any()
    assert (_Cut([np.array([[3.7, -1.0], [3.7, 9.0]])], (4, 5)).right == [0, 0, 0, 1, 0]).all()
