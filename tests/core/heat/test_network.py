"""Conductor networks against closed forms and dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from toposeam.errors import SolverError
from toposeam.heat import elimination as module
from toposeam.heat.network import Network


def network(n, *elements):
    tail, head = np.array(elements, np.int32).T
    return Network(n, tail, head)


def heat(net, conductance):
    """Total flux into the cold terminal."""
    flux = conductance * net.difference(net.solve(conductance))
    return flux[(net.tail == net.n) | (net.head == net.n)].sum()


def grid(rows, columns, rng):
    """A grid of nodes, the first row on the cold terminal and the last one on the hot terminal."""
    node = np.arange(rows * columns).reshape(rows, columns)
    cold, hot = rows * columns, rows * columns + 1
    across = np.stack([node[:, :-1].ravel(), node[:, 1:].ravel()], 1)
    along = np.stack([node[:-1].ravel(), node[1:].ravel()], 1)
    ends = np.stack([np.r_[node[0], node[-1]], np.repeat([cold, hot], columns)], 1)
    elements = np.concatenate([across, along, ends])
    return network(rows * columns, *elements), 10 ** rng.uniform(-3, 0, len(elements))


def dense_solution(net, conductance):
    matrix = np.zeros((net.n + 2, net.n + 2))
    for i, j, k in zip(net.tail, net.head, conductance, strict=True):
        matrix[[i, j], [i, j]] += k
        matrix[[i, j], [j, i]] -= k
    return np.r_[np.linalg.solve(matrix[: net.n, : net.n], -matrix[: net.n, net.n + 1]), 0.0, 1.0]


def test_conductors_in_series_add_their_resistances():
    k = np.array([1.0, 2.0, 4.0])
    net = network(2, (2, 0), (0, 1), (1, 3))  # cold - 0 - 1 - hot
    assert heat(net, k) == pytest.approx(1 / (1 / k).sum())
    assert net.solve(k) == pytest.approx([4 / 7, 6 / 7, 0, 1])


def test_conductors_in_parallel_add_their_conductances():
    # Two branches of two elements each; in each branch the resistances add up.
    net = network(2, (2, 0), (0, 3), (2, 1), (1, 3))
    assert heat(net, np.array([1.0, 1.0, 3.0, 3.0])) == pytest.approx(0.5 + 1.5)


def test_a_balanced_bridge_carries_nothing():
    net = network(2, (2, 0), (2, 1), (0, 1), (0, 3), (1, 3))
    theta = net.solve(np.array([1.0, 2.0, 5.0, 3.0, 6.0]))
    assert net.difference(theta)[2] == pytest.approx(0, abs=1e-15)


@pytest.mark.parametrize(
    ("dense", "band", "kind"), [(10**6, 120, module._Dense), (0, 120, module._Banded), (0, 1, module._Sparse)]
)
def test_dense_banded_and_sparse_factorisations_agree(monkeypatch, dense, band, kind):
    monkeypatch.setattr(module, "DENSE_NODES", dense)
    monkeypatch.setattr(module, "WIDEST_BAND", band)
    net, k = grid(9, 7, np.random.default_rng(0))
    assert type(net._system) is kind
    for scale in (1.0, 3.0):  # the second time the sparse one has an order
        assert net.solve(scale * k) == pytest.approx(dense_solution(net, k), abs=1e-12)


@pytest.mark.parametrize("merged", [0.0, 0.2])
def test_eliminating_nodes_that_are_apart_first_changes_nothing(monkeypatch, merged):
    monkeypatch.setattr(module, "CONDENSED_NODES", 1)
    monkeypatch.setattr(module, "DENSE_NODES", 5)
    rng = np.random.default_rng(5)
    net, k = grid(12, 9, rng)
    row, column = np.divmod(np.arange(net.n), 9)
    net = Network(net.n, net.tail, net.head, (row + column) % 2 == 0)
    if merged:
        joined = (rng.random(len(k)) < merged / 4) & (net.head < net.n)
        net, element_map = net.quotient(net.components(joined))
        k = np.bincount(element_map[element_map >= 0], k[element_map >= 0], len(net.tail))
        assert net.apart is not None
        inner = net.head < net.n
        assert not (net.apart[net.tail[inner]] & net.apart[net.head[inner]]).any()
    assert type(net._system) is module._Condensed
    assert net.solve(k) == pytest.approx(dense_solution(net, k), abs=1e-12)


def test_a_contrast_of_nine_orders_of_magnitude_is_survived():
    net, _ = grid(30, 12, np.random.default_rng(1))
    k = np.full(len(net.tail), 1e-9)
    path = np.flatnonzero((net.tail % 12 == 4) & (net.head % 12 == 4) & (net.head < net.n))
    ends = np.flatnonzero((net.head >= net.n) & np.isin(net.tail, [4, 29 * 12 + 4]))
    k[np.r_[path, ends]] = 1.0
    # 31 conductors in series; the void around them adds about 1e-9 of a few dozen.
    assert heat(net, k) == pytest.approx(1 / 31, rel=1e-6)


def test_contraction_keeps_the_flux():
    rng = np.random.default_rng(2)
    net, k = grid(8, 8, rng)
    merged = (rng.random(len(k)) < 0.2) & (net.head < net.n)
    k[merged] = 1e7  # as good as one node, up to about 1e-6
    node_map = net.components(merged)
    smaller, element_map = net.quotient(node_map)
    kept = element_map >= 0
    k_smaller = np.bincount(element_map[kept], k[kept], len(smaller.tail))
    theta, theta_smaller = net.solve(k), smaller.solve(k_smaller)
    assert theta_smaller[node_map] == pytest.approx(theta, abs=1e-5)
    assert heat(smaller, k_smaller) == pytest.approx(heat(net, k), rel=1e-5)
    assert (node_map[net.n :] == [smaller.n, smaller.n + 1]).all()


def test_the_quotient_merges_parallel_elements_and_drops_loops():
    # Nodes 0 and 1 become one: elements to node 2 are parallel, the one between them is gone, the one between
    # the terminals too.
    net = network(3, (3, 0), (0, 1), (0, 2), (1, 2), (2, 4), (3, 4))
    smaller, element_map = net.quotient(np.array([0, 0, 1, 2, 3]))
    assert smaller.n == 2
    assert element_map[1] == element_map[5] == -1
    assert element_map[2] == element_map[3]
    assert len(smaller.tail) == len(set(element_map) - {-1}) == 3


def test_merging_that_joins_the_terminals_is_refused():
    net = network(1, (1, 0), (0, 2))
    with pytest.raises(SolverError, match="join the two terminals"):
        net.components(np.array([True, True]))


@pytest.mark.parametrize(("dense", "band"), [(10**6, 120), (0, 120), (0, 0)])
def test_a_node_without_connection_is_an_error_not_a_number(monkeypatch, dense, band):
    monkeypatch.setattr(module, "DENSE_NODES", dense)
    monkeypatch.setattr(module, "WIDEST_BAND", band)
    with pytest.raises(SolverError, match="cannot be solved"):
        network(3, (3, 0), (0, 4), (3, 1), (1, 4)).solve(np.ones(4))  # node 2 has no element
    with pytest.raises(SolverError, match="cannot be solved"):
        network(3, (3, 0), (0, 4), (1, 2)).solve(np.ones(3))  # nodes 1 and 2 only have each other


def test_a_network_without_free_nodes_has_only_its_terminals():
    net = Network(0, np.zeros(0, np.int32), np.zeros(0, np.int32))
    assert net.solve(np.zeros(0)).tolist() == [0.0, 1.0]


@pytest.mark.parametrize("without", [False, True])
def test_irregular_networks_are_solved_with_or_without_qdldl(without, monkeypatch):
    monkeypatch.setattr(module, "SPARSE_NODES", 200)
    if without:
        monkeypatch.setattr(module, "qdldl", None)
    rng = np.random.default_rng(8)
    points = rng.random((1000, 2))
    triangles = Delaunay(points).simplices
    edges = np.unique(np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    net = network(len(points) - 2, *edges)
    assert isinstance(net._system, module._Sparse)
    for _ in range(2):  # the order of elimination is found by the first solution
        conductance = 10 ** rng.uniform(-3, 0, len(edges))
        np.testing.assert_allclose(net.solve(conductance), dense_solution(net, conductance), rtol=1e-8)
