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
    ts.motif.kaleidoscope(np.zeros((8, 8)), "p1", (450, 500), progress=shares.append)
    assert len(shares) > 1
    assert np.all(np.diff([0.0, *shares]) > 0)
    assert shares[-1] == 1


TURNS = {"p3": 3, "p31m": 3, "p3m1": 3, "p6": 6, "p6m": 6}
#: What a group mirrors, across (x, y).
FLIPS = {"p31m": (1, -1), "p3m1": (-1, 1), "p6m": (1, -1)}


def shown_of_ramps(columns, repeat, feather):
    """A hexagonal cell of a picture whose value at (x, y) px from the domain's centre is (x, y), by turns and
    flips in px instead of lattice coordinates.
    """
    first, second = np.array([columns, 0.0]), columns * np.array([-0.5, np.sqrt(0.75)])
    rows = round(columns * np.sqrt(3))
    y, x = np.mgrid[:rows, :columns] + 0.5
    place = np.stack([x, y], axis=-1)
    copies = []
    for k in range(TURNS[repeat]):
        cos, sin = np.cos(2 * np.pi * k / TURNS[repeat]), np.sin(2 * np.pi * k / TURNS[repeat])
        for flip in {(1, 1), FLIPS.get(repeat, (1, 1))}:
            turned = place * flip @ np.array([[cos, sin], [-sin, cos]])
            copies += [
                turned + i * first + j * second - 0.29 * first - 0.17 * second
                for i in range(-4, 5)
                for j in range(-4, 5)
            ]
    away = np.stack(copies)
    distance = np.linalg.norm(away, axis=-1)
    weight = np.exp((distance.min(axis=0) - distance) / (feather * columns))
    return (weight[..., np.newaxis] * away).sum(axis=0) / weight.sum(axis=0)[..., np.newaxis]


@pytest.mark.parametrize("repeat", TURNS)
def test_hexagonal_cells_are_turns_and_flips_of_the_middle(repeat):
    columns, side = 26, 121
    ramp = np.arange(side) / side
    picture = np.stack(np.broadcast_arrays(ramp, ramp[:, np.newaxis], 0.5), axis=-1)
    cell = ts.motif.kaleidoscope(picture, repeat, (2, columns), at=(50, 70))
    expected = shown_of_ramps(columns, repeat, feather=0.01) + np.array([50 - 0.5, 70 - 0.5])
    np.testing.assert_allclose(cell[..., :2] * side, expected, atol=0.15)
    np.testing.assert_allclose(cell[..., 2], 0.5, atol=1e-6)


@pytest.mark.parametrize("feather", [0.0, 0.08])
def test_unlike_parts_mix_by_how_far_each_is_from_the_middle(feather):
    """Shifts only, cells longer than wide, and the mixture of what lies nearly as near."""
    rows, columns, side = 21, 33, 161
    ramp = np.arange(side) / side
    picture = np.stack(
        [np.broadcast_to(ramp, (side, side)), np.broadcast_to(ramp[:, None], (side, side))], -1
    )
    cell = ts.motif.kaleidoscope(picture[..., [0, 1, 1]], "p1", (rows, columns), feather=feather)
    y, x = np.mgrid[:rows, :columns] + 0.5
    away = np.stack(
        [
            np.stack([x + (i - 0.29) * columns, y + (j - 0.17) * rows], axis=-1)
            for i in range(-3, 4)
            for j in range(-3, 4)
        ]
    )
    distance = np.linalg.norm(away, axis=-1)
    behind = distance - distance.min(axis=0)
    weight = np.exp(-behind / (feather * rows)) if feather else (behind < 1e-9).astype(float)
    expected = (weight[..., None] * away).sum(axis=0) / weight.sum(axis=0)[..., None] + side / 2 - 0.5
    np.testing.assert_allclose(cell[..., :2] * side, expected, atol=0.15 if feather else 1e-3)


def test_the_domain_may_lie_anywhere_in_the_picture():
    picture = np.zeros((12, 20))
    for at in ((0, 0), (20, 12), (20, 0)):
        assert ts.motif.kaleidoscope(picture, "p1", (4, 4), at=at).shape == (4, 4)
    for at in ((20.5, 6), (10, 12.5), (-0.5, 6), (10, -0.5)):
        with pytest.raises(ts.OptionError, match="outside"):
            ts.motif.kaleidoscope(picture, "p1", (4, 4), at=at)
    for at in ((1, 2, 3), 4):
        with pytest.raises(ts.OptionError, match="at"):
            ts.motif.kaleidoscope(picture, "p1", (4, 4), at=at)
    with pytest.raises(ts.OptionError, match="400"):
        ts.motif.kaleidoscope(picture, "p1", (20_001, 20_000))
    assert ts.motif.kaleidoscope(picture, "p1", (4, 4), feather=0.5).shape == (4, 4)
