"""Few curves along a line of many points."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import toposeam as ts
from toposeam.vector.smooth import FEW_PX, TOLERANCES_PX

SAMPLES = Path(__file__).parents[3] / "samples"


def wandering(seed=1, height=400, calm=6):
    """A line of pixel corners from top to bottom, as seams are, that wanders about smoothly."""
    rng = np.random.default_rng(seed)
    course = np.convolve(np.cumsum(rng.normal(size=height + 60)), np.hanning(60) / calm, "valid")[:height]
    x = np.rint(course - course.min()).astype(int)
    points = [(x[0], 0)]
    for row in range(height):
        points += [(x[row], row), (x[row], row + 1)]
    return ts.vector.Polyline(np.array(points, float))


@pytest.mark.parametrize("seed", range(5))
def test_curves_stay_close_and_are_few(seed):
    line = wandering(seed)
    smooth = ts.vector.smooth_path(line)
    assert smooth.distance() <= TOLERANCES_PX[-1]
    assert len(smooth.curves) <= np.ptp(line.points, axis=0).max() / FEW_PX < len(line.points) / 20
    np.testing.assert_array_equal(smooth.anchors[[0, -1]], line.points[[0, -1]])


def test_few_curves_are_enough_for_seams_of_photographs():
    left, right = (
        np.asarray(Image.open(SAMPLES / f"still_life_{side}.png").convert("RGB"))
        for side in ("left", "right")
    )
    for method in ("heat", "dp"):
        (seam,) = ts.stitch([ts.Layer(left), ts.Layer(right, at=(310, 0))], method=method).seams
        (line,) = seam.paths
        smooth = ts.vector.smooth_path(line, tolerance=2)
        assert smooth.distance() <= 2.1  # between the samples at which the curve was compared
        assert len(smooth.anchors) <= np.ptp(line.points[:, 1]) / FEW_PX


def test_the_pieces_are_the_line():
    line = wandering()
    smooth = ts.vector.smooth_path(line)
    pieces = [smooth.piece(index) for index in range(len(smooth.curves))]
    for piece, curve, following in zip(pieces, smooth.curves, [*pieces[1:], None], strict=True):
        np.testing.assert_array_equal(piece[[0, -1]], curve[[0, 3]])
        assert following is None or (piece[-1] == following[0]).all()
    points = np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])
    assert set(map(tuple, line.points)) <= set(map(tuple, points))
    length = np.hypot(*np.diff(points, axis=0).T).sum()
    assert length == pytest.approx(line.length)


def test_a_closed_line_stays_closed():
    angle = np.linspace(0, 2 * np.pi, 600, endpoint=False)
    ring = ts.vector.Polyline(
        np.column_stack([100 + 80 * np.cos(angle), 90 + 50 * np.sin(angle)]), closed=True
    )
    smooth = ts.vector.smooth_path(ring, tolerance=0.5)
    assert smooth.closed
    np.testing.assert_array_equal(smooth.curves[0, 0], smooth.curves[-1, 3])
    assert 2 <= len(smooth.anchors) <= 8
    assert smooth.distance() <= 0.5


@pytest.mark.parametrize("points", [[(0, 0), (0, 1)], [(0, 0), (1, 0), (1, 1)], [(0, 0), (0, 900)]])
def test_short_and_straight_lines(points):
    smooth = ts.vector.smooth_path(ts.vector.Polyline(np.array(points, float)))
    assert smooth.distance() <= 2
    assert len(smooth.anchors) <= 3


def test_a_tolerance_must_be_a_positive_number():
    with pytest.raises(ts.OptionError, match="tolerance is 'x'"):
        ts.vector.smooth_path(wandering(), tolerance="x")


@pytest.mark.parametrize("side", [1, 2, 3])
def test_however_small_a_closed_line_is_two_curves_at_least(side):
    ring = ts.vector.Polyline([[0, 0], [side, 0], [side, side], [0, side]], closed=True)
    assert len(ts.vector.smooth_path(ring, tolerance=50).curves) == 2


def test_the_distance_is_the_farthest_of_curves_and_line():
    across = np.column_stack([np.arange(11.0), np.zeros(11)])

    def distance(*ends):
        start, end = np.array(ends, float)
        curve = start + np.linspace(0, 1, 4)[:, None] * (end - start)
        return ts.vector.SmoothPath(curve[None], np.array([0, 10]), False, across).distance()

    assert distance((0, 0), (10, 0)) == pytest.approx(0, abs=0.2)
    assert distance((0, 4), (10, 4)) == pytest.approx(4, abs=0.2)
    assert distance((0, 0), (7, 0)) == pytest.approx(3, abs=0.2)  # the line goes on
    assert distance((-5, 0), (10, 0)) == pytest.approx(5, abs=0.2)  # the curve began before


def test_a_piece_has_its_turning_points_only():
    dense = np.array([(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (3, 3), (4, 4), (5, 4)], float)
    smooth = ts.vector.SmoothPath(np.zeros((2, 4, 2)), np.array([0, 4, 7]), False, dense)
    assert smooth.piece(0).tolist() == [[0, 0], [2, 0], [2, 2]]
    assert smooth.piece(1).tolist() == [[2, 2], [4, 4], [5, 4]]


def test_the_line_has_a_point_on_every_px():
    line = ts.vector.Polyline([[0, 0], [3, 1.5], [3, -1], [3.4, -1]])
    expected = [(0, 0), (1, 0.5), (2, 1), (3, 1.5), (3, 2 / 3), (3, -1 / 6), (3, -1), (3.4, -1)]
    assert ts.vector.smooth_path(line).dense == pytest.approx(np.array(expected))
    closed = ts.vector.smooth_path(ts.vector.Polyline([[0, 0], [2, 0], [2, 2]], closed=True)).dense
    assert closed.tolist() == [[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 1], [0, 0]]


def test_the_first_tolerance_with_few_curves_counts():
    line = wandering(2, 160, calm=3)
    few = np.ptp(line.points, axis=0).max() / FEW_PX
    curves = [len(ts.vector.smooth_path(line, tolerance).curves) for tolerance in TOLERANCES_PX]
    wanted = next((count for count in curves if count <= few), curves[-1])
    assert len(ts.vector.smooth_path(line).curves) == wanted


def test_what_is_no_line_is_refused():
    with pytest.raises(ts.TopoSeamError, match="line"):
        ts.vector.smooth_path(np.zeros((4, 2)))
    with pytest.raises(ts.OptionError, match="tolerance"):
        ts.vector.smooth_path(wandering(), tolerance=0)
