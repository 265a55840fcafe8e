"""Labels from paths: which patch shows where, after the seam was bent by hand.

The paths are arbitrary lines. Two neighbouring pixels are apart where the segment between their centres
crosses paths an odd number of times. Pixels that are still joined are a region, and each region shows one
patch. All crossings are exact. Path points are rounded to 1/512 px, and pixel centres stand 1/1024 px right
of and below their true place, so that no point lies on a line between centres; a path right through a centre
is taken as slightly right of it. The rest is integer arithmetic, hence paths never leak.

An example: five free pixels a row between ``a`` and ``b``, and a path that goes down, up and down again, so
that it crosses the row in the middle three times. ``|`` and ``―`` stand where neighbours are apart::

    row 0     a   p | q   r   s   t   b        path: (2, 0), (2.6, 2), (4.2, 1), (5.2, 3)
                          ―
    row 1     a   p | q | r | s   t   b        r of row 0 and r of row 1 are apart, and so are q and s
                      ―       ―                of row 1 from those below them
    row 2     a   p   q   r   s | t   b

Two regions stay joined: p of all rows with q, r and s of row 2, and through them r of row 1; it touches
``a``. The rest touches ``b``. The seam is the border between the two, and follows the path round r.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import scipy
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from toposeam.arrays import AnyInts, Bytes, Floats, Ints, Ints32, Mask
from toposeam.errors import OptionError, PathError, Term
from toposeam.images import box_of
from toposeam.seam.problem.overlap import neighbours
from toposeam.vector.polyline import Polyline

_A, _B, _FREE, _NONE = range(4)

#: Largest coordinate of a path, px; beyond, the integer arithmetic would overflow.
FARTHEST_PX = 2**20

# Exact coordinates, in units of 1/1024 px: path points on even numbers, pixel centres on odd ones.
_UNIT, _CENTRE = 1024, 513
#: Crossings computed at a time, to bound the memory.
_BLOCK_CROSSINGS = 2**21
#: Length of the steps by which ends are extended, px. An end lies in the overlap when the pixels at this
#: distance on both sides do, px.
_STEP_PX, _BESIDE_PX = 0.25, 1 / 16

#: Longest front that is a speck of a mask if another front is ten times as long: paths need not go round it.
_SPECK_PX = 16


def labels_from_paths(paths: Iterable[Polyline], overlap: Mask, side: Bytes) -> Mask:
    """Divide an overlap along paths.

    A region takes the side of the ground it touches; ground across a path speaks for the opposite side. A
    region that touches no ground is opposite to the region across the path. Ends of open paths that stop
    within the overlap are extended straight on until they leave it, and if that does not separate the
    patches, through the overlap's bounding box.

    Parameters
    ----------
    paths : iterable of Polyline
        In px, x to the right and y down from the upper left corner of pixel (0, 0).
    overlap : (H, W) bool array
        Where both patches have pixels.
    side : (H, W) uint8 array
        0 where ``a`` must show, 1 where ``b`` must show, 2 for free pixels of the overlap, 3 where neither
        patch has pixels.

    Returns
    -------
    (H, W) bool array
        True where ``b`` shows. Pixels of side 0 and 1 keep their side with any paths.

    Raises
    ------
    PathError
        When the paths do not separate the patches: somewhere a front, a connected stretch along which free
        pixels border on ground of one side, ends up half or more beside the other patch. (Less is let pass: a
        path that was bent over the edge of the overlap, or that does not end at the very corner where the
        patches part, is still clear. So is one that leaves out specks of a mask.)
    OptionError
        When `overlap` and `side` do not fit together.

    Examples
    --------
    That of the module's text:

    >>> side = np.array([[_A, _FREE, _FREE, _FREE, _FREE, _FREE, _B]] * 3)
    >>> path = Polyline([[2, 0], [2.6, 2], [4.2, 1], [5.2, 3]])
    >>> labels_from_paths([path], side == _FREE, side).astype(int)
    array([[0, 0, 1, 1, 1, 1, 1],
           [0, 0, 1, 0, 1, 1, 1],
           [0, 0, 0, 0, 0, 1, 1]])
    """
    overlap, side = np.asarray(overlap, bool), np.asarray(side, np.uint8)
    if overlap.ndim != 2 or overlap.shape != side.shape:
        raise OptionError(
            "overlap has shape {overlap!s} and side {side!s}; pass two (H, W) arrays of one shape",
            kind="shape",
            overlap=overlap.shape,
            side=side.shape,
        )
    if side.max(initial=0) > _NONE:
        raise OptionError(
            "{parameter} has the value {value}; use {allowed}",
            kind="choice",
            parameter=Term("side"),
            value=int(side.max()),
            allowed="0 (a), 1 (b), 2 (free) and 3 (nothing)",
        )
    labels: Mask = side == _B
    free = overlap & (side == _FREE)
    if not free.any():
        return labels
    # A window round the free pixels, with two pixels of margin: their neighbours, then empty ones.
    box = box_of(free, 1)
    ground = np.pad(
        np.where((side[box] == _FREE) & ~overlap[box], _NONE, side[box]), 1, constant_values=_NONE
    )
    within = np.pad(overlap[box], 1)
    outlines = [_outline(path) - np.array([box[1].start - 1, box[0].start - 1]) for path in paths]
    shortage = None
    for whole_box in (False, True):
        cut = _Cut([_extended(outline, within, whole_box) for outline in outlines], within.shape)
        shown, shortage = _shown(cut, ground)
        if shortage is None:
            labels[box] |= shown[1:-1, 1:-1]
            return labels
    raise PathError(
        "the path does not separate the {patches}: {shortage}; draw it right across the "
        "overlap, from end to end, and round every place that only one {patch} covers",
        kind="path not across",
        shortage=shortage,
    )


def _outline(path: Polyline) -> Floats:
    farthest = np.abs(path.points).max()
    if farthest > FARTHEST_PX:
        raise PathError(
            "the path reaches {farthest:.4g} px from the upper left corner; keep it within {most} px",
            kind="outside",
            farthest=float(farthest),
            most=FARTHEST_PX,
        )
    return path.outline


def _extended(outline: Floats, within: Mask, whole_box: bool) -> Floats:
    """Extend the ends of an open outline straight on until they leave the overlap, or its bounding box."""
    if (outline[0] == outline[-1]).all():
        return outline
    before, after = _beyond(outline[::-1], within, whole_box), _beyond(outline, within, whole_box)
    return np.concatenate([before, outline, after])


def _beyond(outline: Floats, within: Mask, whole_box: bool) -> Floats:
    """Find the point to which an outline is extended beyond its last one: (1, 2), or (0, 2) for none."""
    end = outline[-1]
    moved = (outline != end).any(axis=1)
    height, width = within.shape
    if not ((end >= 0) & (end <= (width, height))).all():
        return np.empty((0, 2))
    back = end - outline[np.flatnonzero(moved)[-1]]
    towards = back / np.hypot(*back)
    # Far enough to leave the window from any place in it.
    distance = np.arange(_STEP_PX / 2, height + width, _STEP_PX)
    ray = end + distance[:, np.newaxis] * towards
    beside = _BESIDE_PX * np.array([-towards[1], towards[0]])
    inside = _at(within, ray + beside) & _at(within, ray - beside)
    # The first sample outside, or the one after the last inside; 0 where the end is outside already.
    steps = (
        int(len(inside) - np.argmax(inside[::-1]) if inside.any() else 0)
        if whole_box
        else int(np.argmin(inside))
    )
    return ray[steps : steps + 1] if steps else np.empty((0, 2))


def _at(mask: Mask, points: Floats) -> Mask:
    """Look up the mask in the pixel around each point; False outside."""
    height, width = mask.shape
    x, y = np.floor(points).astype(np.int64).T
    on = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    result = np.zeros(len(points), bool)
    result[on] = mask[y[on], x[on]]
    return result


class _Cut:
    """Pairs of neighbouring pixels of an (h, w) window that paths keep apart.

    Attributes
    ----------
    right, down : (h, w) uint8 arrays
        1 where the segment from this pixel's centre to the right (lower) neighbour's crosses paths an odd
        number of times.
    """

    def __init__(self, outlines: Iterable[Floats], shape: tuple[int, int]) -> None:
        self.right, self.down = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
        height, width = shape
        exact = [np.rint(outline * (_UNIT // 2)).astype(np.int64) * 2 for outline in outlines]
        if not exact:
            return
        p, q = (
            np.concatenate([outline[:-1] for outline in exact]),
            np.concatenate([outline[1:] for outline in exact]),
        )
        # Upwards segments are turned round, so that "slightly right" is the same side of a segment for both
        # kinds of crossing.
        upwards = (q[:, 1] < p[:, 1])[:, np.newaxis]
        p, q = np.where(upwards, q, p), np.where(upwards, p, q)
        x, y = p.T
        dx, dy = (q - p).T
        for row, column in _crossings(x, y, dx, dy, np.zeros(len(p), np.int64), width - 1, height):
            np.bitwise_xor.at(self.right.ravel(), row * width + column, 1)
        for column, row in _crossings(y, x, dy, dx, (dx > 0).astype(np.int64), height - 1, width):
            np.bitwise_xor.at(self.down.ravel(), row * width + column, 1)

    def neighbours(self, pixels: Ints) -> tuple[Ints, Ints, Mask]:
        """List the four neighbours of pixels that do not lie on the border of the window.

        Returns the pixel, its neighbour (flat indices), and whether they are apart.
        """
        width = self.right.shape[1]
        right, down = self.right.ravel(), self.down.ravel()
        apart = [right[pixels], right[pixels - 1], down[pixels], down[pixels - width]]
        others = [pixels + 1, pixels - 1, pixels + width, pixels - width]
        return np.tile(pixels, 4), np.concatenate(others), np.concatenate(apart).astype(bool)


def _crossings(
    u: Ints, v: Ints, du: Ints, dv: Ints, below: Ints, size_u: int, size_v: int
) -> Iterator[tuple[Ints, Ints]]:
    """Find where segments from (u, v) to (u + du, v + dv) cross the lines v = centre of pixel j.

    Yields (j, i) for crossings between centres i and i + 1 along u.

    ``below`` is 1 where a crossing right at a centre belongs to the centres before it. Only 0 ≤ i < size_u
    and 0 ≤ j < size_v are given.
    """
    first = np.clip((np.minimum(v, v + dv) - _CENTRE) // _UNIT + 1, 0, size_v)
    last = np.clip((np.maximum(v, v + dv) - _CENTRE) // _UNIT + 1, 0, size_v)
    count = last - first
    total = np.cumsum(count)
    crossing = np.flatnonzero(count)
    ends = np.searchsorted(total[crossing], np.arange(_BLOCK_CROSSINGS, int(count.sum()), _BLOCK_CROSSINGS))
    for part in np.split(crossing, ends):
        many = count[part]
        segment = np.repeat(part, many)
        j = np.arange(len(segment)) - np.repeat(np.cumsum(many) - many, many) + first[segment]
        along = dv[segment]
        # The crossing is at u + (centre_j - v) du / dv, and i is how many pixels that is beyond centre 0,
        # rounded down. Partial sums may wrap around 64 bits, the total fits.
        numerator = (u[segment] - _CENTRE) * along + (j * _UNIT + _CENTRE - v[segment]) * du[segment]
        i = (numerator * np.sign(along) - below[segment]) // (_UNIT * np.abs(along))
        kept = (i >= 0) & (i < size_u)
        yield j[kept], i[kept]


def _shown(cut: _Cut, ground: Bytes) -> tuple[Mask, PathError | None]:
    """Label the free pixels; returns where ``b`` shows, and the error in the paths, None if there is none."""
    free = ground == _FREE
    flat_free, flat_ground = free.ravel(), ground.ravel()
    node, region, size = _regions(cut, free)
    count = len(size)

    # Contacts of free pixels with the ground, each with the label it speaks for.
    pixel, other, apart = cut.neighbours(np.flatnonzero(free & neighbours(ground <= _B)))
    known = flat_ground[other] <= _B
    pixel, other, apart = pixel[known], other[known], apart[known]
    contact = region[node[pixel]]
    says_b = (flat_ground[other] == _B) != apart
    balance = np.bincount(contact[says_b], minlength=count) - np.bincount(contact[~says_b], minlength=count)
    has_contact = np.bincount(contact, minlength=count) > 0

    # Regions across a path from each other, and through them the labels of those without contact.
    edge, across, apart = cut.neighbours(np.flatnonzero(free & _at_cut(cut)))
    apart &= flat_free[across]
    first, second = region[node[edge[apart]]], region[node[across[apart]]]
    differ = first != second
    label = _propagate(balance > 0, has_contact, first[differ], second[differ], size)

    shown = np.append(label[region], False)[node].reshape(free.shape)
    return shown, _shortage(flat_ground, ground.shape[1], other, label[contact] == says_b)


def _regions(cut: _Cut, free: Mask) -> tuple[Ints32, Ints32, Ints]:
    """Find the regions that paths leave joined.

    Returns the node of each pixel (flat, -1 where not free), the region of each node, and the sizes of the
    regions in px.
    """
    # Label everything away from the paths at once; the pixels beside a path are nodes of their own, joined in
    # a small graph.
    beside = free & _at_cut(cut)
    node, blobs = scipy.ndimage.label(free & ~beside, output=np.int32)
    node = node.ravel()
    node -= 1
    pixels = np.flatnonzero(beside)
    nodes = blobs + len(pixels)
    node[pixels] = np.arange(blobs, nodes)
    pixel, other, apart = cut.neighbours(pixels)
    joined = ~apart & free.ravel()[other]
    region = _components(node[pixel[joined]], node[other[joined]], nodes)
    return node, region, np.bincount(region, np.bincount(node + 1, minlength=nodes + 1)[1:]).astype(np.int64)


def _components(first: AnyInts, second: AnyInts, nodes: int) -> Ints32:
    """Return the connected component of each node of a graph given by its edges."""
    graph = csr_array((np.ones(len(first), np.int8), (first, second)), shape=(nodes, nodes))
    component: Ints32 = connected_components(graph, directed=False)[1]
    return component


def _at_cut(cut: _Cut) -> Mask:
    """Return the pixels that a path separates from a neighbour."""
    result = (cut.right | cut.down).astype(bool)
    result[:, 1:] |= cut.right[:, :-1].astype(bool)
    result[1:] |= cut.down[:-1].astype(bool)
    return result


def _propagate(label: Mask, decided: Mask, first: Ints, second: Ints, size: Ints) -> Mask:
    """Label all regions: undecided ones are opposite to decided ones across a path.

    `first` and `second` are the pairs of regions across a path from each other, in both orders.

    Where nothing is decided, the largest region shows ``a``.
    """
    label, decided = label & decided, decided.copy()
    count = len(label)
    group = _components(first, second, count)
    has_decided = np.bincount(group, decided) > 0
    largest_first = np.lexsort((np.arange(count), -size))
    groups, place = np.unique(group[largest_first], return_index=True)
    decided[largest_first[place[~has_decided[groups]]]] = True
    while True:
        news = decided[first] & ~decided[second]
        if not news.any():
            return label
        towards, value = second[news], ~label[first[news]]
        balance = np.bincount(towards[value], minlength=count) - np.bincount(towards[~value], minlength=count)
        label[towards] = balance[towards] > 0
        decided[towards] = True


def _shortage(ground: Bytes, width: int, other: Ints, right: Mask) -> PathError | None:
    """Find a front that the paths do not separate from the other patch; None where there is none.

    `other` are the (flat) ground pixels of all contacts, `right` whether each got the label it speaks for.
    """
    for side, name in ((_A, "a"), (_B, "b")):
        mine = ground[other] == side
        pixels, contact = np.unique(other[mine], return_inverse=True)
        # A front turns corners, so its pixels may touch diagonally.
        pairs = [
            np.intersect1d(pixels + step, pixels, assume_unique=True, return_indices=True)[1:]
            for step in (1, width - 1, width, width + 1)
        ]
        first, second = (np.concatenate(ends) for ends in zip(*pairs, strict=True))
        front = _components(first, second, len(pixels))[contact]
        total, good = np.bincount(front), np.bincount(front, right[mine])
        counts = (total > _SPECK_PX) | (10 * total > total.max(initial=0))
        failed = counts & (good < total) & (2 * good <= total)
        if failed.any():
            worst = int(np.argmax(np.where(failed, total - good, 0)))
            stretch = f"{total[worst] - good[worst]:.0f} of {total[worst]} px"
            return PathError(
                "along {stretch} of an edge of {ground} the path leaves its ground on the other {patch}'s "
                "side",
                kind="path beside",
                stretch=stretch,
                ground=Term(name, f"patch {name}"),
            )
    return None
