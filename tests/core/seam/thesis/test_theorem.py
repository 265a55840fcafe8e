"""docs/theorem.md: eliminating the density from Formulation 1."""

import numpy as np
import pytest
from scipy import optimize
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra


def _norm(cost, flux, power):
    """Σ M^(2p/(p+1)) |q|^(2/(p+1))."""
    return np.sum(cost ** (2 * power / (power + 1)) * np.abs(flux) ** (2 / (power + 1)))


@pytest.mark.parametrize("power", [1, 2, 3])
def test_the_least_mass_for_a_given_flux(power):
    rng = np.random.default_rng(power)
    cost, flux, bound = rng.uniform(0.2, 2, 7), rng.uniform(-1, 1, 7), 3.0
    found = optimize.minimize(
        lambda logs: np.sum(cost**2 * np.exp(logs)),
        np.zeros(7),
        constraints={
            "type": "ineq",
            "fun": lambda logs: np.log(bound) - np.log(np.sum(flux**2 * np.exp(-power * logs))),
        },
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-12},
    )
    expected = _norm(cost, flux, power) ** ((power + 1) / power) / bound ** (1 / power)
    assert found.success
    assert found.fun == pytest.approx(expected, rel=1e-5)


def _grid(rows, columns):
    """Ends of the elements of a grid of corners."""
    number = np.arange(rows * columns).reshape(rows, columns)
    return np.concatenate(
        [
            np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], axis=1),
            np.stack([number[:-1].ravel(), number[1:].ravel()], axis=1),
        ]
    )


def test_without_penalty_the_least_mass_is_the_shortest_path():
    """The optimiser knows conductances and the compliance of the network alone."""
    ends, count, bound = _grid(3, 4), 12, 2.0
    cost = np.random.default_rng(4).uniform(0.3, 2, len(ends))
    incidence = coo_array(
        (np.tile([1.0, -1.0], len(ends)), (np.repeat(np.arange(len(ends)), 2), ends.ravel())),
        shape=(len(ends), count),
    ).toarray()
    heat = np.zeros(count)
    heat[[0, -1]] = 1, -1

    def compliance(density):
        stiffness = incidence.T @ (density[:, np.newaxis] * incidence)
        temperature = np.linalg.lstsq(stiffness, heat, rcond=None)[0]
        return heat @ temperature, -np.square(incidence @ temperature)

    found = optimize.minimize(
        lambda density: cost**2 @ density,
        np.ones(len(ends)),
        jac=lambda density: cost**2,
        bounds=[(1e-7, None)] * len(ends),
        constraints={
            "type": "ineq",
            "fun": lambda density: bound - compliance(density)[0],
            "jac": lambda density: -compliance(density)[1],
        },
        method="SLSQP",
        options={"maxiter": 2000, "ftol": 1e-12},
    )
    graph = coo_array((cost, ends.T), shape=(count, count)).tocsr()
    shortest = dijkstra(graph, directed=False, indices=0)[-1]
    assert found.fun == pytest.approx(shortest**2 / bound, rel=1e-3)


def test_reweighting_comes_to_rest_where_the_quasi_norm_does():
    """Of two parallel ways that share the flux, the weights W ÷ q leave the cheaper one."""
    cost, share = np.array([1.0, 1.02]), np.array([0.5, 0.5])
    weight = cost**2
    for _ in range(30):
        # A flux divides in proportion to conductances, and the best density at p = 1 is q ÷ √W.
        density = share / np.sqrt(weight)
        conductance = np.maximum(density, 1e-9)
        share = conductance / conductance.sum()
        weight = cost**2 / np.maximum(share, 1e-9)
    assert share[0] > 0.999
    assert _norm(cost, np.array([1.0, 0.0]), 3) < _norm(cost, np.array([0.5, 0.5]), 3)
