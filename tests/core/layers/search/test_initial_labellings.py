"""The starts of expansions, and their ends."""

import itertools

import numpy as np
import pytest

import toposeam as ts
from toposeam.layers.search import SearchOptions
from toposeam.layers.search import initial_labellings as starts


def four(seed=3):
    """Four noisy crops that overlap, from right to left."""
    whole = np.random.default_rng(seed).random((70, 110))
    places = ((60, 5), (40, 20), (15, 0), (0, 15))
    return [ts.Layer(whole[y : y + 50, x : x + 50], at=(x, y)) for x, y in places]


@pytest.mark.parametrize(("most", "expected"), [(6, {0, 1, 2, 3}), (2, {2, 3}), (1, {2})])
def test_each_start_has_another_layer_at_the_bottom(monkeypatch, most, expected):
    bottoms, usual = set(), starts.laid_on_top

    def watched(allowed, order):
        bottoms.add(order[0])
        return usual(allowed, order)

    monkeypatch.setattr(starts, "laid_on_top", watched)
    ts.stitch(four(), effort=SearchOptions(starts=most))
    assert bottoms == expected


def test_the_order_of_a_small_pile_does_not_change_its_cost():
    layers = four()
    costs = [
        ts.stitch([layers[k] for k in order]).cost
        for order in itertools.islice(itertools.permutations(range(4)), 0, 24, 9)
    ]
    assert costs == pytest.approx(costs[:1] * 3, rel=1e-3)
