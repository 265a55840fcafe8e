"""Unwanted steps are spread as least squares ask for."""

import numpy as np
import pytest

from toposeam.heat.poisson import add_steps, spread, spread_in_cycle


def steps_of(shape, cyclic, weights, rng):
    """Every pair of neighbours of a grid as a row of a matrix, unwanted steps at random, their weights."""
    number = np.arange(np.prod(shape)).reshape(shape)
    rows, wanted, weight = [], [], []
    for axis, share in enumerate(weights):
        low = number if axis == 0 and cyclic else number.take(range(shape[axis] - 1), axis)
        high = np.roll(number, -1, 0) if axis == 0 and cyclic else number.take(range(1, shape[axis]), axis)
        part = np.zeros((low.size, number.size))
        part[np.arange(low.size), low.ravel()] = -1
        part[np.arange(low.size), high.ravel()] = 1
        rows.append(part)
        wanted.append(rng.standard_normal(low.shape))
        weight.append(np.full(low.size, share))
    return np.concatenate(rows), wanted, np.concatenate(weight)


@pytest.mark.parametrize("width", [None, 2.5])
def test_a_plane_is_corrected_as_least_squares_ask(width):
    shape = (5, 7)
    matrix, wanted, _ = steps_of(shape, False, (1.0, 1.0), np.random.default_rng(0))
    source = np.zeros(shape)
    for axis, step in enumerate(wanted):
        low, high = (
            tuple(slice(*ends) if axis == k else slice(None) for k in range(2))
            for ends in ((None, -1), (1, None))
        )
        add_steps(source, low, high, step)
    step = np.concatenate([part.ravel() for part in wanted])
    if width is not None:
        matrix, step = np.vstack([matrix, np.eye(35) / width]), np.append(step, np.zeros(35))
    best = np.linalg.lstsq(matrix, -step, rcond=None)[0].reshape(shape)
    np.testing.assert_allclose(spread(source, width), best, atol=1e-10)


@pytest.mark.parametrize("count", [4, 5])
@pytest.mark.parametrize("stiffness", [0.3, 4.0])
def test_a_cycle_of_frames_is_corrected_as_least_squares_ask(count, stiffness):
    shape = (count, 3, 4)
    matrix, wanted, weight = steps_of(shape, True, (1.0, stiffness, stiffness), np.random.default_rng(1))
    source = np.zeros(shape)
    frames = np.arange(count)
    add_steps(source, frames, np.roll(frames, -1), wanted[0])
    add_steps(source, np.s_[:, :-1], np.s_[:, 1:], wanted[1], stiffness)
    add_steps(source, np.s_[:, :, :-1], np.s_[:, :, 1:], wanted[2], stiffness)
    step = np.concatenate([part.ravel() for part in wanted])
    root = np.sqrt(weight)
    best = np.linalg.lstsq(matrix * root[:, None], -step * root, rcond=None)[0].reshape(shape)
    found = spread_in_cycle(source.astype(np.float32), stiffness)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, best, atol=1e-5)
