"""From coarse to fine: which pixels of a large overlap the seam can still choose between.

A large network is shrunk by merging every node with the neighbour it is most expensive to divide from, again and again, as multilevel
graph partitioning does (Karypis and Kumar 1998, doi:10.1137/S1064827595287997). A seam hardly ever wants those interfaces, and the costs
of all the others stay exact, so the coarse problem is the fine one with bad choices removed. A few convex steps on it show where heat
flows at all. Back on the finer network only the nodes beside such flow stay free; the rest is merged with the side it lies on, or into
one node per region between two flows. Every level starts from uniform conductances: those of the coarse solution would favour its own
path.
"""

from __future__ import annotations

import numpy as np

from toposeam.heat.network import Floats, Ints, Network
from toposeam.images import Mask
from toposeam.seam.relaxation import contract, convex_step, typical_flux

#: Overlaps with up to this many free pixels are solved whole.
WHOLE_NODES = 30_000

#: Coarse networks up to this many free nodes are not made coarser still.
COARSEST_NODES = 12_000

#: Convex steps on each coarse network: at least so many, at most so many, and until the typical flux has grown to this.
STEPS = (10, 30)
GATHERED = 0.3

#: Steps between contractions, and the share of the typical flux below which they close interfaces.
BETWEEN = 5
CLOSED_SHARE = 0.003

#: Interfaces with at least this share of the typical flux stay open on the next finer level.
OPEN_SHARE = 0.02

_UNEVENNESS = 1e-3
_GOLDEN = (5**0.5 - 1) / 2


def restrict(network: Network, weight: Floats, size: Floats | None = None) -> tuple[Network, Floats, Floats, Ints]:
    """The network without the nodes that coarser ones show to be decided.

    Parameters
    ----------
    network : Network
    weight : (E,) float64 array
        Cost of dividing the two nodes of each element.
    size : (n + 2,) float64 array, optional
        Pixels per node; 1 by default.

    Returns
    -------
    network : Network
    weight, multiplicity : (E',) float64 arrays
        Summed cost and number of the elements that each new element stands for.
    node_map : (n + 2,) int array
        The new number of every node.
    """
    n = network.n
    same = network, weight, np.ones(len(weight)), np.arange(n + 2, dtype=np.int32)
    if n <= (WHOLE_NODES if size is None else COARSEST_NODES):
        return same
    if size is None:
        size = np.ones(n + 2)
    parent = _merge_most_expensive(network, weight, size)
    coarse, element_map = network.quotient(parent)
    if coarse.n > 0.7 * n or coarse.n == 0:
        return same
    coarse_weight = _sum(weight, element_map, len(coarse.tail))
    small, small_weight, _, small_map = restrict(coarse, coarse_weight, np.bincount(parent, size, coarse.n + 2).astype(np.float64))
    strength = np.ones(len(small_weight))
    for step in range(1, STEPS[1] + 1):
        potential = small.solve(small_weight / strength)
        flux = small.difference(potential)
        if step >= STEPS[0] and typical_flux(small_weight, flux) >= GATHERED:
            break
        if step % BETWEEN == 0 and step < STEPS[1]:
            contracted = contract(small, small_weight, flux, strength, np.ones(len(flux)), CLOSED_SHARE)
            if contracted is not None and contracted[0].n:
                small, small_weight, flux, strength, _, onwards, _ = contracted
                small_map = onwards[small_map]
        strength = convex_step(strength, flux)
    threshold = OPEN_SHARE * typical_flux(small_weight, flux)
    level = potential[small_map]
    open_elements = coarse.difference(level) > threshold
    active = np.zeros(coarse.n + 2, bool)
    active[coarse.tail[open_elements]] = active[coarse.head[open_elements]] = True
    active[coarse.n :] = False
    node_map = _passive_groups(network, active[parent], level[parent], threshold)
    smaller, element_map = network.quotient(node_map)
    count = len(smaller.tail)
    return smaller, _sum(weight, element_map, count), _sum(np.ones(len(weight)), element_map, count), node_map


def _merge_most_expensive(network: Network, weight: Floats, size: Floats) -> Ints:
    """Group every node with the neighbour it costs most to divide from, relative to the nodes' sizes; (n + 2,) group numbers."""
    # Equal scores, as in flat places, must not merge all of these into one node: a golden-ratio sequence tells them apart.
    uneven = 1.0 + _UNEVENNESS * ((np.arange(len(weight)) * _GOLDEN) % 1.0)
    score = weight * uneven / np.sqrt(size[network.tail] * size[network.head])
    score[np.maximum(network.tail, network.head) >= network.n] = 0.0
    best = np.full(network.n + 2, np.finfo(float).tiny)
    np.maximum.at(best, network.tail, score)
    np.maximum.at(best, network.head, score)
    return network.components((score == best[network.tail]) | (score == best[network.head]))


def _sum(values: Floats, element_map: Ints, count: int) -> Floats:
    """Values of elements added up over the elements of a quotient."""
    kept = element_map >= 0
    return np.bincount(element_map[kept], values[kept], count).astype(np.float64, copy=False)


def _passive_groups(network: Network, active: Mask, level: Floats, threshold: float) -> Ints:
    """Active nodes each alone; passive ones with the terminal they are level with, or with their region. (n + 2,) group numbers."""
    n = network.n
    group = network.components(~(active[network.tail] | active[network.head]))
    passive = ~active[:n]
    group[:n][passive & (level[:n] < threshold)] = group[n]
    group[:n][passive & (level[:n] > 1 - threshold)] = group[n + 1]
    return np.unique(group, return_inverse=True)[1].astype(np.int32)
