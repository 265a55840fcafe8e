"""SIFT features and shifts of patches against scikit-image's, features of a turned picture and of nothing."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree
from skimage import data, feature
from skimage.registration import phase_cross_correlation

import toposeam as ts
from toposeam.layers.canvas import similarity
from toposeam.layers.registration import describe_picture, find_features, find_patches

CONTRAST = 0.004


@pytest.fixture(scope="module")
def picture():
    return data.camera()[80:231, 120:321].astype(np.float32) / 255


def test_points_are_those_of_skimage(picture):
    points, _ = find_features(picture, CONTRAST)
    theirs = feature.SIFT(c_dog=CONTRAST)
    theirs.detect_and_extract(picture)
    # Theirs lie a quarter of a pixel too far right and down: twice as many pixels have other middles.
    expected = theirs.positions[:, ::-1] - 0.25
    assert len(expected) > 200
    for some, others in ((points, expected), (expected, points)):
        assert np.mean(cKDTree(others).query(some)[0] < 0.05) > 0.98


def test_descriptors_agree_with_those_of_skimage(picture):
    points, descriptors = find_features(picture, CONTRAST)
    theirs = feature.SIFT(c_dog=CONTRAST)
    theirs.detect_and_extract(picture)
    apart, nearest = cKDTree(points).query(theirs.positions[:, ::-1] - 0.25)
    alone = (apart < 0.01) & (
        np.unique(points, axis=0, return_counts=True)[1][_numbers(points)[nearest]] == 1
    )
    ours = descriptors[nearest[alone]].astype(float).reshape(-1, 16, 8)
    others = theirs.descriptors[alone].astype(float).reshape(-1, 16, 8)
    # Cells and directions are counted from elsewhere, alike for all: what a cell holds is compared.
    cells = [np.sort(values.sum(axis=2), axis=1) for values in (ours, others)]
    assert alone.sum() > 100
    assert np.median(np.abs(cells[0] - cells[1]).mean(axis=1) / cells[1].mean(axis=1)) < 0.1


def _numbers(points):
    return np.unique(points, axis=0, return_inverse=True)[1].ravel()


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_turned_picture_has_the_same_features(picture, turns):
    points, descriptors = find_features(picture, CONTRAST)
    turned, others = find_features(np.ascontiguousarray(np.rot90(picture, turns)), CONTRAST)
    height, width = picture.shape
    back = turned @ np.linalg.matrix_power([[0, -1], [1, 0]], turns).T
    back += {1: (width - 1, 0), 2: (width - 1, height - 1), 3: (0, height - 1)}[turns]
    distance = np.abs(descriptors[:, np.newaxis].astype(int) - others).sum(axis=2)
    nearest = distance.argmin(axis=1)
    # Every other pixel of a larger level is not the same one from the other side.
    assert np.mean(np.abs(points - back[nearest]).max(axis=1) < 0.5) > 0.9
    assert np.median(distance.min(axis=1)) < 60  # of up to 5,000


def test_half_as_large_and_darker_the_features_are_found(picture):
    points, descriptors = find_features(picture, CONTRAST)
    small = gaussian_filter(picture, 0.8)[::2, ::2] * np.float32(0.6)
    halves, others = find_features(np.ascontiguousarray(small), CONTRAST)
    distance = np.abs(others[:, np.newaxis].astype(int) - descriptors).sum(axis=2)
    nearest = points[distance.argmin(axis=1)]
    assert np.mean(np.abs(2 * halves - nearest).max(axis=1) < 1.5) > 0.5


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (5, 7), (6, 6), (13, 200)])
def test_small_and_empty_pictures_have_no_features(shape):
    for value in (0.0, 0.7):
        points, descriptors = find_features(np.full(shape, value, np.float32), CONTRAST)
        assert points.shape == (0, 2)
        assert descriptors.shape == (0, 128)
        assert descriptors.dtype == np.uint8


def test_faint_detail_is_left_out(picture):
    all_of_it, _ = find_features(picture, CONTRAST)
    strong, _ = find_features(picture, 10 * CONTRAST)
    none, _ = find_features(picture / 1000, CONTRAST)
    assert 0 < len(strong) < len(all_of_it) / 3
    assert len(none) == 0


@pytest.mark.parametrize("size", [70, 200])
def test_patches_are_moved_as_skimage_moves_each(size):
    whole = 0.5 + gaussian_filter(np.random.default_rng(5).normal(0, 1, (210, 210)), 2)
    one, other = (describe_picture(ts.Layer(whole[at : at + size, 2 * at : 2 * at + size])) for at in (0, 3))
    a, b = one.detail, other.detail
    match = find_patches(one, other, similarity((0, 0)))
    side = min(64, int(0.7 * (size - 1)))
    assert len(match.first) > 10
    for first, second in zip(match.first, match.second, strict=True):
        left, top = (first - (side - 1) / 2).astype(int)
        there = np.s_[top : top + side, left : left + side]
        shift = phase_cross_correlation(a[there], b[there], upsample_factor=20, normalization=None)[0]
        assert np.array_equal(first - second, shift[::-1].astype(float))
    assert match.first - match.second == pytest.approx(np.tile([6, 3], (len(match.first), 1)), abs=0.5)
