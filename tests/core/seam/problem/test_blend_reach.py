"""Differences that wide blends would mix in."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.seam.problem import (
    STEP,
    MatchCost,
    Reach,
    any_by_steps,
    costs_on,
    side_by_side,
    within_reach,
)
from toposeam.seam.problem.blend_reach import CELL

EVERYWHERE = slice(0, 96), slice(0, 128)


def reach_of(difference: np.ndarray, known: np.ndarray, rows: int = 96, reach: float = 32) -> np.ndarray:
    planes = difference.astype(np.float32)[::STEP, ::STEP, np.newaxis]
    here, lines = known[::STEP, ::STEP], rows // STEP
    blocks = [
        (
            STEP * first,
            planes[first : first + lines],
            here[first : first + lines],
            ~here[first : first + lines],
        )
        for first in range(0, 96 // STEP, lines)
    ]
    return Reach((96, 128), blocks, reach).on(*EVERYWHERE)


def square() -> np.ndarray:
    difference = np.zeros((96, 128))
    difference[40:60, 80:100] = 0.5
    return difference


def test_reach_fades_with_distance_and_ends_with_the_blend():
    known = np.ones((96, 128), bool)
    near = reach_of(square(), known)[50, :80]
    assert (np.diff(near) >= 0).all()
    assert near[-1] > 0.3
    assert near[20] < 0.02
    narrow = reach_of(square(), known, reach=8)[50, :80]
    assert narrow[-1] > 0.1
    assert narrow[40] == pytest.approx(0, abs=1e-6)


def test_an_even_difference_has_no_reach_at_overlap_ends():
    known = np.zeros((96, 128), bool)
    known[10:83, 21:90] = True
    known[60:, 21:40] = False
    assert np.abs(reach_of(np.full((96, 128), 0.3), known)).max() < 1e-6


def test_reach_does_not_depend_on_the_blocks_it_is_made_from():
    known = np.random.default_rng(0).random((96, 128)) < 0.9
    difference = np.random.default_rng(1).normal(size=(96, 128))
    whole = reach_of(difference, known)
    np.testing.assert_allclose(reach_of(difference, known, rows=2 * CELL), whole, atol=1e-6)


def test_rows_and_columns_are_those_of_the_whole():
    difference = square().astype(np.float32)[::STEP, ::STEP, None]
    reach = Reach((96, 128), [(0, difference, np.ones((48, 64), bool), np.zeros((48, 64), bool))], 32)
    whole = reach.on(*EVERYWHERE)
    assert (reach.on(slice(37, 61), slice(70, 93)) == whole[37:61, 70:93]).all()
    assert reach.on(slice(-1, 98), slice(-1, 130)).shape == (99, 131)


def test_costs_rise_twofold_towards_the_end_of_a_picture():
    alone = np.zeros((48, 64), bool)
    alone[:, 32:] = True  # from column 64 on
    for length in (16, 32):
        blocks = [(0, np.zeros((48, 64, 1), np.float32), ~alone, alone)]
        rise = Reach((96, 128), blocks, length).rise(*EVERYWHERE)
        assert rise[:, 66:] == pytest.approx(2)
        assert rise[:, : 64 - length] == pytest.approx(1)
        # Between the middles of cells it falls evenly.
        assert rise[40, 66 - length : 66] == pytest.approx(1 + (np.arange(length) + 0.5) / length, abs=1e-3)


def test_what_a_blend_takes_away_is_taken_from_the_first():
    known = np.ones((48, 64), bool)
    known[:, 40:] = False
    difference = np.full((48, 64, 2), (0.25, -0.5), np.float32)
    reach = Reach((96, 128), [(0, difference, known, ~known)], 16)
    rows, columns = slice(10, 20), slice(70, 90)
    assert reach.even(rows, columns)[:, 3, 7] == pytest.approx([0.25, -0.5])
    a, weight = np.full((10, 20, 2), 0.75, np.float32), np.full((10, 20), 3, np.float32)
    rise = reach.rise(rows, columns)
    assert 1 < rise.mean() < 2
    for factors, wanted in ((None, rise), (weight, 3 * rise)):
        first, raised, beyond = within_reach(reach, a, factors, rows, columns, MatchCost())
        np.testing.assert_allclose(first, np.broadcast_to([0.5, 1.25], a.shape), atol=1e-6)
        np.testing.assert_allclose(raised, wanted, rtol=1e-6)
        np.testing.assert_allclose(beyond, 0, atol=1e-6)
    first, raised, _ = within_reach(reach, a, None, rows, columns, MatchCost(law="gradient"))
    assert first is a
    assert raised is None


def test_costs_of_pictures_on_their_side_are_the_same():
    """Large ones are looked at some rows at a time, and those of one are the columns of the other."""
    a, b = np.random.default_rng(3).random((2, 300, 300), np.float32)
    found = []
    for one, other, side in ((a, b, "right"), (a.T, b.T, "bottom")):
        overlap = side_by_side(one.shape, side)
        shared = overlap.shared
        found.append(costs_on(one, other, overlap, shared, shared, MatchCost(reach=32), None, None))
    (right, down), (beside, below) = found
    np.testing.assert_allclose(right, below.T, rtol=1e-4)
    np.testing.assert_allclose(down, beside.T, rtol=1e-4)


def test_squares_of_two_pixels_have_any_of_theirs():
    mask = np.zeros((5, 7), bool)
    mask[1, 2] = mask[4, 6] = True
    assert any_by_steps(mask).tolist() == [
        [False, True, False, False],
        [False] * 4,
        [False, False, False, True],
    ]


def test_what_knows_no_reach_refuses_it():
    with pytest.raises(ts.OptionError, match="reach"):
        ts.seam.MatchCost(reach=-1)
    volume = np.zeros((8, 8, 8), np.uint8)
    with pytest.raises(ts.OptionError, match="surfaces do not know"):
        ts.find_surface(volume, volume, cost=ts.seam.MatchCost(reach=32))
    with pytest.raises(ts.OptionError, match="textures do not know"):
        ts.texture.LayOptions(cost=ts.seam.MatchCost(reach=32))
