"""Minimum cuts: the same by every engine, and the smallest of all."""

import itertools
import subprocess
import sys
from types import ModuleType

import numpy as np
import pytest
from shapes import SHAPES
from skimage import data

import toposeam as ts
from toposeam.heat.network import Network
from toposeam.seam.exact import maximum_flow as flow
from toposeam.seam.exact import minimum_cut

ENGINES = {"scipy": lambda: flow.by_scipy, "or-tools": flow.or_tools}
MODULE = "ortools.graph.python.max_flow"


@pytest.fixture
def engine(monkeypatch):
    """Has one engine cut; the test is skipped where it is not installed."""

    def only(name):
        if name == "or-tools":
            pytest.importorskip(MODULE, reason="OR-tools is not installed")
        chosen = ENGINES[name]()
        assert chosen is not None
        monkeypatch.setattr(flow, "_engine_for", lambda _: chosen)

    return only


def grid(rng, shape, cost):
    """A grid of nodes between random terminals, with elements between any two and parallel ones, and a few
    nodes that no terminal reaches.
    """
    n = shape[0] * shape[1]
    at = np.arange(n).reshape(shape)
    pairs = [(at[:, :-1], at[:, 1:]), (at[:-1], at[1:]), rng.integers(n, size=(2, n // 8))]
    hot, cold = (rng.choice(n, rng.integers(n // 3), replace=False) for _ in range(2))
    twice = hot[: len(hot) // 2]
    pairs += [
        (hot, np.full(len(hot), n + 1)),
        (np.full(len(cold), n), cold),
        (twice, np.full(len(twice), n + 1)),
    ]
    tail, head = (np.concatenate([part.ravel() for part in parts]) for parts in zip(*pairs, strict=True))
    lonely = rng.random(n + 2) < 0.02
    joined = (tail != head) & (lonely[tail] == lonely[head])
    tail, head = tail[joined], head[joined]
    return Network(n, tail, head), cost(rng, len(tail))


def forbidden(rng, count):
    """Half of them dearer than all others together."""
    weight = rng.random(count)
    return np.where(rng.random(count) < 0.5, weight, weight.sum())


COSTS = {
    "random": lambda rng, count: rng.random(count),
    "ties": lambda rng, count: rng.integers(1, 4, count).astype(float),
    "all alike": lambda _, count: np.ones(count),
    "zeros": lambda rng, count: rng.integers(0, 2, count) * rng.random(count),
    "mostly zeros": lambda rng, count: (rng.random(count) < 0.2) * rng.random(count),
    "six orders": lambda rng, count: 10 ** rng.uniform(-6, 0, count),
    "forbidden": forbidden,
}


@pytest.mark.parametrize("cost", COSTS)
def test_both_engines_make_the_same_cut(cost, engine):
    cuts = {}
    for name in ENGINES:
        engine(name)
        rng = np.random.default_rng(1)
        shapes = rng.integers(1, 30, (60, 2))
        found = [flow.minimum_cut(*grid(rng, shape, COSTS[cost])) for shape in shapes if shape.prod() > 8]
        cuts[name] = np.concatenate(found)
    assert np.array_equal(*cuts.values())
    assert 0.05 < cuts["scipy"].mean() < 0.95


@pytest.mark.parametrize("terminal", [0, 1])
def test_engines_cut_networks_joined_to_one_terminal(terminal, engine):
    for name in ENGINES:
        engine(name)
        network = Network(3, np.array([0, 1]), np.array([1, 3 + terminal]))
        hot = flow.minimum_cut(network, np.ones(2))
        assert hot.tolist() == [bool(terminal)] * 2 + [False]


@pytest.mark.parametrize("name", ENGINES)
def test_of_all_minimum_cuts_it_is_the_smallest(name, engine):
    engine(name)
    n, several = 7, 0
    for seed in range(40):
        rng = np.random.default_rng([2, seed])
        tail, head = rng.integers(0, n + 2, (2, 20))
        network = Network(n, tail[tail != head], head[tail != head])
        weight = np.ones(len(network.tail))
        labels = np.array([(*label, 0, 1) for label in itertools.product((0, 1), repeat=n)], bool)
        cost = ((labels[:, network.tail] != labels[:, network.head]) * weight).sum(axis=1)
        least = labels[cost == cost.min(), :n]
        several += len(least) > 1
        smallest = least.all(axis=0)
        assert (least == smallest).all(axis=1).any()
        assert np.array_equal(flow.minimum_cut(network, weight), smallest)
    assert several > 10


@pytest.mark.medium
def test_overlaps_are_divided_by_the_same_seams(engine, crops, monkeypatch):
    photograph = data.coffee()[100:, 150:]
    places = (0, 0), (30, 4), (6, 28), (33, 30)
    rng = np.random.default_rng(0)
    layers = [
        ts.Layer((photograph[y : y + 50, x : x + 60] * rng.uniform(0.8, 1)).astype(np.uint8), at=(x, y))
        for x, y in places
    ]
    asked, cut = [], flow.minimum_cut
    monkeypatch.setattr(flow, "minimum_cut", lambda *given: asked.append(given) or cut(*given))
    pair = crops(np.random.default_rng(6), *SHAPES["ring"]()[0].shape)
    avoid = np.zeros(pair[0].shape[:2], bool)
    avoid[::7, ::5] = True
    joined = {}
    for name in ENGINES:
        engine(name)
        ring = ts.find_seam(*pair, *SHAPES["ring"](), method="shortest-path", avoid=avoid)
        joined[name] = ring.labels, ts.stitch(layers).image
    assert len(asked) > 20
    for one, other in zip(*joined.values(), strict=True):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("dearest", [1.0, 1e3, 1e9])
def test_capacities_are_fine_and_fit_in_32_bits(dearest, monkeypatch):
    """However they are added up, in both directions at once."""
    n = 2000
    weight = np.ones(n)
    weight[7] = dearest
    network = Network(n, np.arange(n), np.full(n, n + 1))
    given = []
    monkeypatch.setattr(
        "toposeam.seam.exact.maximum_flow._engine_for",
        lambda _: lambda *one: given.append(one) or np.array([n + 1], np.int32),
    )
    assert not minimum_cut(network, weight).any()
    ((nodes, tail, head, capacity),) = given
    assert nodes == n
    assert tail.tolist() == [*range(n), *[n + 1] * n]
    assert head.tolist() == [*[n + 1] * n, *range(n)]
    assert 2**29 < capacity.sum(dtype=np.int64) <= 2**31 - 2
    np.testing.assert_array_equal(capacity[:n], capacity[n:])
    assert abs(capacity[7] - dearest * capacity[0]) <= (dearest + 1) / 2
    assert set(capacity[8:n].tolist()) == {int(capacity[0])}


# --- an OR-tools that is not there, or not as we know it


class Strange(ModuleType):
    """One whose flows are of another kind."""

    class SimpleMaxFlow:
        def add_arcs_with_capacity(self, *_):
            pass

        def solve(self, *_):
            pass

        def get_source_side_min_cut(self):
            return [2]


def older(name):
    module = ModuleType(name)
    module.SimpleMaxFlow = object
    return module


@pytest.mark.parametrize("module", [lambda _: None, ModuleType, older, Strange])
def test_without_an_or_tools_that_works_scipy_cuts(module, monkeypatch):
    network, weight = grid(np.random.default_rng(3), (9, 9), COSTS["random"])
    monkeypatch.setattr(flow, "LOADED", 0)
    monkeypatch.setitem(sys.modules, MODULE, module(MODULE))
    flow.or_tools.cache_clear()
    try:
        assert flow.or_tools() is None
        cut = flow.minimum_cut(network, weight)
    finally:
        flow.or_tools.cache_clear()
    monkeypatch.setattr(flow, "_engine_for", lambda _: flow.by_scipy)
    assert np.array_equal(cut, flow.minimum_cut(network, weight))


def test_the_engine_is_loaded_when_worthwhile_without_pandas():
    pytest.importorskip(MODULE, reason="OR-tools is not installed")
    script = (
        "import sys, numpy as np, toposeam as ts\n"
        "from toposeam.seam.exact import maximum_flow as flow\n"
        "a, b = np.random.default_rng(0).random((2, 20, 20))\n"
        "inside, hole = np.zeros((2, 20, 20), bool)\n"
        "inside[4:16, 4:16] = hole[9:11, 9:11] = True\n"
        "ts.find_seam(a, b, ~hole, inside, method='shortest-path')\n"
        "assert 'ortools' not in sys.modules\n"
        "flow.LOADED = flow._Work.nodes\n"
        "assert flow.LOADED > 0\n"
        "ts.find_seam(a, b, ~hole, inside, method='shortest-path')\n"
        "assert 'ortools' in sys.modules\n"
        "assert 'pandas' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-W", "error", "-c", script], check=True)
