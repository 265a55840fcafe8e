"""Differences that wide blends would mix in."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.seam.problem import STEP, Reach
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


def test_what_knows_no_reach_refuses_it():
    with pytest.raises(ts.OptionError, match="reach"):
        ts.seam.MatchCost(reach=-1)
    volume = np.zeros((8, 8, 8), np.uint8)
    with pytest.raises(ts.OptionError, match="surfaces do not know"):
        ts.find_surface(volume, volume, cost=ts.seam.MatchCost(reach=32))
    with pytest.raises(ts.OptionError, match="textures do not know"):
        ts.texture.LayOptions(cost=ts.seam.MatchCost(reach=32))
