"""The primal-dual method against maximum flows, and what it claims at every step."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import maximum_flow

from toposeam.errors import SolverError
from toposeam.heat.network import Network
from toposeam.heat.primal_dual import PrimalDual


def random_network(rng, n=40, degree=3):
    """A connected graph of n nodes, some of them on a terminal; costs are whole numbers."""
    tail, head = np.arange(n - 1), np.arange(1, n)
    more = rng.integers(0, n, (degree * n, 2))
    more = more[more[:, 0] != more[:, 1]]
    ends = rng.choice(n, 6, replace=False)
    tail, head = np.r_[tail, more[:, 0], ends], np.r_[head, more[:, 1], np.repeat([n, n + 1], 3)]
    flip = rng.random(len(tail)) < 0.3
    tail, head = np.where(flip, head, tail), np.where(flip, tail, head)
    inner = Network(n, tail, head)
    network, element_map = inner.quotient(np.arange(n + 2))  # parallel elements become one
    cost = np.bincount(element_map, rng.integers(1, 1000, len(tail)), len(network.tail)).astype(float)
    return network, cost


def least_cut(network, cost):
    size = network.n + 2
    capacity = cost.astype(np.int32)
    rows, columns = np.r_[network.tail, network.head], np.r_[network.head, network.tail]
    return maximum_flow(
        coo_array((np.r_[capacity, capacity], (rows, columns)), shape=(size, size)).tocsr(),
        size - 1,
        size - 2,
    ).flow_value


def solved(network, cost, gap=1e-6):
    state = PrimalDual(network, cost)
    for _ in range(40):
        if state.best_cut()[0] <= (1 + gap) * state.bound:
            return state
        state.step()
    raise AssertionError("not proven within 40 steps")


@pytest.mark.parametrize("seed", range(20))
def test_the_cut_and_the_bound_meet_at_the_maximum_flow(seed):
    network, cost = random_network(np.random.default_rng(seed))
    state = solved(network, cost)
    exact = least_cut(network, cost)
    found, threshold = state.best_cut()
    assert found == pytest.approx(exact, rel=1e-9)
    assert state.bound == pytest.approx(exact, rel=2e-6)
    hot = state.potential > threshold
    assert cost[hot[network.tail] != hot[network.head]].sum() == pytest.approx(exact)


def test_every_step_keeps_what_the_bound_rests_on():
    network, cost = random_network(np.random.default_rng(100), n=80)
    exact = least_cut(network, cost)
    state = PrimalDual(network, cost)
    while state.best_cut()[0] > (1 + 1e-9) * state.bound:
        assert (np.abs(state.flow) < cost).all()
        assert np.abs(network.surplus(state.flow)).max() < 1e-9 * cost.max()
        assert state.bound <= exact * (1 + 1e-9)
        assert state.best_cut()[0] >= exact * (1 - 1e-9)
        state.step()


@pytest.mark.parametrize("unit", [1e-6, 2.0**-43])
def test_it_does_not_matter_in_which_unit_costs_are_given(unit):
    network, cost = random_network(np.random.default_rng(7))
    plain, scaled = PrimalDual(network, cost), PrimalDual(network, unit * cost)
    for _ in range(5):
        found, threshold = plain.best_cut()
        assert scaled.best_cut() == pytest.approx((unit * found, threshold), rel=1e-6, abs=0)
        plain.step()
        scaled.step()
    np.testing.assert_allclose(scaled.potential, plain.potential, atol=1e-6)
    assert scaled.bound == pytest.approx(unit * plain.bound, rel=1e-6)


def test_equal_seams_are_proven_equal():
    # Four nodes in two rows between the terminals: every cut across both rows costs the same.
    network = Network(4, np.array([4, 0, 1, 4, 2, 3, 0, 1]), np.array([0, 1, 5, 2, 3, 5, 2, 3]))
    state = solved(network, np.ones(8))
    assert state.best_cut()[0] == pytest.approx(2.0)


@pytest.mark.parametrize("n", [2, 10, 300])
def test_of_a_chain_the_cheapest_element_is_found(n):
    """Whose cost is that of a cut: all others count as more, however near to it."""
    cost = np.random.default_rng(n).uniform(1, 10, n + 1)
    network = Network(n, np.r_[n, np.arange(n)], np.r_[np.arange(n), n + 1])
    state = solved(network, cost)
    found, threshold = state.best_cut()
    hot = state.potential > threshold
    assert np.flatnonzero(hot[network.tail] != hot[network.head]).tolist() == [cost.argmin()]
    assert found == pytest.approx(cost.min())


def test_a_part_without_a_way_to_one_terminal_costs_nothing():
    network = Network(
        4, np.array([4, 0, 1, 4, 2]), np.array([0, 1, 5, 2, 3])
    )  # nodes 2 and 3 hang on the cold terminal only
    state = solved(network, np.array([3.0, 2.0, 5.0, 1.0, 1.0]))
    found, threshold = state.best_cut()
    assert found == pytest.approx(2.0)
    assert not (state.potential[[2, 3]] > threshold).any()


def test_costs_of_forbidden_elements_do_not_hide_the_others():
    network, cost = random_network(np.random.default_rng(8))
    rng = np.random.default_rng(9)
    forbidden = rng.random(len(cost)) < 0.05
    dear = np.where(forbidden, 1e9, cost)
    state = solved(network, dear)
    limited = least_cut(network, np.minimum(dear, cost.sum()))
    assert state.best_cut()[0] == pytest.approx(limited)


def test_a_step_that_leaves_the_numbers_changes_nothing(monkeypatch):
    """As when conductances lie further apart than double precision reaches: the best cut so far stands."""
    tail, head = np.array([2, 2, 0, 0, 1]), np.array([0, 1, 1, 3, 3])
    state = PrimalDual(Network(2, tail, head), np.array([1.0, 5.0, 1.0, 5.0, 1.5]))
    before = state.potential.copy()
    monkeypatch.setattr(Network, "factor", lambda self, conductance: lambda flows: np.full(2, np.nan))
    with pytest.raises(SolverError, match="too far apart"):
        state.step()
    np.testing.assert_array_equal(state.potential, before)


@pytest.mark.parametrize("place", [20, 80])
def test_a_cheapest_element_known_from_the_start_is_not_lost(place):
    """A threshold of the first potential finds it. If all others counted as no more than that, the potential
    would become even along the chain, and the thresholds, fewer than the elements, miss it.
    """
    cost = np.r_[np.full(150, 1.3), np.full(151, 8.0)]
    cost[place] = 1
    network = Network(300, np.r_[300, np.arange(300)], np.r_[np.arange(300), 301])
    assert PrimalDual(network, cost).best_cut()[0] == pytest.approx(1)
    state = solved(network, cost)
    found, threshold = state.best_cut()
    assert found == pytest.approx(1)
    hot = state.potential > threshold
    assert np.flatnonzero(hot[network.tail] != hot[network.head]).tolist() == [place]


def test_of_equal_cuts_the_one_in_the_middle_is_taken():
    network = Network(9, np.r_[9, np.arange(9)], np.r_[np.arange(9), 10])
    found, threshold = PrimalDual(network, np.full(10, 3.0)).best_cut()
    assert found == 3
    assert threshold == pytest.approx(0.5, abs=0.01)
