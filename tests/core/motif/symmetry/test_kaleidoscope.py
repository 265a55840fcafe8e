"""Kaleidoscopes: every group's own symmetry, no hard borders, and the picture undistorted in the middle."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.motif.symmetry import GENERATORS, GROUPS, operations
from toposeam.motif.symmetry.rules import permutation


@pytest.fixture(scope="module")
def photograph():
    from scipy.ndimage import gaussian_filter

    rng = np.random.default_rng(3)
    return gaussian_filter(rng.random((160, 200, 3)), (4, 4, 0)) * 8 - 3.5


@pytest.mark.parametrize("repeat", [group for group in GROUPS if group in GENERATORS])
def test_the_cell_has_the_group(photograph, repeat):
    cell = ts.motif.kaleidoscope(np.clip(photograph, 0, 1), repeat, (48, 48)).reshape(-1, 3)
    for operation in operations(repeat):
        image = permutation(operation, (48, 48)).ravel()
        np.testing.assert_allclose(cell[image], cell, atol=2e-6)


@pytest.mark.parametrize("repeat", ["p3", "p31m", "p3m1", "p6", "p6m"])
def test_hexagonal_cells_turn_by_their_angle(photograph, repeat):
    from scipy.ndimage import affine_transform

    cell = ts.motif.kaleidoscope(np.clip(photograph, 0, 1), repeat, (2, 120), feather=0.05)[..., 0]
    assert cell.shape == (208, 120)
    pattern = np.tile(cell, (3, 5)).astype(float)
    centre = np.array([208 - 0.5, 240 - 0.5])  # a lattice point
    angle = np.deg2rad(60 if repeat in ("p6", "p6m") else 120)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = affine_transform(pattern, turn, centre - turn @ centre, order=1)
    window = np.s_[108:308, 140:340]
    assert np.abs(turned - pattern)[window].mean() < 0.01 < np.std(pattern[window]) / 5


def test_the_middle_is_the_picture_itself(photograph):
    picture = np.clip(photograph, 0, 1)
    cell = ts.motif.kaleidoscope(picture, "p1", (60, 80), at=(90, 70))
    y, x = 11, 24  # about the centre of the domain, (0.29, 0.17) of the cell
    away = np.array([y + 0.5 - 0.17 * 60, x + 0.5 - 0.29 * 80])
    from scipy.ndimage import map_coordinates

    for channel in range(3):
        where = np.array([70 + away[0] - 0.5, 90 + away[1] - 0.5])[:, None]
        expected = map_coordinates(picture[..., channel].astype(np.float32), where, order=1)
        assert cell[y, x, channel] == pytest.approx(expected[0], abs=1e-5)


@pytest.mark.parametrize("repeat", ["p1", "pgg", "p4"])
def test_a_feather_takes_the_edge_off_the_borders(photograph, repeat):
    picture = np.clip(photograph, 0, 1)
    steps = [
        np.abs(
            np.diff(np.tile(ts.motif.kaleidoscope(picture, repeat, (64, 64), feather=f), (2, 2, 1)), axis=0)
        ).max()
        for f in (0.0, 0.05)
    ]
    assert steps[1] < 0.5 * steps[0]


def test_gray_pictures_stay_gray_and_bad_ones_are_refused():
    assert ts.motif.kaleidoscope(np.ones((20, 20)), "p2", (8, 8)).shape == (8, 8)
    for options, text in (
        ({"repeat": "rotate"}, "repeat"),
        ({"cell": (0, 4)}, "cell"),
        ({"cell": (7, 7), "repeat": "pg"}, "even"),
        ({"at": (30, 3)}, "outside"),
        ({"feather": 2}, "feather"),
    ):
        given = {"repeat": "p2", "cell": (8, 8)} | options
        with pytest.raises(ts.OptionError, match=text):
            ts.motif.kaleidoscope(np.ones((20, 20)), given.pop("repeat"), given.pop("cell"), **given)


def test_progress_rises_to_the_end():
    shares = []
    ts.motif.kaleidoscope(np.zeros((8, 8)), "p4m", (600, 600), progress=shares.append)
    assert shares == sorted(shares)
    assert len(shares) > 1
    assert shares[-1] == 1
