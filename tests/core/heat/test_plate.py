"""The plate against closed forms, finite differences and direct solutions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from toposeam.errors import OptionError, SolverError
from toposeam.heat.plate import CONDUCTION, Plate
from toposeam.heat.plate_joints import Groups, Joint, Shift
from toposeam.heat.plate_multigrid import DirectSolver, Hierarchy, coarsen

JOINTS = [*Joint, Shift(1, Fraction(1, 2)), Shift(0, Fraction(1, 2))]
EXACT = {"tolerance": 1e-12, "max_iterations": 300}


def _loads(shape, seed=0):
    rng = np.random.default_rng(seed)
    heat, sinks = np.zeros(shape), np.zeros(shape)
    heat[tuple(rng.integers(0, side, 5) for side in shape)] = 1.0
    sinks[tuple(rng.integers(0, side, 4) for side in shape)] = 0.5
    return heat, sinks


def _dense_solution(plate, heat, sinks, k):
    """Assembled element by element, reduced by an explicit T (4.9)."""
    h, w = plate.shape
    count = (h + 1) * (w + 1)
    matrix, load = np.zeros((count, count)), np.zeros(count)
    for y in range(h):
        for x in range(w):
            nodes = [y * (w + 1) + x, y * (w + 1) + x + 1, (y + 1) * (w + 1) + x, (y + 1) * (w + 1) + x + 1]
            matrix[np.ix_(nodes, nodes)] += k[y, x] * CONDUCTION + sinks[y, x] * np.eye(4) / 4
            load[nodes] += heat[y, x] / 4
    number, free = Groups(plate.shape, plate.joint).numbering(count)
    t = np.zeros((count, free))
    t[np.arange(count), number] = 1.0
    return (t @ np.linalg.solve(t.T @ matrix @ t, t.T @ load)).reshape(h + 1, w + 1), t.T @ load


@pytest.mark.medium
@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("shape", [(24, 32), (26, 36)])
def test_temperatures_are_those_of_the_assembled_system(joint, shape):
    heat, sinks = _loads(shape)
    plate = Plate(heat, sinks, joint)
    k = 1e-3 + np.random.default_rng(1).random(shape) ** 6
    expected, _ = _dense_solution(plate, heat, sinks, k)
    state = plate.solve(k, **EXACT)
    assert state.nodes == pytest.approx(expected, rel=1e-8)
    assert state.iterations <= 300  # the multigrid solver found it, not the direct one


def test_an_odd_free_plate_coarsens_exactly():
    shape = (23, 31)
    heat, sinks = _loads(shape)
    plate = Plate(heat, sinks)
    k = 1e-3 + np.random.default_rng(1).random(shape) ** 6
    expected, _ = _dense_solution(plate, heat, sinks, k)
    state = plate.solve(k, **EXACT)
    assert 0 < state.iterations <= 300
    assert state.nodes == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("joint", JOINTS)
def test_the_border_shares_temperatures_as_the_joint_says(joint):
    shape = (16, 24)
    state = Plate(*_loads(shape), joint).solve(np.ones(shape), **EXACT)
    left, right, top, bottom = state.nodes[:, 0], state.nodes[:, -1], state.nodes[0], state.nodes[-1]
    if joint is Joint.TRANSLATE:
        assert np.array_equal(left, right)
        assert np.array_equal(top, bottom)
    elif joint is Joint.ROTATE:  # (4.7)
        assert all(np.array_equal(side, side[::-1]) for side in (left, right, top, bottom))
    elif joint == Shift(1, Fraction(1, 2)):
        assert np.array_equal(left, right)
        assert np.array_equal(top[:-1], np.roll(bottom[:-1], 12))
    elif joint == Shift(0, Fraction(1, 2)):
        assert np.array_equal(top, bottom)
        assert np.array_equal(right[:-1], np.roll(left[:-1], 8))
    else:
        assert not np.allclose(left, right)


def test_the_next_column_lies_a_quarter_lower():
    shape = (16, 24)
    state = Plate(*_loads(shape), Shift(0, Fraction(1, 4))).solve(np.ones(shape), **EXACT)
    left, right = state.nodes[:, 0], state.nodes[:, -1]
    assert np.array_equal(state.nodes[0], state.nodes[-1])
    assert np.array_equal(right[:-1], np.roll(left[:-1], 4))  # row y of the next is row y - 4 of this one


@pytest.mark.parametrize("joint", JOINTS)
def test_element_energies_are_the_derivatives_of_the_compliance(joint):
    shape = (16, 16)
    plate = Plate(*_loads(shape), joint)
    k = 0.1 + np.random.default_rng(2).random(shape)
    state = plate.solve(k, **EXACT)
    step = 1e-4  # small against the conductivities, large against the solver's rounding
    for place in [(0, 0), (0, 7), (5, 15), (9, 4)]:
        up, down = k.copy(), k.copy()
        up[place] += step
        down[place] -= step
        slope = (plate.solve(up, **EXACT).compliance - plate.solve(down, **EXACT).compliance) / (2 * step)
        assert -state.energy[place] == pytest.approx(slope, rel=1e-5)


def test_heat_through_a_bar_falls_linearly():
    """Heat generated in the first column leaves in the last: k θ' = 1 between them."""
    heat, sinks = np.zeros((4, 64)), np.zeros((4, 64))
    heat[:, 0], sinks[:, -1] = 1.0, 1.0
    nodes = Plate(heat, sinks).solve(np.full((4, 64), 2.0), **EXACT).nodes
    assert np.diff(nodes[:, 1:-1], axis=1) == pytest.approx(-0.5, rel=1e-8)


def test_a_stalled_iteration_hands_over_to_the_direct_solution():
    shape = (32, 32)
    plate = Plate(*_loads(shape), "translate")
    k = 1e-3 + np.random.default_rng(1).random(shape) ** 6
    state = plate.solve(k, tolerance=1e-10, max_iterations=2)
    assert state.iterations == 3
    assert state.nodes == pytest.approx(plate.solve(k, **EXACT).nodes, rel=1e-8)


def test_the_direct_solver_knows_singular_plates():
    heat, sinks = _loads((8, 8))
    plate = Plate(heat, sinks * 1e-300, "translate")
    with pytest.raises(SolverError, match="sink"):
        DirectSolver(plate._stencil(np.zeros((8, 8))))


@pytest.mark.parametrize(
    ("heat", "sinks", "text"),
    [
        (0.0, 1.0, "no heat source"),
        (1.0, 0.0, "no heat sink"),
        (-1.0, 1.0, "not negative"),
        (float("nan"), 1.0, "finite"),
    ],
)
def test_plates_without_a_solution_are_refused(heat, sinks, text):
    with pytest.raises(OptionError, match=text):
        Plate(np.full((8, 8), heat), np.full((8, 8), sinks), "translate")


@pytest.mark.parametrize("shape", [(9, 4), (4, 9), (9, 3), (6, 4), (5, 7)])
def test_a_coarser_plate_pads_odd_borders_with_zeros(shape):
    elements = np.random.default_rng(0).random((1, *shape))
    patterns = np.random.default_rng(1).random((10, 1))
    padded = np.pad(elements, ((0, 0), (0, shape[0] % 2), (0, shape[1] % 2)))
    found = coarsen(elements, patterns)
    assert found.shape == (10, -(-shape[0] // 2), -(-shape[1] // 2))
    np.testing.assert_array_equal(found, coarsen(padded, patterns))


@pytest.mark.parametrize(
    ("shape", "joint", "coarser"),
    [
        ((19, 19), Joint.FREE, []),  # 400 nodes are few enough
        ((20, 19), Joint.FREE, [(10, 10)]),
        ((7, 60), Joint.FREE, []),  # too narrow
        ((8, 60), Joint.FREE, [(4, 30)]),
        ((40, 80), Joint.FREE, [(20, 40), (10, 20)]),
        ((40, 80), Joint.TRANSLATE, [(20, 40), (10, 20)]),
        ((41, 80), Joint.TRANSLATE, []),  # joined borders have to meet on the coarser plate too
    ],
)
def test_plates_are_halved_while_they_are_large_wide_and_even(shape, joint, coarser):
    assert Hierarchy(shape, joint).shapes == [shape, *coarser]
