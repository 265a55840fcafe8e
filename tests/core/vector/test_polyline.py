"""Boundaries of label maps as lines through pixel corners."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from toposeam.errors import OptionError, PathError
from toposeam.vector.polyline import Polyline, check_length, trace_boundary


def everywhere(labels):
    return np.ones(labels.shape, bool)


def points(polyline):
    return polyline.points.tolist()


def picture(text):
    """Rows of `#` (True) and anything else (False)."""
    return np.array([[character == "#" for character in row] for row in text.split()])


def test_straight_boundary_is_two_points():
    labels = np.zeros((4, 6), bool)
    labels[:, 2:] = True
    (line,) = trace_boundary(labels, everywhere(labels))
    assert not line.closed
    assert points(line) == [[2, 4], [2, 0]]  # upwards: True is on the right


def test_step_has_only_its_turning_points():
    labels = picture("..### ..### .#### .####")
    (line,) = trace_boundary(labels, everywhere(labels))
    assert points(line) == [[1, 4], [1, 2], [2, 2], [2, 0]]


def test_single_pixel_is_a_closed_clockwise_square():
    labels = picture("... .#. ...")
    (line,) = trace_boundary(labels, everywhere(labels))
    assert line.closed
    assert points(line) == [[1, 1], [2, 1], [2, 2], [1, 2]]


def test_hole_runs_the_other_way_round():
    labels = ~picture("... .#. ...")
    (line,) = trace_boundary(labels, everywhere(labels))
    assert points(line) == [[1, 1], [1, 2], [2, 2], [2, 1]]


def test_diagonal_pixels_give_two_paths_that_touch():
    labels = picture(".... .#.. ..#. ....")
    lines = trace_boundary(labels, everywhere(labels))
    assert [points(line) for line in lines] == [
        [[1, 1], [2, 1], [2, 2], [1, 2]],
        [[2, 2], [3, 2], [3, 3], [2, 3]],
    ]
    assert all(line.closed for line in lines)


def test_four_way_corner_between_open_paths_does_not_cross():
    labels = picture("#. .#")
    lines = trace_boundary(labels, everywhere(labels))
    assert [points(line) for line in lines] == [[[1, 0], [1, 1], [0, 1]], [[1, 2], [1, 1], [2, 1]]]


def test_boundary_stops_where_pixels_are_not_valid():
    labels = np.zeros((6, 4), bool)
    labels[:, 2:] = True
    valid = everywhere(labels)
    valid[2, 1] = False
    lines = trace_boundary(labels, valid)
    assert [points(line) for line in lines] == [[[2, 2], [2, 0]], [[2, 6], [2, 3]]]


def test_labels_of_invalid_pixels_do_not_matter():
    rng = np.random.default_rng(1)
    labels, valid = rng.random((20, 20)) < 0.5, rng.random((20, 20)) < 0.7
    first = trace_boundary(labels, valid)
    second = trace_boundary(labels ^ (~valid & (rng.random((20, 20)) < 0.5)), valid)
    assert [points(line) for line in first] == [points(line) for line in second]


@pytest.mark.parametrize("shape", [(1, 1), (0, 0), (0, 5), (5, 0), (1, 7), (7, 1), (4, 4)])
def test_uniform_labels_have_no_boundary(shape):
    for labels in (np.zeros(shape, bool), np.ones(shape, bool)):
        assert trace_boundary(labels, np.ones(shape, bool)) == []


def test_shapes_that_differ_are_refused():
    with pytest.raises(OptionError, match=r"\(2, 2\).*\(3, 2\)"):
        trace_boundary(np.zeros((2, 2), bool), np.zeros((3, 2), bool))


label_maps = hnp.arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 9)))


def unit_edges(polyline):
    """The unit edges of a path, directed, as (x, y, dx, dy)."""
    outline = polyline.outline.astype(int)
    edges = []
    for (x, y), (u, v) in pairwise(outline):
        length = abs(u - x) + abs(v - y)
        dx, dy = (u - x) // length, (v - y) // length
        edges += [(x + k * dx, y + k * dy, dx, dy) for k in range(length)]
    return edges


@settings(deadline=None)
@given(st.data())
def test_paths_trace_the_boundary_with_true_on_the_right(data):
    labels = data.draw(label_maps)
    valid = data.draw(hnp.arrays(bool, labels.shape))
    height, width = labels.shape
    expected = set()
    for y in range(height):
        for x in range(1, width):
            if valid[y, x] and valid[y, x - 1] and labels[y, x] != labels[y, x - 1]:
                expected.add((x, y + 1, 0, -1) if labels[y, x] else (x, y, 0, 1))
    for y in range(1, height):
        for x in range(width):
            if valid[y, x] and valid[y - 1, x] and labels[y, x] != labels[y - 1, x]:
                expected.add((x, y, 1, 0) if labels[y, x] else (x + 1, y, -1, 0))
    traced = [edge for line in trace_boundary(labels, valid) for edge in unit_edges(line)]
    assert len(traced) == len(set(traced))
    assert set(traced) == expected


@settings(deadline=None)
@given(label_maps)
def test_every_point_is_a_turning_point_or_an_end(labels):
    for line in trace_boundary(labels, np.ones(labels.shape, bool)):
        outline = np.concatenate([line.outline, line.points[1:2]]) if line.closed else line.points
        steps = np.sign(np.diff(outline, axis=0))
        assert not (steps[1:] == steps[:-1]).all(axis=1).any()
        assert (np.abs(steps).sum(axis=1) == 1).all()


@settings(deadline=None)
@given(label_maps)
def test_open_paths_end_on_the_border_when_all_pixels_are_valid(labels):
    height, width = labels.shape
    for line in trace_boundary(labels, np.ones(labels.shape, bool)):
        if not line.closed:
            for x, y in line.points[[0, -1]]:
                assert x in (0, width) or y in (0, height)


@settings(deadline=None)
@given(label_maps)
def test_swapped_labels_give_the_same_boundary_reversed(labels):
    valid = np.ones(labels.shape, bool)
    forth = {edge for line in trace_boundary(labels, valid) for edge in unit_edges(line)}
    back = {
        (x + dx, y + dy, -dx, -dy)
        for line in trace_boundary(~labels, valid)
        for x, y, dx, dy in unit_edges(line)
    }
    assert forth == back


def test_long_seam_in_a_large_map_is_one_line():
    rng = np.random.default_rng(0)
    across = np.clip(np.cumsum(rng.integers(-3, 4, 4000)) + 2000, 1, 3999)
    labels = np.arange(4000) >= across[:, np.newaxis]
    valid = np.ones(labels.shape, bool)
    (line,) = trace_boundary(labels, valid)
    assert np.abs(np.diff(line.points, axis=0)).sum() == 4000 + np.abs(np.diff(across)).sum()


def test_polyline_keeps_a_read_only_copy():
    source = np.array([[0, 0], [1, 2]])
    line = Polyline(source)
    source[0] = 9
    assert points(line) == [[0, 0], [1, 2]]
    with pytest.raises(ValueError, match="read-only"):
        line.points[0] = 1


def test_closed_polyline_does_not_repeat_its_first_point():
    line = Polyline([[0, 0], [1, 0], [1, 1], [0, 0]], closed=True)
    assert points(line) == [[0, 0], [1, 0], [1, 1]]
    assert line.outline.tolist() == [[0, 0], [1, 0], [1, 1], [0, 0]]


@pytest.mark.parametrize(
    "bad", [[], [[0, 0]], [[0, 0, 0], [1, 1, 1]], [1, 2], [[0, 0], [np.nan, 1]], [[0, 0], [np.inf, 1]]]
)
def test_polyline_refuses_what_is_not_a_line(bad):
    with pytest.raises(PathError):
        Polyline(bad)


# --- simplified


def distance(point, outline):
    """From a point to a line, by the nearest point of every segment."""
    start, step = outline[:-1], np.diff(outline, axis=0)
    share = np.clip(((point - start) * step).sum(axis=1) / (step**2).sum(axis=1), 0, 1)
    return np.hypot(*(point - start - share[:, np.newaxis] * step).T).min()


@pytest.mark.medium
@settings(deadline=None)
@given(label_maps, st.sampled_from([0.3, 0.75, 1.5, 4.0]))
def test_simplified_lines_stay_within_the_tolerance(labels, tolerance):
    for line in trace_boundary(labels, np.ones(labels.shape, bool)):
        simple = line.simplified(tolerance)
        assert simple.closed == line.closed
        assert len(simple.points) >= (3 if line.closed else 2)
        assert {tuple(point) for point in simple.points} <= {tuple(point) for point in line.points}
        assert max(distance(point, simple.outline) for point in line.points) <= tolerance + 1e-9
        if not line.closed:
            np.testing.assert_array_equal(simple.points[[0, -1]], line.points[[0, -1]])


def test_stairs_become_a_line_and_a_turn_stays():
    stairs = [[k // 2, (k + 1) // 2] for k in range(21)]
    assert points(Polyline(stairs).simplified(0.75)) == [[0, 0], [10, 10]]
    assert len(Polyline([*stairs, [20, 10]]).simplified(0.75).points) == 3
    assert points(Polyline(stairs).simplified(0)) == stairs


def test_a_line_that_turns_back_on_itself_keeps_its_tip():
    # (10, 0) lies on the straight line from (0, 0) through (4, 0), but 6 px beyond its end.
    assert points(Polyline([[0, 0], [10, 0], [4, 0]]).simplified(5)) == [[0, 0], [10, 0], [4, 0]]
    assert points(Polyline([[0, 0], [10, 0], [4, 0]]).simplified(7)) == [[0, 0], [4, 0]]


def test_a_closed_line_never_becomes_less_than_a_triangle():
    square = Polyline([[0, 0], [1, 0], [1, 1], [0, 1]], closed=True)
    assert len(square.simplified(100).points) >= 3
    assert points(Polyline([[0, 0], [5, 0], [0, 5]], closed=True).simplified(100)) == [[0, 0], [5, 0], [0, 5]]


# --- length


def test_a_closed_line_is_longer_by_its_last_side():
    corners = [[2, 1], [5, 1], [5, 5]]
    assert Polyline(corners).length == 7
    assert Polyline(corners, closed=True).length == 12
    assert Polyline(corners[:2], closed=True).length == 6


def test_lines_of_a_million_px_are_followed_and_no_longer_ones():
    check_length(np.array([[0.0, 0.0], [4e5, -5e5], [3e5, -5e5]]))
    with pytest.raises(PathError, match=r"1e\+06 px to the side and down"):
        check_length(np.array([[0.0, 0.0], [4e5, -5e5], [3e5 - 1, -5e5]]))
    with pytest.raises(PathError):
        check_length(np.array([[0.0, 0.0], [np.nan, 0.0]]))


def test_whether_a_line_is_closed_is_true_or_false():
    assert Polyline([[0, 0], [1, 0]], closed=np.True_).closed
    with pytest.raises(PathError, match="closed is of type int"):
        Polyline([[0, 0], [1, 0]], closed=1)


def test_two_points_of_a_closed_line_may_be_one_place():
    assert points(Polyline([[3, 4], [3, 4]], closed=True)) == [[3, 4], [3, 4]]
    assert points(Polyline([[3, 4], [5, 4], [3, 4]], closed=True)) == [[3, 4], [5, 4]]


def test_lines_of_three_points_are_simplified_but_no_triangles():
    corners = [[0, 0], [5, 0.1], [9, 0]]
    assert points(Polyline(corners).simplified(0.2)) == [[0, 0], [9, 0]]
    assert points(Polyline(corners, closed=True).simplified(0.2)) == corners
    square = Polyline([[0, 0], [5, 0.1], [9, 0], [9, 9]], closed=True)
    assert points(square.simplified(0.2)) == [[0, 0], [9, 0], [9, 9]]
