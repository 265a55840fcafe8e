"""Heat in a block: against networks solved exactly, a rod by hand, and differences."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

import toposeam as ts
from toposeam.heat.block import Block


def problem(shape=(8, 12, 16), seed=0):
    rng = np.random.default_rng(seed)
    heat, sink = rng.random(shape), np.zeros(shape)
    sink[0, 2:4, 3:5] = 1.5
    return heat, sink, np.where(rng.random(shape) > 0.5, 1.0, 1e-3)


def exact(heat, sink, k, joined):
    """Every face a resistor of two halves in series, assembled as a matrix."""
    number = np.arange(k.size).reshape(k.shape)
    rows, columns, values = [], [], []
    for axis in range(3):
        there, beyond = np.roll(number, -1, axis), np.roll(k, -1, axis)
        g = 1 / (0.5 / k + 0.5 / beyond)
        if not joined or axis == 0:
            g = np.moveaxis(g, axis, 0).copy()
            g[-1] = 0
            g = np.moveaxis(g, 0, axis)
        for a, b, sign in (
            (number, number, 1),
            (there, there, 1),
            (number, there, -1),
            (there, number, -1),
        ):
            rows.append(a.ravel())
            columns.append(b.ravel())
            values.append(sign * g.ravel())
    rows.append(number.ravel())
    columns.append(number.ravel())
    values.append(sink.ravel())
    matrix = coo_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (k.size, k.size)
    )
    return spsolve(matrix.tocsr(), heat.ravel()).reshape(k.shape)


@pytest.mark.parametrize("joined", [False, True])
def test_temperatures_are_those_of_the_network(joined):
    heat, sink, k = problem()
    found = Block(heat, sink, joined).solve(k, tolerance=1e-9)
    np.testing.assert_allclose(found.cubes, exact(heat, sink, k, joined), rtol=1e-6)


def test_a_rod_warms_up_as_by_hand():
    """Heat 1 enters one end of 16 cubes in a row and leaves the other: h = 1/2 there, then a step of 1."""
    heat, sink = np.zeros((16, 4, 4)), np.zeros((16, 4, 4))
    heat[15], sink[0] = 1 / 16, 0.5 / 16
    found = Block(heat, sink).solve(np.ones((16, 4, 4)), tolerance=1e-10)
    np.testing.assert_allclose(found.cubes[:, 1, 2], 2 + np.arange(16) / 16, rtol=1e-6)
    assert found.compliance == pytest.approx(2 + 15 / 16)


@pytest.mark.parametrize("joined", [False, True])
def test_the_energy_is_the_slope_of_the_compliance(joined):
    heat, sink, k = problem((8, 8, 8))
    block = Block(heat, sink, joined)
    k = k + 0.1
    state = block.solve(k, tolerance=1e-11)
    for place in ((0, 0, 0), (7, 3, 7), (4, 4, 4)):
        change = np.zeros(k.shape)
        change[place] = 1e-5
        slope = (
            block.solve(k + change, tolerance=1e-11).compliance
            - block.solve(k - change, tolerance=1e-11).compliance
        ) / 2e-5
        assert -state.energy[place] == pytest.approx(slope, rel=1e-4, abs=1e-8)


@pytest.mark.medium
def test_iterations_hardly_grow_with_the_block():
    counts = []
    for side in (16, 32):
        heat, sink, _ = problem((side, side, side))
        rng = np.random.default_rng(3)
        coarse = rng.random((8, 8, 8)) > 0.5
        k = np.where(coarse.repeat(side // 8, 0).repeat(side // 8, 1).repeat(side // 8, 2), 1.0, 1e-3)
        counts.append(Block(heat, sink).solve(k).iterations)
    assert counts[1] <= counts[0] + 15
    assert max(counts) < 60


def test_what_cannot_be_solved_is_said():
    heat, sink, k = problem((8, 8, 8))
    for a, b, text in (
        (heat[0], sink[0], "two"),
        (0 * heat, sink, "above 0"),
        (heat, 0 * sink, "above 0"),
        (heat, sink - 1, "negative"),
        (heat * np.nan, sink, "finite"),
    ):
        with pytest.raises(ts.OptionError, match=text):
            Block(a, b)
    with pytest.raises(ts.SolverError, match="iterations"):
        Block(heat, sink).solve(k, max_iterations=1)
