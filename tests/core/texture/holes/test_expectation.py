"""What the surroundings of a hole let expect in it."""

import tracemalloc

import numpy as np
import pytest
import skimage.data
from scipy import ndimage

import toposeam as ts
from toposeam.texture.holes.distances import distance_from
from toposeam.texture.holes.expectation import expectation
from toposeam.texture.holes.shift_candidates import _level


def planes(picture):
    """The features of a picture, one after another."""
    return lambda: np.moveaxis(np.atleast_3d(picture), 2, 0)


def disc(shape, row, column, radius):
    y, x = np.mgrid[: shape[0], : shape[1]]
    return np.hypot(y - row, x - column) <= radius


def horizon(row=70):
    """A bright sky over dark ground, with a little noise, and a hole across the horizon."""
    noise = np.random.default_rng(0).normal(0, 0.02, (140, 200))
    picture = np.where(np.arange(140)[:, np.newaxis] < row, 0.8, 0.3) + noise
    hole = np.zeros(picture.shape, bool)
    hole[30:120, 8:130] = True
    return picture.astype(np.float32), hole


@pytest.mark.parametrize("turned", [False, True])
def test_a_horizon_is_expected_to_cross_the_whole_hole(turned):
    picture, hole = horizon()
    if turned:
        picture, hole = picture.T, hole.T
    expected, like = expectation(planes(picture), hole, np.ones_like(hole))
    assert expected.shape == like.shape == (*picture.shape, 3)
    across = expected[70, :, 0] if turned else expected[:, 70, 0]
    assert across[50] == pytest.approx(0.8, abs=0.03)  # a membrane alone: 0.65
    assert across[90] == pytest.approx(0.3, abs=0.03)


def test_where_lines_say_little_a_membrane_is_expected():
    y, x = np.mgrid[:90, :90].astype(np.float32)
    saddle = 0.5 + (x - 45) * (y - 45) / 5000
    hole = disc(saddle.shape, 45, 45, 14)
    expected, _ = expectation(planes(saddle), hole, np.ones_like(hole))
    np.testing.assert_allclose(expected[hole][:, 0], saddle[hole], atol=0.01)


@pytest.mark.parametrize("axis", [0, 1])
def test_level_shifts_bring_all_that_lies_level(axis):
    _, hole = horizon()
    hole = hole if axis == 0 else hole.T
    shifts = _level(~hole, hole)
    along = shifts[shifts[:, axis] == 0]
    assert len(along) >= 2
    reached = np.zeros_like(hole)
    for shift in along:
        reached |= np.roll(~hole, -shift, (0, 1))
    assert reached[hole].all()
    assert len(np.unique(shifts, axis=0)) == len(shifts)


@pytest.mark.medium
def test_a_horizon_runs_on_level_through_a_filled_hole():
    """The sides of what can be copied are narrower than the hole, so that the ground must be found again."""
    picture = np.rint(255 * horizon()[0]).astype(np.uint8)
    hole = horizon()[1]
    for column in range(4, 200, 28):  # something on the horizon, so that its height is no matter of chance
        picture[58:70, column : column + 9] = 120
    made = ts.fill(np.where(hole, 0, picture).astype(np.uint8), hole, by="shifts").image
    assert (made[30:55, 8:130] > 150).all()
    assert (made[75:120, 8:130] < 130).all()


def test_what_hardly_occurs_round_a_hole_is_strange():
    picture = np.random.default_rng(1).uniform(0.4, 0.5, (120, 160, 3)).astype(np.float32)
    hole, buckle = disc((120, 160), 60, 50, 20), disc((120, 160), 60, 130, 8)
    picture[buckle] = (0.1, 0.9, 0.9)
    _, like = expectation(planes(picture), hole, np.ones_like(hole))
    assert like[buckle][:, -1].mean() > 1.5
    beside = ~hole & ~ndimage.binary_dilation(buckle, iterations=6)
    assert like[beside][:, -1].mean() < 0.05


def test_many_maps_do_not_multiply_the_colours_that_count():
    picture = np.random.default_rng(2).random((40, 40, 12)).astype(np.float32)
    hole = disc((40, 40), 20, 20, 6)
    expected, like = expectation(planes(picture), hole, np.ones_like(hole))
    assert expected.shape == like.shape == (40, 40, 14)


@pytest.mark.medium
def test_no_buckle_appears_where_a_badge_was():
    """The mask leaves a rim of the badge, and what fits that best has a buckle in it."""
    image = skimage.data.astronaut()
    y, x = np.mgrid[:512, :512]
    hole = np.square((y - 371) / 46) + np.square((x - 174) / 46) < 1
    made = ts.fill(image, hole).image[hole].astype(int)
    assert (made[:, 0] > made[:, 2] + 30).all()  # orange, and nothing white, blue or black


@pytest.mark.parametrize("shape", [(1, 5), (70, 33), (300, 200)])
def test_distances_are_those_of_the_transform(shape):
    mask = np.random.default_rng(0).random(shape) < 0.02
    mask[0, 0] = True
    np.testing.assert_array_equal(distance_from(mask), ndimage.distance_transform_edt(~mask))


def test_what_is_expected_takes_little_memory():
    """Bytes a pixel beside the picture, of which 40 are the result at most."""
    features = np.random.default_rng(0).random((400, 400, 3)).astype(np.float32)
    hole = np.zeros((400, 400), bool)
    hole[150:250, 150:250] = True
    tracemalloc.start()
    try:
        expectation(planes(features), hole, np.ones_like(hole))
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most / hole.size < 90  # 86; whole transforms of distances made it 126
