"""Contours: on the level, smooth, and the same a period apart."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.vector.contours import ANCHORS_PX, MARGIN_PX, CurvePath, contour, contour_beyond


def blobs(height=60, width=84, sigma=4.0, seed=0):
    values = ndimage.gaussian_filter(np.random.default_rng(seed).random((height, width)), sigma, mode="wrap")
    return (values - values.min()) / np.ptp(values)


def along(curves, count=9):
    """(N · count, 2) points of the curves."""
    t = np.linspace(0, 1, count)[:, None, None]
    a, b, c, d = curves.transpose(1, 0, 2)
    return ((1 - t) ** 3 * a + 3 * t * (1 - t) ** 2 * b + 3 * t**2 * (1 - t) * c + t**3 * d).reshape(-1, 2)


def test_a_disc_has_the_circle_as_its_contour():
    y, x = np.mgrid[:60, :60] + 0.5
    path = contour(20 - np.hypot(x - 31, y - 28), 0.0, periodic=False)
    radius = np.hypot(*(along(path.curves) - (31, 28)).T)
    assert len(path.starts) == 1
    assert len(path.curves) < 40  # marching squares has 160 points here
    assert np.abs(radius - 20).max() < 0.15


@pytest.mark.parametrize("radii", [(80, 80), (80, 50), (90, 30)])
def test_the_best_curve_is_fitted_so_that_few_are_enough(radii):
    """With handles of a third of the length, taken where no best ones are found, it takes 70 to 87."""
    y, x = np.mgrid[:200, :200] + 0.5
    path = contour(1 - np.hypot((x - 100) / radii[0], (y - 100) / radii[1]), 0.0, periodic=False)
    assert len(path.curves) < 60


def test_curves_lie_on_the_level_and_join():
    density = blobs()
    path = contour(density, 0.4)
    points = along(path.curves)
    inside = ((points > 0) & (points < (84, 60))).all(axis=1)
    found = ndimage.map_coordinates(density, points[inside].T[::-1] - 0.5, order=1, mode="grid-wrap")
    assert np.abs(found - 0.4).max() < 0.04
    for loop in np.split(path.curves, path.starts[1:]):
        np.testing.assert_array_equal(loop[:, 3], np.roll(loop[:, 0], -1, axis=0))


def bends(curves):
    """Angle between the curves that meet at each inner joint of loops."""
    out, into = curves[1:, 1] - curves[1:, 0], curves[:-1, 3] - curves[:-1, 2]
    joined = (curves[1:, 0] == curves[:-1, 3]).all(axis=1)
    cosine = (out * into).sum(axis=1) / np.maximum(np.hypot(*out.T) * np.hypot(*into.T), 1e-12)
    return np.degrees(np.arccos(np.clip(cosine[joined], -1, 1)))


def test_curves_meet_without_a_corner():
    y, x = np.mgrid[:60, :60] + 0.5
    assert bends(contour(20 - np.hypot(x - 30, (y - 30) * 1.4), 0.0, periodic=False).curves).max() < 1e-3


@pytest.mark.parametrize("shape", [(60, 84), (50, 51)])
def test_what_leaves_at_one_border_enters_at_the_opposite_one(shape):
    height, width = shape
    curves = contour(blobs(*shape), 0.45).curves
    for axis, period in ((0, width), (1, height)):
        across = curves[(curves[:, :, axis].min(axis=1) < 0) & (curves[:, :, axis].max(axis=1) > 0)]
        assert len(across) >= 2
        shift = np.eye(2)[axis] * period
        for curve in across:
            assert np.abs(curves - (curve + shift)).max(axis=(1, 2)).min() < 1e-9


def test_contours_end_beyond_the_border():
    path = contour(blobs(), 0.45)
    assert MARGIN_PX > ANCHORS_PX
    assert path.curves.min() <= 0.6 - MARGIN_PX
    assert path.curves.min() >= -0.5 - MARGIN_PX


def test_without_repeat_the_border_goes_on():
    density = np.zeros((30, 30))
    density[:, :10] = 1.0
    points = along(contour(density, 0.5, periodic=False).curves)
    inside = points[(points > 1).all(axis=1) & (points < 29).all(axis=1)]
    np.testing.assert_allclose(inside[:, 0], 10.0, atol=1e-9)


def test_nothing_and_everything():
    assert contour(np.zeros((20, 30)), 0.5).data() == ""
    whole = contour(np.ones((20, 30)), 0.5)
    assert len(whole.starts) == 1
    assert along(whole.curves).min() < -ANCHORS_PX


def test_a_density_equal_to_the_level_and_a_single_pixel():
    checked = (np.indices((24, 24)).sum(axis=0) % 2).astype(float)
    assert np.isfinite(contour(checked, 0.5).curves).all()
    flat = np.where(np.arange(24) < 12, 0.5, 1.0) * np.ones((24, 1))
    assert np.isfinite(contour(flat, 0.5).curves).all()
    dot = np.zeros((24, 24))
    dot[7, 9] = 1.0
    assert len(contour(dot, 0.5, periodic=False).starts) == 1


def test_path_data_close_exactly():
    path = contour(blobs(), 0.5)
    for loop in path.data().split("z")[:-1]:
        begin, _, steps = loop.partition("c")
        numbers = np.array(steps.split(), float).reshape(-1, 6)
        assert np.abs(numbers[:, 4:].sum(axis=0)).max() < 1e-9
        assert begin.strip().startswith("M")


def test_bad_input():
    with pytest.raises(ts.ImageError, match="shape"):
        contour(np.zeros(3), 0.5)
    with pytest.raises(ts.ImageError, match="finite"):
        contour(np.full((4, 4), np.nan), 0.5)
    with pytest.raises(ts.OptionError, match="positive"):
        contour(np.zeros((4, 4)), 0.5, tolerance_px=0)


def test_path_data_are_the_shortest_decimals():
    first = [[(-0.5, 12), (0, 12.04), (0.125, 10), (2, 10)], [(2, 10), (2, 9.96), (-0.4, 12.1), (-0.5, 12)]]
    second = [[(100, 0.05), (100.2, 1.05), (99, 1), (100, 0.05)]]
    path = CurvePath(np.array(first + second, float), np.array([0, 2]))
    assert path.data(digits=1) == ("M-.5,12c.5 0 .6 -2 2.5 -2 0 0 -2.4 2.1 -2.5 2z M100,0c.2 1 -1 1 0 0z")
    assert path.data(scale=2, digits=0).startswith("M-1,24c1 0 1 -4 5 -4 ")


def test_curves_end_on_every_twelfth_row_and_column():
    y, x = np.mgrid[:60, :72] + 0.5
    path = contour(20 - np.hypot(x - 31, y - 28), 0.0, periodic=False)
    points = along(path.curves).reshape(9, -1, 2)
    for axis in (0, 1):
        place = (points[..., axis] - 0.5) / ANCHORS_PX
        low, high = place.min(axis=0), place.max(axis=0)
        assert (high <= np.floor(low + 0.01) + 1.01).all()
    ends = (path.curves[:, 0] - 0.5) / ANCHORS_PX
    assert (np.abs(ends - np.rint(ends)).min(axis=1) < 1e-6).sum() >= 8


@pytest.mark.parametrize("tolerance", [0.02, 0.1, 1.0])
def test_curves_are_as_near_as_asked_and_no_more_of_them(tolerance):
    y, x = np.mgrid[:72, :96] + 0.5
    density = np.sin(x / 5.5) + np.cos(y / 7 + x / 23)
    polygon = contour(density, 0.35, periodic=False, tolerance_px=1e-6).curves[:, 0]
    path = contour(density, 0.35, periodic=False, tolerance_px=tolerance)
    apart = np.hypot(*(polygon[:, None] - along(path.curves, 33)[None]).transpose(2, 0, 1)).min(axis=1)
    assert apart.max() < tolerance + 0.15  # between the samples
    assert len(path.curves) <= len(polygon)
    wider = contour(density, 0.35, periodic=False, tolerance_px=2 * tolerance)
    assert len(wider.curves) <= len(path.curves)


def test_a_window_has_more_than_its_margins():
    least = 2 * MARGIN_PX + 1
    assert not len(contour_beyond(np.zeros((least, least + 3)), 0.5).curves)
    for shape in ((least - 1, least + 3), (least + 3, least - 1)):
        with pytest.raises(ts.ImageError, match="margins included"):
            contour_beyond(np.zeros(shape), 0.5)


def test_pieces_are_outlines_with_their_own_holes():
    y, x = np.mgrid[:90, :120] + 0.5
    rings = [(30, 30, 24), (90, 40, 22)]
    away = np.stack([np.abs(np.hypot(x - a, y - b) - r) for a, b, r in rings]).min(axis=0)
    values = np.maximum(4 - away, 8 - np.hypot(x - 30, y - 30))  # two rings, one with a disc in it
    path = contour(values, 0.0, periodic=False)
    pieces = path.pieces()
    assert sorted(len(piece.starts) for piece in pieces) == [1, 2, 2]
    assert sum(len(piece.curves) for piece in pieces) == len(path.curves)
    assert {loop for piece in pieces for loop in loops_of(piece)} == set(loops_of(path))


@pytest.mark.parametrize("seed", range(4))
def test_there_are_as_many_pieces_as_areas(seed):
    values = np.pad(blobs(seed=seed), MARGIN_PX, mode="wrap")
    path = contour_beyond(values, 0.55)
    count = ndimage.label(values > 0.55)[1]
    assert len(path.pieces()) == pytest.approx(count, abs=1)  # diagonal neighbours may touch or not
    assert {loop for piece in path.pieces() for loop in loops_of(piece)} == set(loops_of(path))


def loops_of(path):
    return [loop.tobytes() for loop in np.split(path.curves, path.starts[1:])]
