"""Expansion moves, against all ways to turn."""

import itertools

import numpy as np
import pytest
from scipy import ndimage

from toposeam.seam.exact import ExpansionMove, interfaces_beside, minimum_cut

SHAPE = (3, 4)


def posed(seed):
    """A move towards label 3, and what any labels cost: a metric at interfaces, and costs of pixels."""
    rng = np.random.default_rng(seed)
    point = rng.random((4, 2))
    metric = np.hypot(*(point[:, None] - point).T)
    labels = rng.integers(0, 4, SHAPE)
    free = (rng.random(SHAPE) < 0.7) & (labels != 3)
    known = rng.random(SHAPE) < 0.9
    free &= known
    shows, piece = labels.ravel(), ndimage.label(free)[0].ravel()
    ends, own = interfaces_beside(free, known), rng.random((2, free.sum()))
    weight = rng.random(len(ends[0]))

    def paid(i, j, chosen):
        return metric[i, j] * weight[chosen]

    turned = np.where(piece > 0, 3, shows)
    move = ExpansionMove(piece, SHAPE[1], ends, shows, turned, paid, (own[0], own[1]))
    nodes = np.flatnonzero(piece)

    def cost(pixels):
        now = shows.copy()
        now[pixels] = 3
        return (
            paid(now[ends[0]], now[ends[1]], slice(None)).sum() + np.where(now[nodes] == 3, *own[::-1]).sum()
        )

    return move, nodes, cost


@pytest.mark.parametrize("seed", range(20))
def test_no_other_way_to_turn_costs_less(seed):
    move, nodes, cost = posed(seed)
    ways = itertools.product((False, True), repeat=len(nodes))
    least = min(cost(nodes[list(way)]) for way in ways)
    turned = move.turned(minimum_cut)
    assert cost(turned) == pytest.approx(least, rel=1e-6)
    gaining, gain = move.gaining(turned)
    assert set(gaining.tolist()) <= set(turned.tolist())
    assert gain == pytest.approx(cost([]) - cost(gaining))
    assert cost(gaining) == pytest.approx(least, rel=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_turning_what_only_costs_more_gains_nothing(seed):
    move, nodes, cost = posed(seed)
    worst = max(([node] for node in nodes), key=cost)
    assert cost(worst) > cost([])
    gaining, gain = move.gaining(np.array(worst))
    assert len(gaining) == 0
    assert gain == 0


def test_interfaces_join_known_pixels_beside_open_ones():
    open_, known = np.zeros((2, 3), bool), np.ones((2, 3), bool)
    open_[0, 1], known[1, 1] = True, False
    p, q = interfaces_beside(open_, known)
    assert (p.tolist(), q.tolist()) == ([0, 1], [1, 2])
