"""Minimum cuts: the same by every engine, and the smallest of all."""

import itertools

import numpy as np
import pytest
from shapes import SHAPES
from skimage import data

import toposeam as ts
from toposeam import _kernels
from toposeam.heat.network import Network
from toposeam.seam.exact import maximum_flow as flow
from toposeam.seam.exact import minimum_cut

ENGINES = ("scipy", "kernel")


@pytest.fixture
def engine(monkeypatch):
    """Has one engine cut; the test is skipped where there are no kernels."""
    library = _kernels.library

    def only(name):
        if name == "kernel" and library is None:
            pytest.skip("no kernels were built")
        monkeypatch.setattr(_kernels, "library", library if name == "kernel" else None)

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
    monkeypatch.setattr(_kernels, "library", None)
    monkeypatch.setattr(flow, "by_scipy", lambda *one: given.append(one) or np.zeros(n, bool))
    assert not minimum_cut(network, weight).any()
    ((nodes, tail, head, capacity),) = given
    assert nodes == n
    assert tail.tolist() == [*range(n)]
    assert head.tolist() == [n + 1] * n
    assert 2**28 < capacity.sum(dtype=np.int64) < 2**30
    assert abs(capacity[7] - dearest * capacity[0]) <= (dearest + 1) / 2
    assert set(capacity[8:n].tolist()) == {int(capacity[0])}


def test_no_memory_is_no_wrong_cut(monkeypatch):
    class Full:
        smallest_hot_side = staticmethod(lambda *_: -1)

    monkeypatch.setattr(_kernels, "library", Full)
    with pytest.raises(MemoryError):
        minimum_cut(Network(1, np.array([0, 0]), np.array([1, 2])), np.ones(2))
