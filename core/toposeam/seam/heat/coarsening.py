"""From coarse to fine: the pixels of a large overlap between which the seam can still choose.

A large network is shrunk by merging every node with the neighbour that is most expensive to divide from it,
again and again, as multilevel graph partitioning does (Karypis and Kumar 1998,
doi:10.1137/S1064827595287997). A seam hardly ever cuts those interfaces, and the costs of all the others stay
exact, so the coarse problem is the fine one with bad choices removed. A few heat steps on the coarsest
network show where heat flows at all. On the next finer one only the nodes beside such flow are free; the
others stay merged with the side they lie on, or with their region between two flows. There the heat starts
anew, and so on down to the pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from toposeam.arrays import Floats, Floats32, Ints32, Mask
from toposeam.errors import SolverError
from toposeam.heat.network import Network
from toposeam.heat.primal_dual import PrimalDual
from toposeam.seam.problem.grid import CutGrid

#: Largest overlap, in free pixels, that is solved without coarsening.
WHOLE_NODES = 30_000

#: Number of free nodes at which coarsening ends.
COARSEST_NODES = 12_000

#: Gap between the best cut and the bound, as a share of the bound, at which the heat of a coarse network has
#: gathered enough; and the most Newton steps it gets.
GATHERED_GAP = 0.1
MOST_STEPS = 10
#: Gap, likewise, at which steps end even if faint flows still join the two sides.
PROVEN_GAP = 1e-3

#: Most nodes of a coarse network, per interface of the seam, that are taken apart on the next finer level;
#: fewer where that level is the pixels, which decide only details. Strong flux comes first.
OPENED_NODES = 64
OPENED_NODES_LAST = 16
#: Least flux, of a total of 1, beside a node that is taken apart.
OPEN_FLUX = 0.005

#: Elements sorted at a time, to bound the memory.
_BLOCK_ELEMENTS = 1 << 16
#: Pixels counted at a time, to bound the memory: numpy counts 64-bit integers only.
_BLOCK_PIXELS = 1 << 20
#: Pixels merged at a time, to bound the memory.
_MERGED_PIXELS = 65_536
#: Largest relative change of a cost that tells it apart from equal ones.
_UNEVENNESS = 1e-3
#: Pointer doublings at most: chains of nodes are no longer than two to the power of this.
_MOST_DOUBLINGS = 24
_GOLDEN = np.uint32(2654435769)  # 2^32 times the golden ratio


@dataclass(frozen=True, slots=True, eq=False)
class _Level:
    """One network of the hierarchy; node n is the cold terminal and n + 1 the hot one."""

    n: int
    tail: Ints32
    head: Ints32
    #: (E,) cost of dividing the two nodes of each element.
    weight: Floats
    #: (n + 2,) pixels per node.
    size: Floats


def _gather(grid: CutGrid) -> tuple[Mask, Ints32, Ints32]:
    """Let heat gather on coarse networks, as :func:`restrict` describes it.

    Returns
    -------
    active : (n + 2,) bool array
        The nodes of the finest of them beside flow.
    region : (n + 2,) int32 array
        The region of the others; those of the terminals come last.
    node_of_pixel : (h, w) int32 array
        The node of every pixel, a terminal where it is not free.
    """
    below, count = merge_pixels(grid)
    size = _pixels_in(below, count)
    elements = _pixel_elements(grid, below, count)
    level = _quotient(count, *elements, size)
    del elements
    levels, parents = [level], [below]
    while level.n > COARSEST_NODES:
        parent = merge_nodes(level.n, level.tail, level.head, level.weight, level.size)
        coarser = _quotient(
            int(parent[-1]) - 1,
            parent[level.tail],
            parent[level.head],
            level.weight,
            np.bincount(parent, level.size, int(parent[-1]) + 1).astype(np.float64, copy=False),
        )
        if coarser.n > 0.8 * level.n or coarser.n == 0:
            break
        levels.append(coarser)
        parents.append(parent)
        level = coarser
    network, weight, node_of = (
        _network(level.n, level.tail, level.head),
        level.weight,
        np.arange(level.n + 2, dtype=np.int32),
    )
    while True:
        most = OPENED_NODES if len(levels) > 1 else OPENED_NODES_LAST
        level, parent = levels.pop(), parents.pop()
        children = np.bincount(parent.ravel(), minlength=level.n + 2).astype(np.float64)
        active, region = _decided(level, network, weight, node_of, children, most)
        if not levels:
            return active, region, parent
        node_of, n = _freed(active, region, parent)
        level = levels[-1]
        tail, head, (weight,) = _parallel(n, node_of[level.tail], node_of[level.head], level.weight)
        network = _network(n, tail, head)


def restrict(grid: CutGrid) -> tuple[Network, Floats, Floats, Ints32]:
    """Build the network of the free pixels that coarser networks leave undecided.

    *A worked example.* One row of eight free pixels between ground of a alone and of b alone. Interfaces
    cost ::

        a 9 p0 9 p1 5 p2 9 p3 1 p4 9 p5 5 p6 9 p7 9 b

    Each pixel merges with the neighbour that is most expensive to divide from it. That makes four pairs, and
    the interfaces between them and to the two sides cost 9 | 5 | 1 | 5 | 9. Most of the potential difference
    falls at the 1. The two pairs beside it are opened (if five pixels may be, per interface of the seam); the
    outer ones lie on the cold and on the hot side of that flow, and become part of these terminals. Left are
    the pixels p2 to p5 ::

        cold 5 p2 9 p3 1 p4 9 p5 5 hot

    with the same costs as before, so that each choice among them costs what it costs on the whole row.

    Parameters
    ----------
    grid : CutGrid

    Returns
    -------
    network : Network
    weight, multiplicity : (E,) float64 arrays
        Summed cost and number of the interfaces that each element stands for.
    node_of_pixel : (h, w) int32 array
        The node of every free pixel; that of the cold terminal elsewhere.
    """
    node_of, n = _freed(*_gather(grid))
    tail, head, cost = _pixel_elements(grid, node_of, n)
    tail, head, (weight, multiplicity) = _parallel(n, tail, head, cost, np.ones_like(cost))
    return _network(n, tail, head), weight, multiplicity, node_of


def _network(n: int, tail: Ints32, head: Ints32) -> Network:
    return Network(
        n, tail.astype(np.intp), head.astype(np.intp)
    )  # numpy uses 64-bit indices without converting them every time


def _pixel_elements(grid: CutGrid, group: Ints32, n: int) -> tuple[Ints32, Ints32, Floats32]:
    """List the interfaces between n groups of pixels and the two terminals: two nodes each, and the cost."""
    pairs = ((grid.right, group[:, :-1], group[:, 1:]), (grid.down, group[:-1], group[1:]))
    divided = [(one != other) & (cost > 0) for cost, one, other in pairs]
    divided[0] &= grid.free[:, :-1] & grid.free[:, 1:]
    divided[1] &= grid.free[:-1] & grid.free[1:]
    crossings = [int(np.count_nonzero(mask)) for mask in divided]
    terminals = ((n, grid.cold, np.flatnonzero(grid.cold)), (n + 1, grid.hot, np.flatnonzero(grid.hot)))
    count = sum(crossings) + sum(len(touching) for _, _, touching in terminals)
    tail, head, weight = np.empty(count, np.int32), np.empty(count, np.int32), np.empty(count, np.float32)
    start = 0
    for mask, crossed, (cost, one, other) in zip(divided, crossings, pairs, strict=True):
        part = slice(start, start := start + crossed)
        tail[part], head[part], weight[part] = one[mask], other[mask], cost[mask]
    for terminal, ends, touching in terminals:
        part = slice(start, start := start + len(touching))
        tail[part], head[part], weight[part] = group.ravel()[touching], terminal, ends.ravel()[touching]
    return tail, head, weight


def _parallel(
    n: int, one: Ints32, other: Ints32, *values: npt.NDArray[np.floating]
) -> tuple[Ints32, Ints32, list[Floats]]:
    """Add up parallel elements between n nodes and two terminals.

    Elements within a node or between the terminals are left out. `one` and `other` are overwritten.
    """
    low, high = one, other
    for start in range(0, len(one), _BLOCK_ELEMENTS):
        part = slice(start, start + _BLOCK_ELEMENTS)
        least = np.minimum(one[part], other[part])
        np.maximum(one[part], other[part], out=high[part])
        low[part] = least
    alive = (low != high) & (low < n)
    if not alive.all():
        low, high, values = low[alive], high[alive], tuple(value[alive] for value in values)
    del alive
    sums = []
    for value in values:
        table = coo_array((value, (low, high)), shape=(n + 2, n + 2)).tocsc().tocsr()
        sums.append(table.data.astype(np.float64))
    tail = np.repeat(np.arange(n + 2, dtype=np.int32), np.diff(table.indptr))
    return tail, table.indices, sums


def _quotient(n: int, one: Ints32, other: Ints32, weight: npt.NDArray[np.floating], size: Floats) -> _Level:
    """Build the level of n groups of nodes and the terminals; `one` and `other` are overwritten."""
    tail, head, (weight,) = _parallel(n, one, other, weight)
    return _Level(n, tail, head, weight, size)


def _pixels_in(group: Ints32, n: int) -> Floats:
    """Count the pixels of each group, (n + 2,) floats; terminals have none."""
    size = np.zeros(n + 2, np.intp)
    for start in range(0, group.size, _BLOCK_PIXELS):
        size += np.bincount(group.ravel()[start : start + _BLOCK_PIXELS], minlength=n + 2)
    size[n:] = 0
    return size.astype(np.float64)


def _decided(
    level: _Level,
    network: Network,
    weight: Floats,
    node_of: Ints32,
    children: Floats,
    opened: float,
) -> tuple[Mask, Ints32]:
    """Let heat gather on the restricted network of a level, and find the nodes that stay undecided.

    At most `opened` nodes per interface of the seam are active.

    Returns
    -------
    active : (level.n + 2,) bool array
        Nodes beside flow.
    region : (level.n + 2,) int array
        The region of every node that is not active; those of the terminals come last.
    """
    state = PrimalDual(network, weight)
    for left in reversed(range(MOST_STEPS + 1)):
        if state.best_cut()[0] <= (1 + GATHERED_GAP) * state.bound or not left:
            threshold, flux, strongest = _threshold(state, level, node_of, children, opened)
            region = _regions(network, flux <= threshold)
            if region is not None or state.best_cut()[0] <= (1 + PROVEN_GAP) * state.bound or not left:
                break
        try:
            state.step()
        except SolverError:
            threshold, flux, strongest = _threshold(state, level, node_of, children, opened)
            region = None
            break
    while region is None:  # open more nodes than wanted, rather than join the two sides
        threshold /= 2
        region = _regions(network, flux <= threshold)
    region = region[node_of]
    active = strongest > threshold
    # Only regions that keep a node are numbered.
    kept = np.zeros(int(region[-1]) + 1, bool)
    kept[region[~active]] = True
    return active, (np.cumsum(kept, dtype=np.int32) - 1)[region]


def _regions(network: Network, closed: Mask) -> Ints32 | None:
    """Return the region of every node once some elements are closed.

    None where closed elements join the two sides: then many faint flows lead from one to the other.
    """
    try:
        return network.components(closed).astype(np.int32, copy=False)
    except SolverError:
        return None


def _threshold(
    state: PrimalDual, level: _Level, node_of: Ints32, children: Floats, opened: float
) -> tuple[float, Floats, Floats]:
    """Find the flux above which nodes are opened.

    Returns it, the flux of every element of the restricted network, and the strongest flux beside every node
    of the level.
    """
    potential = np.clip(state.potential, 0.0, 1.0)
    at = potential[node_of]
    jump = np.abs(at.take(level.tail) - at.take(level.head))
    strongest = np.zeros(level.n + 2)
    for here in (level.tail, level.head):
        np.maximum.at(strongest, here, jump)
    strongest[level.n :] = 0.0
    found = np.flatnonzero(strongest > OPEN_FLUX)
    found = found[np.argsort(-strongest[found], kind="stable")]
    # The sum of the jumps is the number of interfaces in a cut at a random threshold.
    most = int(np.searchsorted(np.cumsum(children[found]), opened * float(jump.sum())))
    threshold = float(strongest[found[most]]) if most < len(found) else OPEN_FLUX
    return threshold, state.network.difference(potential), strongest


def _freed(active: Mask, region: Ints32, parent: Ints32) -> tuple[Ints32, int]:
    """Number the nodes of the finer level.

    First come the freed nodes, each alone, then regions, then terminals. Returns the numbers, in the shape of
    `parent`, and their count without terminals.
    """
    free = active[parent]
    node = np.cumsum(free, dtype=np.int32).reshape(free.shape)
    count = int(node.ravel()[-1])
    node -= 1
    np.copyto(node, (region + np.int32(count))[parent], where=~free)
    return node, count + int(region[-1]) - 1


def merge_pixels(grid: CutGrid) -> tuple[Ints32, int]:
    """Group every free pixel with the neighbour that is most expensive to divide from it.

    Returns the (h, w) group numbers and the number of groups.
    """
    shape = grid.free.shape
    target = np.arange(grid.free.size, dtype=np.int32).reshape(shape)
    thick = max(1, _MERGED_PIXELS // shape[1])
    for top in range(0, shape[0], thick):
        bottom = min(top + thick, shape[0])
        above, last = max(top - 1, 0), min(bottom, shape[0] - 1)  # rows whose lower neighbours matter
        best, place = np.zeros((bottom - top, shape[1]), np.float32), target[top:bottom].copy()
        right, down = (
            cost[rows]
            * _uneven(cost[rows].size, stride + rows.start * cost.shape[1]).reshape(cost[rows].shape)
            for cost, rows, stride in (
                (grid.right, slice(top, bottom), 1),
                (grid.down, slice(above, last), shape[1]),
            )
        )
        free = grid.free[above : last + 1]
        down *= free[:-1] & free[1:]
        free = grid.free[top:bottom]
        right *= free[:, :-1] & free[:, 1:]
        for score, here, offset in (
            (right, np.s_[:, :-1], 1),
            (right, np.s_[:, 1:], -1),
            (down[top - above :], np.s_[: last - top], shape[1]),
            (down[: bottom - 1 - above], np.s_[above + 1 - top :], -shape[1]),
        ):
            better = score > best[here]
            np.copyto(best[here], score, where=better)
            np.copyto(target[top:bottom][here], place[here] + np.int32(offset), where=better)
    count, group = _components(target.ravel())
    free = grid.free.ravel()
    if not free.all():
        kept = np.zeros(count, bool)
        kept[group[free]] = True
        number = np.cumsum(kept, dtype=np.int32) - 1
        count = int(number[-1]) + 1
        group = number[group]
        group[~free] = count
    return group.reshape(shape), count


def merge_nodes(n: int, tail: Ints32, head: Ints32, weight: Floats, size: Floats) -> Ints32:
    """Group every node with the neighbour that is most expensive to divide from it, relative to their sizes.

    Returns the (n + 2,) group numbers.
    """
    share = 1.0 / np.sqrt(np.maximum(size, 1.0))
    share[n:] = 0.0
    score = weight * share.take(tail) * share.take(head) * _uneven(len(weight), 0)
    best = np.full(n + 2, np.finfo(float).tiny)
    target = np.arange(n + 2, dtype=np.int32)
    for here in (tail, head):
        np.maximum.at(best, here, score)
    for here, there in ((tail, head), (head, tail)):
        found = np.flatnonzero(score == best.take(here))
        target[here[found]] = there[found]
    return _components(target)[1]  # the terminals stay alone, and last


def _uneven(count: int, start: int) -> Floats32:
    """Compute factors just above 1, from a golden-ratio sequence, that tell equal costs apart.

    Without them flat areas would merge into one node.
    """
    spread = np.arange(start, start + count, dtype=np.uint32)
    spread *= _GOLDEN
    factor = spread.astype(np.float32)
    factor *= np.float32(_UNEVENNESS / 2**32)
    factor += np.float32(1)
    return factor


def _components(target: Ints32) -> tuple[int, Ints32]:
    """Find the components of the graph in which every node points to one other or to itself.

    Returns their count and the number of each node's, which overwrites `target`. Following the pointers ends
    at two nodes that point to each other, or at one that points to itself.
    """
    root = target.take(target)
    np.copyto(root, target, where=root != np.arange(len(target), dtype=np.int32))
    np.minimum(root, target, out=root)
    for _ in range(_MOST_DOUBLINGS):
        further = root.take(root)
        if np.array_equal(further, root):
            break
        root = further
    del further
    if not np.array_equal(root.take(target), root):  # equal costs close a longer cycle
        n = len(target)
        graph = csr_array((np.ones(n, np.int8), target, np.arange(n + 1, dtype=np.int32)), shape=(n, n))
        return connected_components(graph, directed=False)  # type: ignore[no-any-return]
    number = np.zeros(len(root), np.int32)
    number[root] = 1
    count = int(np.count_nonzero(number))
    np.cumsum(number, out=number)
    number -= 1
    return count, number.take(root, out=target, mode="clip")
