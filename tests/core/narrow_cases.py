"""Overlaps with narrow places, ragged ones, and what their best seams cost, found without the library."""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import maximum_flow

A, B = 0, 1


def row(rng, wide):
    """A strip that is as wide as a corridor, and nothing else."""
    shared = np.zeros((wide, int(rng.integers(10, 120))), bool)
    shared[:, 1:-1] = True
    return ends_of(shared)


def corridor(rng, wide):
    """Two blobs joined by a corridor, straight or with a bend."""
    shared = np.zeros((25, 56), bool)
    at = rng.integers(6, 15, 2)
    middle = int(rng.integers(20, 34))
    shared[2:-2, 1:14] = shared[2:-2, -14:-1] = True
    shared[at[0] : at[0] + wide, 10 : middle + wide] = True
    shared[at[1] : at[1] + wide, middle:46] = True
    shared[at.min() : at.max() + wide, middle : middle + wide] = True
    return ends_of(shared)


def fingers(rng, wide):
    """Each patch reaches into the other by fingers, which are all that they share."""
    a, b = np.zeros((2, 26, 54), bool)
    a[:, :12] = b[:, -12:] = True
    for top in range(int(rng.integers(1, 5)), 22, int(rng.integers(wide + 2, 13))):
        a[top : top + wide, : int(rng.integers(40, 51))] = True
        b[top : top + wide, int(rng.integers(4, 14)) :] = True
    return a, b


def ring(rng, wide):
    """``b`` covers a hole of ``a`` and a rim round it, with a blob at one place."""
    a, b = np.ones((34, 34), bool), np.zeros((34, 34), bool)
    a[10:24, 10:24] = False
    b[10 - wide : 24 + wide, 10 - wide : 24 + wide] = True
    top, left = rng.integers(2, 24, 2)
    b[top : top + 8, left : left + 8] = True
    return a, b


def comb(rng, wide):
    """A strip with teeth to either side."""
    shared = np.zeros((40, 40), bool)
    shared[:, 18 : 18 + wide] = True
    for top in range(2, 38, wide + int(rng.integers(2, 6))):
        shared[top : top + wide, 18 - int(rng.integers(0, 12)) : 18 + wide + int(rng.integers(0, 12))] = True
    filled = np.cumsum(shared, axis=1) == 0
    return shared | filled, ~filled


KINDS = {made.__name__: made for made in (row, corridor, fingers, ring, comb)}


def ends_of(shared):
    """Masks of an overlap that `a` continues to the left and `b` to the right."""
    a, b = shared.copy(), shared.copy()
    a[:, 0] = b[:, -1] = True
    return a, b


def narrow(index, kinds=tuple(KINDS)):
    """Two pictures, their masks and options of the cost: narrow places of every kind, 1 to 3 px wide."""
    rng = np.random.default_rng([5, index])
    masks = KINDS[kinds[index % len(kinds)]](rng, index // len(kinds) % 3 + 1)
    if rng.random() < 0.5:
        masks = tuple(mask.T for mask in masks)
    pictures = rng.random((2, *masks[0].shape, 3))
    if rng.random() < 0.5:
        pictures = ndimage.gaussian_filter(pictures, (0, 2, 2, 0))
    return *pictures, *masks, {"gradient": bool(rng.random() < 0.5)}


def ragged(index, axes=2):
    """Two pictures, or volumes, and masks of ragged blobs with specks, some of which touch."""
    rng = np.random.default_rng([6, index])
    shape = tuple(rng.integers(6, 30 if axes == 2 else 12, axes))
    masks = []
    for _ in range(2):
        rough = ndimage.gaussian_filter(rng.random(shape), rng.uniform(0.4, 3))
        masks.append((rough > np.quantile(rough, rng.uniform(0.1, 0.6))) | (rng.random(shape) < 0.02))
    return *rng.random((2, *shape)), *masks


def noisy(seed, noise, shape=(160, 40, 3)):
    """Two pictures of one slow slope, each with its own noise."""
    rng = np.random.default_rng(100 + seed)
    base = np.cumsum(np.cumsum(rng.normal(0, 1, shape[:2]), 0), 1)
    base = ((base - base.min()) / np.ptp(base) * 0.4 + 0.3)[..., np.newaxis]
    return base + rng.normal(0, noise, shape), base + rng.normal(0, noise, shape)


def at_border(labels):
    """How many steps from pixel to pixel of a row a seam crosses, and how many of those are outermost."""
    columns = np.nonzero(labels[:, 1:] != labels[:, :-1])[1]
    return len(columns), int(np.count_nonzero((columns == 0) | (columns == labels.shape[1] - 2)))


def elements(side, costs):
    """Nodes of every interface, and what it costs: numbered as pixels are, after `a`'s ground and `b`'s."""
    number = np.arange(side.size).reshape(side.shape) + 2
    number[side == A], number[side == B] = 0, 1
    pairs = []
    for axis, cost in costs:
        low = np.take(number, range(side.shape[axis] - 1), axis)
        high = np.take(number, range(1, side.shape[axis]), axis)
        known = (cost > 0) & (low != high)
        pairs.append((low[known], high[known], cost[known].astype(float)))
    return (np.concatenate(part) for part in zip(*pairs, strict=True))


def costs_of(problem):
    """The costs of a problem along each axis of it, of seams and of surfaces."""
    if hasattr(problem, "costs"):
        return list(enumerate(problem.costs))
    return [(1, problem.right), (0, problem.down)]


def least_by_flow(problem):
    """What the best labelling costs: a maximum flow of SciPy through every interface there is."""
    one, other, cost = elements(problem.overlap.side, costs_of(problem))
    scale = (2**31 - 2) / 4 / cost.sum()
    whole = np.rint(cost * scale).astype(np.int32)
    size = problem.overlap.side.size + 2
    both = coo_array(
        (np.r_[whole, whole], (np.r_[one, other], np.r_[other, one])), shape=(size, size)
    ).tocsr()
    return maximum_flow(both, 0, 1).flow_value / scale


def least_by_graph(problem):
    """The same by PyMaxflow, where costs need not be whole numbers."""
    import maxflow

    one, other, cost = elements(problem.overlap.side, costs_of(problem))
    graph = maxflow.GraphFloat()
    graph.add_nodes(problem.overlap.side.size + 2)
    graph.add_edges(one, other, cost, cost)
    graph.add_tedge(0, 2 * cost.sum() + 1, 0)
    graph.add_tedge(1, 0, 2 * cost.sum() + 1)
    return graph.maxflow()
