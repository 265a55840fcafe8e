"""Which pixels are decided before any seam is sought."""

from __future__ import annotations

import numpy as np
import pytest

import toposeam as ts
from toposeam.seam.overlap import FREE, SIDES, A, B, between_masks, side_by_side


@pytest.mark.parametrize(
    ("side", "of_a", "of_b"),
    [
        ("right", np.s_[:, 0], np.s_[:, -1]),
        ("left", np.s_[:, -1], np.s_[:, 0]),
        ("bottom", np.s_[0], np.s_[-1]),
        ("top", np.s_[-1], np.s_[0]),
    ],
)
def test_the_borders_towards_each_patch_are_fixed_to_it(side, of_a, of_b):
    inner = side_by_side((5, 6), side).side[1:-1, 1:-1]
    assert (inner[of_a] == A).all()
    assert (inner[of_b] == B).all()
    assert (inner == FREE).sum() == (5 * 4 if side in ("right", "left") else 3 * 6)


def test_masks_give_the_same_overlap_as_the_arrays_alone():
    rng = np.random.default_rng(3)
    a, b = rng.random((2, 20, 10))
    alone = ts.find_seam(a, b, method="shortest-path")
    wide_a, wide_b = np.zeros((20, 30)), np.zeros((20, 30))
    mask_a, mask_b = np.zeros((2, 20, 30), bool)
    wide_a[:, 10:20], wide_b[:, 10:20] = a, b
    mask_a[:, :20], mask_b[:, 10:] = True, True
    placed = ts.find_seam(wide_a, wide_b, mask_a, mask_b, method="shortest-path", gradient=False)
    alone = ts.find_seam(a, b, method="shortest-path", gradient=False)
    np.testing.assert_array_equal(placed.labels[:, 10:20], alone.labels)
    assert placed.cost == pytest.approx(alone.cost)
    assert not placed.labels[:, :10].any()
    assert placed.labels[:, 20:].all()


def test_what_the_masks_leave_out_may_hold_anything():
    rng = np.random.default_rng(4)
    a, b = rng.random((2, 12, 20))
    mask_a, mask_b = np.zeros((2, 12, 20), bool)
    mask_a[:, :14], mask_b[:, 6:] = True, True
    clean = ts.find_seam(a, b, mask_a, mask_b)
    a[~mask_a], b[~mask_b] = np.nan, np.inf
    np.testing.assert_array_equal(ts.find_seam(a, b, mask_a, mask_b).labels, clean.labels)


def test_a_patch_inside_the_other_shows_at_least_its_core():
    mask_b = np.zeros((40, 40), bool)
    mask_b[8:32, 10:30] = True
    rng = np.random.default_rng(5)
    a, b = rng.random((2, 40, 40))
    for core in (0.2, 0.8):
        seam = ts.find_seam(a, b, None, mask_b, core=core)
        assert [line.closed for line in seam.paths] == [True]
        assert seam.labels[20, 20]
        assert not seam.labels[~mask_b].any()
    # The other way round a lies inside b.
    seam = ts.find_seam(a, b, mask_b, None)
    assert not seam.labels[20, 20]
    assert seam.labels[~mask_b].all()


def test_where_the_overlap_is_one_pixel_wide_the_seam_takes_one_of_its_two_sides():
    mask_a, mask_b = np.zeros((2, 8, 9), bool)
    mask_a[:, :5], mask_b[:, 4:] = True, True
    a, b = np.zeros((8, 9)), np.ones((8, 9))
    for method in ("heat", "shortest-path", "graph-cut"):
        seam = ts.find_seam(a, b, mask_a, mask_b, method=method)
        assert not seam.labels[:, :4].any()
        assert seam.labels[:, 5:].all()
        assert len(seam.paths) == 1


def test_two_pixels_leave_one_seam_between_them():
    seam = ts.find_seam(np.zeros((4, 2)), np.ones((4, 2)), gradient=False)
    np.testing.assert_array_equal(seam.labels, [[False, True]] * 4)
    assert seam.cost == pytest.approx(4 * (2 + 1e-3))


def test_patches_apart_are_refused():
    mask = np.zeros((6, 6), bool)
    mask[:, :3] = True
    with pytest.raises(ts.OverlapError, match="do not overlap"):
        ts.find_seam(np.zeros((6, 6)), np.zeros((6, 6)), mask, ~mask)


def test_identical_masks_are_refused_with_the_remedy():
    with pytest.raises(ts.OverlapError, match="let one of them reach beyond the other"):
        between_masks(np.ones((5, 5), bool), np.ones((5, 5), bool))


@pytest.mark.parametrize("shape", [(1, 1), (5, 1)])
def test_an_overlap_too_thin_for_a_seam_is_refused(shape):
    with pytest.raises(ts.OverlapError, match="at least 2 px"):
        ts.find_seam(np.zeros(shape), np.zeros(shape))


def test_a_single_row_is_cut_once():
    seam = ts.find_seam(
        np.array([[0.0, 0.2, 0.9, 0.1]]),
        np.array([[0.5, 0.2, 0.1, 0.6]]),
        gradient=False,
        method="shortest-path",
    )
    np.testing.assert_array_equal(seam.labels, [[False, True, True, True]])


def test_an_unknown_side_is_refused():
    with pytest.raises(ts.OptionError, match="choose one of"):
        side_by_side((5, 5), "up")  # type: ignore[arg-type]
    assert SIDES == ("right", "left", "bottom", "top")


def test_excluding_every_pixel_says_so_for_every_method():
    mask_b = np.zeros((9, 9), bool)
    mask_b[1:-1, 1:-1] = True
    a = np.random.default_rng(6).random((9, 9))
    for method in ("heat", "thesis", "shortest-path", "graph-cut"):
        with pytest.raises(ts.OverlapError, match="no seam avoids"):
            ts.find_seam(a, 1 - a, None, mask_b, method=method, avoid=np.ones((9, 9)))
