"""Which pixels are decided before any seam is sought."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.seam.problem import FREE, SIDES, A, B, between_masks, side_by_side


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


def person():
    """Head, neck, body and two legs, (200, 160) bool."""
    y, x = np.mgrid[:200, :160]
    beside = abs(x - 80)
    head, neck = np.hypot(y - 35, beside) < 18, (beside < 5) & (y > 45) & (y < 60)
    body, legs = (beside < 26) & (y > 50) & (y < 120), (abs(beside - 14) < 9) & (y >= 120) & (y < 185)
    return head | neck | body | legs


def test_core_is_the_share_of_a_patch_s_depth_that_shows():
    inside = person()
    a, b = np.random.default_rng(7).random((2, *inside.shape))
    shown = {
        core: ts.find_seam(a, b, None, inside, core=core, gradient=True).labels for core in (0.05, 0.5, 0.9)
    }
    share = {core: labels.sum() / inside.sum() for core, labels in shown.items()}
    assert 0 < share[0.05] < 0.05 < share[0.5] < 0.5 < 0.8 < share[0.9] < 1
    for y, x in ((35, 80), (180, 66), (180, 94)):  # head and feet
        assert shown[0.9][y, x]
        assert not shown[0.05][y, x]
    assert shown[0.05][85, 80]  # the middle of the body


def test_a_core_of_1_is_all_but_the_border():
    inside = person()
    side = between_masks(np.ones_like(inside), inside, 1)
    np.testing.assert_array_equal(
        side.side == B, side.window(ndimage.binary_erosion(inside, np.ones((3, 3)))).astype(bool)
    )


def squares(*sizes):
    """Squares beside each other, (60, 120) bool, each 25 px right of the one before."""
    mask = np.zeros((60, 120), bool)
    for place, size in enumerate(sizes):
        mask[10 : 10 + size, 10 + 25 * place : 10 + 25 * place + size] = True
    return mask


@pytest.mark.parametrize(
    ("sizes", "options", "must"),
    [
        ((20, 5), {}, [20]),
        ((20, 5), {"speck": 0}, [20, 5]),
        ((20, 5), {"speck": 10}, [20]),
        ((20, 5), {"speck": 9}, [20, 5]),  # of 5 × 5 px 3 × 3 may show
        ((20, 10), {}, [20, 10]),
        ((20, 9), {}, [20]),  # 7 × 7
        ((5,), {}, [5]),
        ((5, 7, 4), {}, [7]),  # nothing but specks
        ((20, 10), {"core": 0.05}, [20, 10]),
        ((20, 15, 10), {"speck": 200}, [20]),
        ((7, 15, 10), {"speck": 1000}, [15]),
    ],
)
@pytest.mark.parametrize("turned", [False, True])
def test_specks_inside_the_other_patch_force_nothing(sizes, options, must, turned):
    inside = squares(*sizes)
    masks = (inside, np.ones_like(inside)) if turned else (np.ones_like(inside), inside)
    overlap = between_masks(*masks, **options)
    fixed, outer = (overlap.side == (A if turned else B)), (overlap.side == (B if turned else A))
    for place, size in enumerate(sizes):
        square = overlap.window(squares(*[0] * place, size)).astype(bool)
        if size in must:
            assert fixed[square].any()
        else:
            assert outer[square].all()


def test_speck_size_grows_with_the_patch_inside():
    on_b = np.zeros((1000, 1000), bool)
    on_b[100:700, 100:700] = on_b[800:820, 800:820] = True  # 0.05 % of it are 180 px, and 18 × 18 may show
    assert (between_masks(np.ones_like(on_b), on_b).side[700:] == B).any()
    on_b[100:950, 100:760] = True  # 280
    on_b[815:820] = False
    assert not (between_masks(np.ones_like(on_b), on_b).side[:, 690:] == B).any()
    reaching = squares(20, 5)
    elsewhere = np.ones_like(reaching)
    elsewhere[:, :15] = False  # the large one reaches out, so that the small one is not the largest inside
    overlap = between_masks(elsewhere, reaching)
    assert not (overlap.side[overlap.window(squares(0, 5)).astype(bool)] == B).any()


def test_a_speck_of_volume_forces_nothing_either():
    on_b = np.zeros((20, 20, 40), bool)
    on_b[3:17, 3:17, 3:17] = on_b[5:10, 5:10, 25:30] = True
    a, b = np.random.default_rng(8).random((2, *on_b.shape))
    shown = [ts.find_surface(a, b, None, on_b, speck=speck).labels for speck in (None, 28, 27, 0)]
    assert [bool(labels[:, :, 25:30].any()) for labels in shown] == [False, False, True, True]
    assert all(labels[9:11, 9:11, 9:11].all() for labels in shown)


def test_the_seam_closes_tightly_round_a_hole_of_one_pixel():
    mask_a, mask_b = np.zeros((2, 30, 40), bool)
    mask_a[:, :30], mask_b[:, 10:] = True, True
    mask_a[12, 14] = False
    a, b = np.zeros((30, 40)), np.ones((30, 40))
    b[:, 24:26] = 0  # there the seam runs
    labels = ts.find_seam(a, b, mask_a, mask_b, gradient=False).labels
    piece, _ = ndimage.label(labels)
    rows, columns = np.nonzero(piece == piece[12, 14])
    assert {(12, 14), (11, 14), (13, 14), (12, 13), (12, 15)} <= {*zip(rows, columns, strict=True)}
    assert abs(rows - 12).max() == abs(columns - 14).max() == 1


def ragged(rng, distance, width):
    """Where a distance is below 0, its border blurred by noise so many px wide."""
    noise = [ndimage.gaussian_filter(rng.standard_normal(distance.shape), sigma) for sigma in (0.7, 2)]
    return distance < width * sum(one / one.std() for one in noise)


def salt(labels, mask_a, mask_b, limit=64):
    """How many pieces of one patch that the other one could cover as well are smaller than so many px."""
    count = 0
    for shown, own in ((labels & mask_b, mask_b & ~mask_a), (~labels & mask_a, mask_a & ~mask_b)):
        piece, _ = ndimage.label(shown)
        size = np.bincount(piece.ravel())
        alone = np.bincount(piece[own], minlength=len(size)) > 0
        joined = (
            np.bincount(piece[ndimage.binary_dilation((mask_a | mask_b) & ~shown)], minlength=len(size)) > 0
        )
        count += int(((size < limit) & ~alone & joined)[1:].sum())
    return count


@pytest.mark.medium
def test_ragged_masks_leave_no_salt():
    y, x = np.mgrid[:60, :80]
    found = {None: 0, 0: 0}
    for seed in range(200):
        rng = np.random.default_rng(seed)
        width = rng.uniform(2, 10)
        if seed % 4 < 2:  # strips
            masks = ragged(rng, x - 53, width), ragged(rng, 27 - x, width)
        else:  # one inside the other, whose own border is ragged, too, half of the time
            outer = ragged(rng, 3 - np.minimum.reduce([y, x, 59 - y, 79 - x]), width)
            inner = ragged(rng, np.maximum(1.35 * abs(y - 30), abs(x - 40)) - 27, width)
            masks = outer if seed % 4 == 2 else np.ones_like(outer), inner
        a, b = rng.random((2, 60, 80))
        for speck in (None, 0) if seed < 20 else (None,):
            labels = ts.find_seam(a, b, *masks, speck=speck, gradient=False).labels
            found[speck] += salt(labels, *masks)
    assert found[None] == 0
    assert found[0] > 20


@pytest.mark.parametrize("speck", [-1, float("nan"), "large"])
def test_a_size_of_specks_that_is_none_is_refused(speck):
    with pytest.raises(ts.OptionError, match="speck"):
        between_masks(*np.ones((2, 5, 5), bool), speck=speck)
    with pytest.raises(ts.OptionError, match="speck"):
        ts.stitch([ts.Layer(np.zeros((9, 9)), at=(6 * k, 0)) for k in range(3)], speck=speck)


def test_the_seam_of_a_one_pixel_overlap_takes_one_side():
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
