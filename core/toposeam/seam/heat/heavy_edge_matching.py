"""Heavy-edge matching: groups of pixels that are expensive to divide, which coarsening merges."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from toposeam.arrays import Floats, Floats32, Ints32
from toposeam.seam.problem.grid import CutGrid

#: Pixels merged at a time, to bound the memory.
_BLOCK_PIXELS = 65_536
#: Largest relative change of a cost that tells it apart from equal ones.
_UNEVENNESS = 1e-3
#: Pointer doublings at most: chains of nodes are no longer than two to the power of this.
_MOST_DOUBLINGS = 24
_GOLDEN = np.uint32(2654435769)  # 2^32 times the golden ratio


def merge_pixels(grid: CutGrid) -> tuple[Ints32, int]:
    """Group every free pixel with the neighbour that is most expensive to divide from it.

    Returns the (h, w) group numbers and the number of groups.
    """
    shape = grid.free.shape
    target = np.arange(grid.free.size, dtype=np.int32).reshape(shape)
    thick = max(1, _BLOCK_PIXELS // shape[1])
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
