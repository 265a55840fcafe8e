"""Cheapest paths between corners, searched whole and near the path between every other corner."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from toposeam.seam.exact import cheapest_path


def costs(seed, h, w, smooth=2.0):
    rng = np.random.default_rng(seed)
    below, beside = ndimage.gaussian_filter(rng.random((2, h, w)), (0, smooth, smooth)).astype(np.float32)
    below, beside = below - below.min() + 0.001, beside - beside.min() + 0.001
    below[-1] = np.inf
    beside[:, -1] = np.inf
    return below, beside


def length(path, below, beside):
    """The length of a path, which takes one step at a time."""
    y, x = np.divmod(path, below.shape[1])
    down, right = np.diff(y), np.diff(x)
    assert (np.abs(down) + np.abs(right) == 1).all()
    y, x = np.minimum(y[1:], y[:-1]), np.minimum(x[1:], x[:-1])
    return float(np.where(down != 0, below[y, x], beside[y, x]).sum(dtype=np.float64))


@pytest.mark.parametrize("size", [(121, 80), (90, 161), (128, 128)])
def test_few_corners_lead_near_the_cheapest_path(size):
    ratios = []
    for seed in range(8):
        below, beside = costs(seed, *size)
        ends = 5, below.size - 7
        best, least = cheapest_path(below, beside, ends)
        path, found = cheapest_path(below, beside, ends, whole=below.size // 5)
        assert (path[0], path[-1]) == ends == (best[0], best[-1])
        assert found == pytest.approx(length(path, below, beside), rel=1e-6)
        ratios.append(found / least)
    assert min(ratios) >= 1 - 1e-9
    assert np.mean(ratios) < 1.01
    assert max(ratios) < 1.05


def test_a_way_only_one_corner_wide_is_found():
    below, beside = costs(1, 120, 90)
    beside[:, 45] = np.inf  # a wall
    beside[77, 45] = 1.0
    ends = 60 * 90, 60 * 90 + 80
    best, least = cheapest_path(below, beside, ends)
    path, found = cheapest_path(below, beside, ends, whole=2000)
    assert path is not None
    assert 77 * 90 + 45 in best
    assert least <= found < np.inf


def test_ends_on_a_border_without_edges_beside_it_are_reached():
    below, beside = costs(2, 100, 80)
    below[0, 1:] = np.inf
    beside[0] = np.inf
    ends = 0, 99 * 80 + 40
    assert cheapest_path(below, beside, ends, whole=1000)[1] <= 1.05 * cheapest_path(below, beside, ends)[1]


@pytest.mark.parametrize("size", [(160, 121), (161, 120), (163, 123)])
def test_a_path_may_first_run_along_a_border(size):
    (h, w), rng = size, np.random.default_rng(5)
    below, beside = (np.full(size, np.inf, np.float32) for _ in range(2))
    below[1 : h - 2, 1 : w - 2] = rng.uniform(900, 1100, (h - 3, w - 3))
    beside[2 : h - 2, 1 : w - 2] = rng.uniform(900, 1100, (h - 4, w - 3))
    beside[[1, h - 2], 1 : w - 2] = 0  # nothing lies beyond, so that this costs nothing
    below[1 : h - 2, w - 20 : w - 18] = 1
    ends = w + 1, (h - 2) * w + 1
    least = cheapest_path(below, beside, ends)[1]
    assert least < 2 * h
    assert cheapest_path(below, beside, ends, whole=below.size // 3)[1] <= 1.01 * least


def test_no_way_is_none_however_many_corners_are_searched():
    below, beside = costs(3, 60, 60)
    below[30] = np.inf
    for whole in (np.inf, 500):
        assert cheapest_path(below, beside, (3, 59 * 60), whole=whole) == (None, np.inf)


def test_a_limit_holds_for_few_corners_too():
    below, beside = costs(4, 80, 80)
    _, least = cheapest_path(below, beside, (0, 79 * 80))
    for whole in (np.inf, 1000):
        assert cheapest_path(below, beside, (0, 79 * 80), 0.9 * least, whole) == (None, np.inf)


@pytest.mark.parametrize("limit", [np.inf, 20.0, 1.0])
@pytest.mark.parametrize("seed", range(4))
def test_kernels_find_a_path_as_short(seed, limit, both_ways):
    below, beside = costs(seed, 70, 50)
    below[np.random.default_rng(seed).random(below.shape) < 0.3] = np.inf
    ends = 3 * 50 + 2, 66 * 50 + 45
    (one, short), (other, least) = both_ways(lambda: cheapest_path(below, beside, ends, limit))
    assert short == least
    if one is not None:
        assert (one[0], one[-1]) == (other[0], other[-1]) == ends
        assert length(one, below, beside) == pytest.approx(least, rel=1e-9)


def test_kernels_go_straight_where_steps_cost_nothing(both_ways):
    below, beside = (np.zeros((40, 30), np.float32) for _ in range(2))
    below[-1], beside[:, -1] = np.inf, np.inf
    (path, least), (_, other) = both_ways(lambda: cheapest_path(below, beside, (2 * 30 + 3, 35 * 30 + 3)))
    assert least == other == 0
    assert len(path) == 34
