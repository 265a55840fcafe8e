"""The exact optimum: a shortest path between corners, and for topologies where the cut is more than one path
a maximum flow.

On an overlap that the seam crosses from one gap to another (a strip, an L) a minimum cut between pixels is a
shortest path between corners, the planar dual (Ford and Fulkerson 1956), which Dijkstra's algorithm finds.
Rings, islands and overlaps with more than two gaps are solved by maximum flow
(:mod:`toposeam.seam.exact.maximum_flow`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import scipy
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from toposeam.arrays import AnyInts, Floats32, Mask
from toposeam.seam.exact.corner_graph import cheapest_path
from toposeam.seam.problem.overlap import FREE, NONE, TOUCHING, A, B
from toposeam.seam.problem.seam_problem import SeamProblem, geometry

_Box = tuple[slice, slice]
#: Each pixel and its right, or lower, neighbour.
_PAIRS: tuple[tuple[_Box, _Box], ...] = (np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1, :], np.s_[1:, :])


def exact_labels(
    problem: SeamProblem,
    most: float = np.inf,
    flow: Callable[[SeamProblem, Mask], Mask] | None = None,
    whole: float = np.inf,
) -> Mask:
    """Find the labelling of least cost.

    Parameters
    ----------
    problem : SeamProblem
    most : float
        Cost of a known seam; dearer ones are not searched.
    flow : callable, optional
        Divides free pixels whose cut is not a path; by default :func:`cut_by_flow`.
    whole : float
        Largest number of corners among which a path is searched at once. Among more it is searched near the
        best one of every other corner, and need not be the cheapest.

    Returns
    -------
    (h, w) bool array
    """
    side = problem.overlap.side
    labels = problem.complete(np.zeros(side.shape, bool)).astype(bool, copy=False)
    for box, pixels, alone in pieces(side == FREE):
        # Unary costs belong to no interface, hence to no path.
        found = (
            None
            if problem.tied
            else shortest_path(problem, box, pixels, most if alone else np.inf, whole=whole)
        )
        if found is None:
            piece = np.zeros(side.shape, bool)
            piece[box] = pixels
            labels[piece] = (flow or cut_by_flow)(problem, piece)[piece]
        else:
            labels[box][pixels] = found[pixels]
    return labels


def shortest_path(
    problem: SeamProblem,
    box: _Box,
    free: Mask,
    most: float = np.inf,
    zone: Mask | None = None,
    whole: float = np.inf,
) -> Mask | None:
    """Label the free pixels of a box by one shortest path; None where the cut is not a single path.

    Parameters
    ----------
    problem : SeamProblem
    box : (slice, slice)
        Rows and columns of the window: the bounding box of the free pixels, and one pixel around it.
    free : (h, w) bool array
        On the box.
    most : float
        Cost of a known seam there; dearer ones are not searched.
    zone : (h, w) bool array, optional
        On the box: the seam may run beside these pixels only.
    whole : float
        Largest number of corners that are searched at once, as for :func:`exact_labels`.

    Returns
    -------
    (h, w) bool array
        On the box; pixels that are not free have arbitrary values.

    Notes
    -----
    Corner (y, x) of the box is the upper left one of its pixel (y, x). ``below[y, x]`` is the cost of going
    down from it, ``beside[y, x]`` of going right, 0 along gaps and infinite where no seam may run::

        pixel (y-1, x-1)       │         pixel (y-1, x)
                               │ below[y-1, x]
        ─── beside[y, x-1] ─── corner (y, x) ─── beside[y, x] ───
                               │ below[y, x]
        pixel (y, x-1)         │         pixel (y, x)
    """
    side = problem.overlap.side[box]
    h, w = side.shape
    border = border_of(problem, box, free)
    if not border.to_b:
        return np.zeros(side.shape, bool)
    if not border.to_a:
        return np.ones(side.shape, bool)
    ends = border.ends()
    if ends is None:
        return None
    # No edge leads beyond the last row or the last column.
    below, beside = (np.full((h + 1, w + 1), np.inf, np.float32) for _ in range(2))
    layout = (below[:-1, 1:-1], beside[1:-1, :-1])
    for costs, cost, gap, (s, t) in zip(layout, _costs(problem, box), border.gaps, _PAIRS, strict=True):
        np.copyto(costs, cost, where=(free[s] | free[t]) & (cost > 0))
        costs[gap] = 0.0
    if zone is not None:
        for costs, gap, (s, t) in zip(layout, border.gaps, _PAIRS, strict=True):
            np.copyto(costs, np.float32(np.inf), where=~(zone[s] | zone[t] | gap))
    limit = min(most, border.to_b) * (1 + 1e-6)
    del border, gap, zone  # the search needs the memory
    path, length = cheapest_path(below, beside, ends, limit, whole)
    del below, beside, layout, costs
    if path is None:
        return None
    for labels in _sides_of(path, side, free):
        if cut_cost(problem, box, free, labels) <= length * (1 + 1e-6):
            return labels
    return None


def cut_cost(problem: SeamProblem, box: _Box, free: Mask, labels: Mask) -> float:
    """Sum the costs of the interfaces beside free pixels that a labelling of a box cuts."""
    return sum(
        float(cost[(labels[s] != labels[t]) & (free[s] | free[t])].sum(dtype=np.float64))
        for cost, (s, t) in zip(_costs(problem, box), _PAIRS, strict=True)
    )


def pieces(free: Mask) -> Iterator[tuple[_Box, Mask, bool]]:
    """Yield every connected piece of the free pixels.

    For each: its bounding box and one pixel around it, for which the window's margin has room; its pixels in
    that box; and whether it is the only piece.
    """
    component, count = scipy.ndimage.label(free)
    boxes = [
        (slice(y.start - 1, y.stop + 1), slice(x.start - 1, x.stop + 1))
        for y, x in scipy.ndimage.find_objects(component)
    ]
    if count == 1:
        del component  # frees four bytes per pixel before the caller works on the piece
        yield boxes[0], free[boxes[0]], True
        return
    for index, box in enumerate(boxes, 1):
        yield box, component[box] == index, False


def _costs(problem: SeamProblem, box: _Box) -> tuple[Floats32, Floats32]:
    """Return the costs of the interfaces of a box, first those between neighbours in a row."""
    (rows, columns), before = box, [slice(part.start, part.stop - 1) for part in box]
    return problem.right[rows, before[1]], problem.down[before[0], columns]


class Border(NamedTuple):
    """Interfaces between the free pixels of a box and others, first those between neighbours in a row."""

    on_b: list[Mask]  #: beside pixels fixed to ``b``
    gaps: list[Mask]  #: beside pixels that neither patch covers
    to_a: float  #: total cost of the interfaces beside pixels fixed to ``a``
    to_b: float  #: likewise for ``b``

    def ends(self) -> tuple[int, int] | None:
        """Find the two corners between which the seam runs; None where it is not a single path.

        One valid cut gives all free pixels to ``a``. Every other cut has the same ends: the corners that this
        one meets an odd number of times, where all corners along one gap count as one.
        """
        on_cut, along_gap = geometry(*self.on_b)[2:], geometry(*self.gaps)[2:]
        corners, place = np.unique(np.concatenate([*on_cut, *along_gap]), return_inverse=True)
        start, end, gap_start, gap_end = np.split(
            place, np.cumsum([len(on_cut[0])] * 2 + [len(along_gap[0])])
        )
        joined = coo_array(
            (np.ones(len(gap_start), np.int8), (gap_start, gap_end)), shape=(len(corners),) * 2
        )
        _, group = connected_components(joined, directed=False)
        odd = np.flatnonzero(np.bincount(group[np.concatenate([start, end])]) % 2)
        if len(odd) != 2:
            return None
        first, last = (int(corners[np.argmax(group == one)]) for one in odd)
        return first, last


def border_of(problem: SeamProblem, box: _Box, free: Mask) -> Border:
    """Find the interfaces between the free pixels of a box, (h, w) bool, and the pixels beside them."""
    side = problem.overlap.side[box]
    on_b: list[Mask] = []
    gaps: list[Mask] = []
    cost_of = {A: 0.0, B: 0.0}
    for cost, (s, t) in zip(_costs(problem, box), _PAIRS, strict=True):
        # Few interfaces lie between a free pixel and another: their indices take less time than masks.
        outer = np.flatnonzero(free[s] != free[t])
        one, other = (side[part].ravel()[outer] for part in (s, t))
        beyond = np.where(one == FREE, other, one)
        paid = cost.ravel()[outer]
        for ground in cost_of:
            cost_of[ground] += float(paid[beyond == ground].sum(dtype=np.float64))
        for found, chosen in ((on_b, (beyond == B) & (paid > 0)), (gaps, beyond == NONE)):
            found.append(np.zeros(cost.shape, bool))
            found[-1].ravel()[outer[chosen]] = True
    return Border(on_b, gaps, cost_of[A], cost_of[B])


def _sides_of(path: npt.NDArray[np.intp], side: npt.NDArray[np.uint8], free: Mask) -> Iterator[Mask]:
    """Yield the labellings that a path of corners allows: ``b`` on its right, and ``b`` on its left.

    One is left out where a piece of the free pixels would have to show both patches. The free pixels beside
    the path are marked by its direction; the others form whole pieces (:func:`scipy.ndimage.label`), and each
    piece gets the label of its neighbours.
    """
    w = side.shape[1]
    y, x = np.divmod(path, w + 1)
    down, right = np.diff(y), np.diff(x)
    y, x = np.minimum(y[1:], y[:-1]), np.minimum(x[1:], x[:-1])
    # Where the path goes right, the upper pixel lies on its left; where it goes down, the right one does.
    on_left = y * w + x - np.where(right == 1, w, 0) - (down == -1)
    on_right = y * w + x - np.where(right == -1, w, 0) - (down == 1)
    is_a, is_b, left, righthand = 1, 2, 3, 4
    known = np.where(side == A, is_a, np.where(side == B, is_b, 0)).astype(np.uint8)
    for beside, mark in ((on_left, left), (on_right, righthand)):
        known.ravel()[beside[free.ravel()[beside]]] = mark
    piece, count = scipy.ndimage.label(free & (known == 0), TOUCHING)
    beside_piece = np.zeros((5, count + 1), bool)
    for s, t in _PAIRS:
        for here, there in ((s, t), (t, s)):
            border = np.flatnonzero((piece[here] > 0) & (known[there] > 0))
            beside_piece[known[there].ravel()[border], piece[here].ravel()[border]] = True
    for a_shows, b_shows in ((left, righthand), (righthand, left)):
        takes_b = beside_piece[is_b] | beside_piece[b_shows]
        if not (takes_b & (beside_piece[is_a] | beside_piece[a_shows])).any():
            takes_b[0] = False
            yield takes_b[piece] | (known == is_b) | (known == b_shows)


def cut_by_flow(problem: SeamProblem, pixels: Mask) -> Mask:
    """Label some free pixels, (h, w) bool, by maximum flow between the two sides.

    Costs are rounded (:func:`toposeam.seam.exact.maximum_flow.minimum_cut`).
    """
    from toposeam.seam.exact.maximum_flow import minimum_cut

    network, weight, index = problem.grid.network(pixels)
    if not len(weight):  # no interface has a cost: every labelling is as good
        return np.zeros(pixels.shape, bool)
    # Rounding relative to very dear interfaces would lose the others. An interface that costs more than a
    # whole cut is in no best cut, so costs are limited by the cheapest of three known cuts: all interfaces of
    # either terminal, and all interfaces that are not forbidden.
    ordinary = float(weight[weight < problem.forbidden].sum())
    cuts = [ordinary] + [
        float(weight[(network.tail == end) | (network.head == end)].sum())
        for end in (network.n, network.n + 1)
    ]
    limit = 1.01 * min((cut for cut in cuts if cut > 0), default=weight.max())
    return labels_of_nodes(minimum_cut(network, np.minimum(weight, limit)), index, pixels.shape)


def labels_of_nodes(hot: Mask, index: AnyInts, shape: tuple[int, int]) -> Mask:
    """Return the (h, w) labelling in which the pixels of the hot nodes are True."""
    labels = np.zeros(shape, bool)
    labels.ravel()[index] = hot
    return labels
