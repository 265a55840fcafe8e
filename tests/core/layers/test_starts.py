"""From where rounds of expansions start."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.layers import rounds, starts


def four(seed=3):
    """Four noisy crops that overlap, from right to left."""
    whole = np.random.default_rng(seed).random((70, 110))
    places = ((60, 5), (40, 20), (15, 0), (0, 15))
    return [ts.Layer(whole[y : y + 50, x : x + 50], at=(x, y)) for x, y in places]


@pytest.mark.parametrize(("small", "expected"), [(1 << 19, set()), (0, {(2, 0, 3, 1), (1, 3, 0, 2)})])
def test_only_large_piles_are_joined_in_their_order(monkeypatch, small, expected):
    orders = set()
    usual = starts.joined

    def watched(choices, allowed, order, decide, steps):
        orders.add(tuple(order))
        usual(choices, allowed, order, decide, steps)

    monkeypatch.setattr(starts, "joined", watched)
    monkeypatch.setattr(rounds, "_SMALL", small)
    monkeypatch.setattr("toposeam.layers.compose.order_of", lambda *_: [2, 0, 3, 1])
    ts.stitch(four())
    assert orders == expected


def test_the_order_of_a_small_pile_does_not_change_what_it_costs():
    layers = four()
    costs = [
        ts.stitch([layers[k] for k in order]).cost for order in ((0, 1, 2, 3), (2, 0, 3, 1), (3, 2, 1, 0))
    ]
    assert costs == pytest.approx(costs[:1] * 3, rel=1e-3)
