"""The best seam: by shortest path where it is one, else by maximum flow, against PyMaxflow's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage
from shapes import SHAPES

import toposeam as ts
from toposeam.seam.exact import graph_cut
from toposeam.seam.exact import optimum as exact


def blob(rng, shape):
    smooth = ndimage.gaussian_filter(rng.random(shape), rng.uniform(0.3, 5))
    return smooth > np.quantile(smooth, rng.uniform(0.05, 0.7))


@pytest.mark.medium
def test_the_optimum_costs_as_much_as_a_cut_by_flow(monkeypatch):
    by_path, by_flow = [], []
    path, flow = exact.shortest_path, exact.cut_by_flow
    monkeypatch.setattr(
        exact,
        "shortest_path",
        lambda *given, whole: by_path.append(path(*given) is not None) or path(*given),
    )
    monkeypatch.setattr(exact, "cut_by_flow", lambda *given: by_flow.append(1) or flow(*given))
    compared = 0
    for index in range(250):
        rng = np.random.default_rng([1, index])
        shape = tuple(rng.integers(3, 40, 2))
        a, b = rng.random((2, *shape))
        options = {"cost": ts.seam.MatchCost(length=10 ** rng.uniform(-4, -1), law=ts.seam.LAWS[index % 3])}
        if index % 4 == 1:
            options["avoid"] = rng.random(shape) < 0.05
        masks = (blob(rng, shape), blob(rng, shape)) if index % 3 else ()
        try:
            best = ts.find_seam(a, b, *masks, method="shortest-path", **options)
        except ts.OverlapError:
            continue
        cut = ts.find_seam(a, b, *masks, method="graph-cut", **options)
        assert best.cost == pytest.approx(cut.cost, rel=1e-5), index
        compared += 1
    assert compared > 200
    assert sum(by_path) > 1000
    assert len(by_flow) > 30  # not every piece is cut by a path


@pytest.mark.parametrize("side", ["right", "left", "bottom", "top"])
def test_a_strip_needs_no_flow(side, crops, monkeypatch):
    monkeypatch.setattr(exact, "cut_by_flow", None)
    a, b = crops(np.random.default_rng(2), 60, 40)
    best = ts.find_seam(a, b, side=side, method="shortest-path")
    assert best.cost == pytest.approx(ts.find_seam(a, b, side=side, method="graph-cut").cost, rel=1e-6)


def test_none_dearer_than_what_is_known_is_looked_for(crops):
    seam = ts.find_seam(*crops(np.random.default_rng(3), 60, 20), method="shortest-path")
    found = exact.exact_labels(seam.problem, seam.cost)
    assert seam.problem.cost(found) == seam.cost
    problem = seam.problem
    everything = np.s_[0 : problem.overlap.side.shape[0], 0 : problem.overlap.side.shape[1]]
    free = problem.overlap.side == 2
    assert exact.shortest_path(problem, everything, free, 0.99 * seam.cost) is None
    assert exact.shortest_path(problem, everything, free, 1.01 * seam.cost) is not None


def test_a_zone_keeps_the_path_beside_its_pixels(crops):
    problem = ts.find_seam(*crops(np.random.default_rng(4), 40, 20), method="dp").problem
    free = problem.overlap.side == 2
    everything = np.s_[0 : free.shape[0], 0 : free.shape[1]]
    zone = np.zeros(free.shape, bool)
    zone[:, 8:12] = True
    labels = problem.complete(exact.shortest_path(problem, everything, free, zone=zone))
    across, along = labels[:, 1:] != labels[:, :-1], labels[1:] != labels[:-1]
    assert across.any(axis=1)[1:-1].all()
    assert not across[:, :7].any()
    assert not across[:, 12:-1].any()
    assert not along[:, :8].any()
    assert not along[1:-1, 12:].any()


# --- what is proven


@pytest.mark.medium
@pytest.mark.parametrize("shape", [None, *SHAPES])
def test_no_seam_costs_less_than_what_is_proven(shape, crops):
    masks = SHAPES[shape]() if shape else (None, None)
    size = masks[0].shape if shape else (60, 20)
    a, b = crops(np.random.default_rng(5), *size)
    best = ts.find_seam(a, b, *masks, method="graph-cut", gradient=True)
    assert best.bound == pytest.approx(best.cost)
    heat = ts.find_seam(a, b, *masks, method="heat", gradient=True)
    assert (1 - 1e-3) * best.cost <= heat.bound <= best.cost * (1 + 1e-6)
    for method, options in (("heat", {"tolerance": 0.5}), ("thesis", {})):
        proven = ts.find_seam(a, b, *masks, method=method, gradient=True, prove=True, **options)
        assert proven.bound == pytest.approx(best.cost, rel=1e-5)
        assert proven.cost == ts.find_seam(a, b, *masks, method=method, gradient=True, **options).cost
    assert ts.find_seam(a, b, *masks, method="thesis").bound == 0


def test_a_proof_needs_no_pymaxflow(crops, monkeypatch):
    masks = SHAPES["ring"]()
    pair = crops(np.random.default_rng(6), *masks[0].shape)
    with_it = ts.find_seam(*pair, *masks, prove=True)

    def missing(*_):
        raise ts.MissingPackageError("not here")

    monkeypatch.setattr(graph_cut, "least_cut", missing)
    assert ts.find_seam(*pair, *masks, prove=True).bound == pytest.approx(with_it.bound, rel=1e-5)


def test_what_is_proven_never_lends_capacity_to_next_to_nothing():
    # Costs of fifteen orders of magnitude: heat counts the least ones as a ten-millionth of a seam.
    rng = np.random.default_rng(7)
    a = rng.random((30, 12))
    b = a.copy()
    b[::3] += 0.3
    cost = ts.seam.MatchCost(law="colour", length=1e-14)
    heat = ts.find_seam(a, b, method="heat", cost=cost)
    best = ts.find_seam(a, b, cost=cost, method="shortest-path")
    assert heat.bound <= best.cost * (1 + 1e-9)
