"""Homographies from features that match, of which many are wrong."""

import numpy as np
import pytest

from toposeam.layers.registration import applied
from toposeam.layers.registration.homography import Homography, find_homography, within

SIZE = (320, 240)
TRUTH = np.array([[0.98, -0.06, 110.0], [0.05, 1.02, -12.0], [2e-4, -1.5e-4, 1.0]])


def matched(rng, right, wrong=0, noise=0.0, truth=TRUTH):
    """Points of two pictures: so many that belong together and so many that do not, in any order."""
    second = rng.uniform(0, 1, (100 * right, 2)) * (np.array(SIZE) - 1)
    first = applied(truth, second)
    shown = np.flatnonzero(within(first, SIZE))[:right]
    first, second = first[shown] + rng.normal(0, noise or 1e-12, (len(shown), 2)), second[shown]
    assert len(first) == right
    stray = rng.uniform(0, 1, (2, wrong, 2)) * (np.array(SIZE) - 1)
    order = rng.permutation(right + wrong)
    pair = (np.concatenate([own, other])[order] for own, other in zip((first, second), stray, strict=True))
    return *pair, order < right


def found(first, second, tolerance=2.0):
    return find_homography(first, second, (SIZE, SIZE), tolerance)


def corners_off(matrix, truth=TRUTH):
    corners = np.array([[0, 0], [200, 0], [0, 239], [200, 239.0]])
    return np.abs(applied(matrix, corners) - applied(truth, corners)).max()


def test_without_noise_it_is_exact():
    first, second, _ = matched(np.random.default_rng(0), 30)
    one = found(first, second)
    assert one.matrix == pytest.approx(TRUTH, abs=1e-7)
    assert one.inliers.all()
    assert one.overlap == 30
    assert one.verified


@pytest.mark.parametrize("seed", range(5))
def test_it_is_found_among_three_times_as_many_strays(seed):
    rng = np.random.default_rng(seed)
    first, second, belongs = matched(rng, 40, 60, noise=0.4)
    one = found(first, second)
    assert one.verified
    assert corners_off(one.matrix) < 2
    assert (one.inliers & belongs).sum() >= 38
    assert (one.inliers & ~belongs).sum() <= 3


def test_the_same_is_found_each_time():
    first, second, _ = matched(np.random.default_rng(3), 30, 40, noise=0.5)
    one, other = found(first, second), found(first, second)
    assert (one.matrix == other.matrix).all()
    assert (one.inliers == other.inliers).all()


def test_the_order_of_pictures_gives_the_inverse():
    first, second, _ = matched(np.random.default_rng(4), 60, 20, noise=0.3)
    there, back = found(first, second), found(second, first)
    assert corners_off(np.linalg.inv(back.matrix)) < 2
    assert there.overlap == back.overlap


@pytest.mark.parametrize("count", [9, 20, 60, 150])
def test_strays_alone_verify_nothing(count):
    for seed in range(12):
        rng = np.random.default_rng(seed)
        first, second = rng.uniform(0, 1, (2, count, 2)) * (np.array(SIZE) - 1)
        one = found(first, second)
        assert one is None or not one.verified, seed


def test_a_few_matches_are_too_few():
    first, second, _ = matched(np.random.default_rng(0), 40)
    assert found(first[:7], second[:7]) is None
    assert found(first[:0], second[:0]) is None
    few = found(first[:9], second[:9])
    assert few.inliers.all()
    assert not few.verified  # 9 of 9 may be by chance
    assert found(first[:12], second[:12]).verified


def test_mirrored_pictures_are_refused():
    mirror = np.array([[-1.0, 0, 300], [0, 1, 0], [0, 0, 1]])
    first, second, _ = matched(np.random.default_rng(1), 40, truth=mirror)
    assert found(first, second) is None


@pytest.mark.parametrize("scale", [0.15, 6.0])
def test_pictures_that_are_much_smaller_are_refused(scale):
    truth = np.array([[scale, 0, 100.0], [0, scale, 80.0], [0, 0, 1]])
    first, second, _ = matched(np.random.default_rng(1), 20, truth=truth)
    assert found(first, second, tolerance=0.5) is None


def test_pictures_turned_into_a_line_or_a_point_are_refused():
    rng = np.random.default_rng(2)
    second = rng.uniform(0, 200, (40, 2))
    line = np.stack([second[:, 0], 0.5 * second[:, 0] + 20], axis=1)
    for first in (line, np.full((40, 2), 50.0), line + rng.normal(0, 0.3, line.shape)):
        for pair in ((first, second), (second, first)):
            one = found(*pair)
            assert one is None or not one.verified


def test_a_fold_in_the_overlap_is_refused():
    """Some matches would lie behind the picture that sees the others."""
    truth = np.array([[1.0, 0, 0], [0, 1.0, 0], [-0.009, 0, 1.0]])
    rng = np.random.default_rng(5)
    second = rng.uniform(0, 1, (60, 2)) * (np.array(SIZE) - 1)
    second = second[np.abs(second[:, 0] - 111) > 30]
    assert found(applied(truth, second), second) is None


@pytest.mark.parametrize(("agree", "overlap", "verified"), [(8, 0, False), (9, 0, True), (30, 100, False)])
def test_pairs_need_more_matches_in_larger_overlaps(agree, overlap, verified):
    assert Homography(np.eye(3), np.ones(agree, bool), overlap).verified is verified
    assert Homography(np.eye(3), np.ones(31, bool), 100).verified


def test_what_lies_on_the_horizon_comes_to_lie_far_away():
    there = applied(np.array([[1.0, 0, 0], [0, 1, 0], [1, 0, 0]]), np.array([[0.0, 5.0], [2.0, 4.0]]))
    assert np.isfinite(there).all()
    assert abs(there[0, 1]) > 1e9
    assert there[1] == pytest.approx([1, 2])
