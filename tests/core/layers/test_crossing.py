"""Pieces that one seam crosses, against the maximum flow."""

import numpy as np
import pytest

from toposeam.heat.network import Network
from toposeam.layers.crossing import FIRST, NEITHER, SECOND, Beyond, crossed
from toposeam.seam.flow import minimum_cut

SHAPE = (9, 14)


def posed(rng, around):
    """A rectangle of pixels to divide, what lies beyond its sides, and random costs."""
    width = SHAPE[1]
    piece = np.zeros(SHAPE, np.int32)
    piece[1:-1, 1:-1] = 1
    at = np.arange(piece.size).reshape(SHAPE)
    sides = {
        "left": (at[1:-1, 1], -1),
        "right": (at[1:-1, -2], 1),
        "top": (at[1, 1:-1], -width),
        "bottom": (at[-2, 1:-1], width),
    }
    found = []
    for name, kind in around.items():
        pixels, step = sides[name]
        costs = rng.random((2, len(pixels)))
        if kind != NEITHER:
            costs[kind] = 0
        found.append((pixels, np.full(len(pixels), step), np.full(len(pixels), kind, np.int8), *costs))
    pixels, steps, kinds, first, second = (np.concatenate(part) for part in zip(*found, strict=True))
    inside = piece.ravel() > 0
    pairs = [(at[:, :-1].ravel(), at[:, 1:].ravel()), (at[:-1].ravel(), at[1:].ravel())]
    one, other = (np.concatenate(part) for part in zip(*pairs, strict=True))
    both = inside[one] & inside[other]
    one, other = one[both], other[both]
    link = rng.random(len(one)) ** 3 + 1e-3
    return piece, (one, other), link, Beyond(pixels, steps, kinds, (first, second))


def cost_of(labels, inner, link, border):
    own = labels[border.pixel]
    beside = np.where(own, border.costs[1], border.costs[0]).sum()
    return link[labels[inner[0]] != labels[inner[1]]].sum() + beside


def least(piece, inner, link, border):
    """What the best division costs, by maximum flow."""
    nodes = np.flatnonzero(piece)
    number = np.full(piece.size, -1)
    number[nodes] = np.arange(len(nodes))
    n = len(nodes)
    own = number[border.pixel]
    tail = np.concatenate([number[inner[0]], own, own])
    head = np.concatenate([number[inner[1]], np.full(len(own), n + 1), np.full(len(own), n)])
    weight = np.concatenate([link, *border.costs])
    known = weight > 0
    hot = np.zeros(piece.size, bool)
    hot[nodes] = minimum_cut(Network(n, tail[known], head[known]), weight[known])
    return cost_of(hot, inner, link, border)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize(
    "around",
    [
        {"left": FIRST, "right": SECOND},  # nothing at both ends
        {"left": FIRST, "bottom": FIRST, "right": SECOND},  # one of them a corner
        {"top": SECOND, "bottom": FIRST, "left": FIRST, "right": SECOND},  # both
    ],
)
def test_a_seam_between_ends_with_nothing_beyond_is_the_best(seed, around):
    piece, *rest = posed(np.random.default_rng(seed), around)
    labels, known = crossed(piece, *rest, np.zeros(piece.size, bool))
    assert (known == (piece.ravel() > 0)).all()
    assert cost_of(labels, *rest) == pytest.approx(least(piece, *rest), rel=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_a_seam_that_ends_beside_a_third_layer_arrives_where_that_costs_least(seed):
    piece, inner, link, border = posed(
        np.random.default_rng(seed), {"left": FIRST, "right": SECOND, "top": NEITHER}
    )
    labels, known = crossed(piece, inner, link, border, np.zeros(piece.size, bool))
    assert known.any()
    # No other place of one arrival is cheaper; more arrivals may be.
    found = cost_of(labels, inner, link, border)
    assert found >= least(piece, inner, link, border) * (1 - 1e-9)
    top = np.flatnonzero(piece[1]) + SHAPE[1]
    for column in range(len(top) + 1):
        straight = np.zeros(SHAPE, bool)
        straight[1:-1, 1 + column : -1] = True
        assert found <= cost_of(straight.ravel(), inner, link, border) + 1e-9


@pytest.mark.parametrize("around", [{"left": FIRST, "right": FIRST, "top": SECOND, "bottom": SECOND}])
def test_what_several_seams_cross_is_left(around):
    piece, *rest = posed(np.random.default_rng(0), around)
    _, known = crossed(piece, *rest, np.zeros(piece.size, bool))
    assert not known.any()


def test_pieces_that_touch_at_a_corner_are_divided_each():
    rng = np.random.default_rng(3)
    piece, inner, link, border = posed(rng, {"left": FIRST, "right": SECOND})
    alone, _ = crossed(piece, inner, link, border, np.zeros(piece.size, bool))
    height, width = SHAPE
    twice = np.zeros((2 * height - 2, 2 * width - 2), np.int32)
    twice[1 : height - 1, 1 : width - 1] = 1
    twice[height - 1 : -1, width - 1 : -1] = 2

    def moved(pixels, down, right):
        y, x = np.divmod(pixels, width)
        return (y + down) * twice.shape[1] + x + right

    offsets = (0, 0), (height - 2, width - 2)
    both = tuple(np.concatenate([moved(part, *by) for by in offsets]) for part in inner)
    step = np.where(np.abs(border.step) == 1, border.step, np.sign(border.step) * twice.shape[1])
    around = Beyond(
        np.concatenate([moved(border.pixel, *by) for by in offsets]),
        np.tile(step, 2),
        np.tile(border.kind, 2),
        [np.tile(part, 2) for part in border.costs],
    )
    labels, known = crossed(twice, both, np.tile(link, 2), around, np.zeros(twice.size, bool))
    assert (known == (twice.ravel() > 0)).all()
    pixels = np.flatnonzero(piece)
    for by in offsets:
        assert (labels[moved(pixels, *by)] == alone[pixels]).all()
