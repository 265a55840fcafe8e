r"""Strokes as one piece: connected, and nowhere narrower than a bridge.

Of a mask, *cores* are kept: what is at least half a bridge from its edge, and the centre lines of what is
narrower. Cores are connected by the shortest straight bridges, as in Kruskal's minimum spanning tree, and the
piece is what lies within half a bridge of them. So every point of it lies in a disc of the bridge's width
that lies in it, and one such disc can be moved from any to any other.

A pattern is one piece if it is so in the whole plane, and not only on the cell wound up to a torus: strokes
may connect in the torus and still fall apart into parallel strips. So the tree keeps, for every set of
connected cores, the translations under which the set is connected with its own copies, and ends when these
are all translations of the pattern.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats, Ints, Mask
from toposeam.motif.ink.raster import Raster

_SQUARE = np.ones((3, 3), bool)
#: Pieces whose area is below this many squares of the bridge's width are dropped, not connected.
_MIN_AREA = 1.0
#: The basis of all translations of a pattern.
_WHOLE = ((1, 0), (0, 1))
#: A translation of the pattern, in whole patterns down and across.
_Shift = tuple[int, int]


@dataclass(frozen=True, slots=True)
class _Link:
    """A way between two cores: core `a` in the pattern and core `b` in its copy at `shift`."""

    a: int
    b: int
    shift: _Shift
    #: Rows and columns of both ends, in the pattern and beyond it; None where the cores touch.
    ends: tuple[int, int, int, int] | None


def one_piece(mask: Mask, raster: Raster, width: float) -> Floats:
    """Return the distance of every pixel from the edge of one piece made of a mask; below 0 inside.

    Parameters
    ----------
    mask : (H, W) bool array
        Of the whole pattern of a raster. Of a pattern that does not repeat, one cell.
    raster : Raster
    width : float
        Width of a bridge, in elements.

    Returns
    -------
    (H, W) float array
        In elements. All of it is above 0 where the mask is empty.
    """
    from skimage.morphology import skeletonize  # takes a while to load

    mask = _without_small(mask, raster, width)
    wide, before = raster.padded(mask)
    depth = ndimage.distance_transform_edt(wide, sampling=raster.spacing)
    thick = depth >= width / 2
    opened = (
        ndimage.distance_transform_edt(~thick, sampling=raster.spacing) <= width / 2
        if thick.any()
        else np.zeros_like(wide)
    )
    cores = raster.inner(thick | (skeletonize(wide) & ~opened), before)  # type: ignore[no-untyped-call]
    if not cores.any():
        return np.full(mask.shape, width)
    connected = _connected(cores, raster)
    return raster.distance(connected) - width / 2


def _without_small(mask: Mask, raster: Raster, width: float) -> Mask:
    """Drop the pieces that are smaller than a bridge is wide; if all are, none is dropped."""
    wide, before = raster.padded(mask)
    labels, count = ndimage.label(wide, _SQUARE)
    area = np.bincount(labels.ravel(), minlength=count + 1) * np.prod(raster.spacing)
    kept = area >= _MIN_AREA * width**2
    kept[0] = False
    return raster.inner(kept[labels], before) if kept.any() else mask


def _connected(cores: Mask, raster: Raster) -> Mask:
    """Return cores with the lines of pixels that connect them, in the whole plane."""
    from skimage.draw import line

    labels, count = ndimage.label(cores, _SQUARE)
    tree = _Tree(count)
    if raster.is_closed:
        for link in _touching(labels):
            tree.joins(link)
    connected = cores.copy()
    for link in _bridges(labels, raster):
        if tree.is_whole(raster.is_closed):
            break
        if tree.joins(link) and link.ends is not None:
            rows, columns = line(*link.ends)  # type: ignore[no-untyped-call]
            connected[rows % len(cores), columns % cores.shape[1]] = True
    return connected


def _touching(labels: Ints) -> Iterator[_Link]:
    """Find the cores that touch each other across the pattern's border."""
    for axis, shift in ((0, (1, 0)), (1, (0, 1))):
        last, first = (np.take(labels, index, axis=axis) for index in (-1, 0))
        for step in (-1, 0, 1):
            beside = np.roll(first, -step)
            pairs = np.unique(np.column_stack([last, beside])[(last > 0) & (beside > 0)], axis=0)
            # At a corner the neighbour may lie in the next pattern along the border, too; those few are left.
            for a, b in pairs.tolist():
                if step and not _meet(last, beside, a, b, step):
                    continue
                yield _Link(a - 1, b - 1, shift, None)


def _meet(last: Ints, beside: Ints, a: int, b: int, step: int) -> bool:
    """Test whether two cores touch by a step along the border that does not leave it."""
    found = np.flatnonzero((last == a) & (beside == b)) + step
    return bool(((found >= 0) & (found < len(last))).any())


def _bridges(labels: Ints, raster: Raster) -> Iterator[_Link]:
    """Find the shortest way between every two cores whose nearest surroundings adjoin, the shortest first."""
    wide, before = raster.padded(labels > 0)
    nearest: npt.NDArray[np.intp]
    distance, nearest = ndimage.distance_transform_edt(~wide, sampling=raster.spacing, return_indices=True)
    rows, columns = labels.shape
    place = nearest - np.array(before)[:, np.newaxis, np.newaxis]
    copy = np.stack([place[0] // rows, place[1] // columns])
    owner = labels[place[0] % rows, place[1] % columns]
    inner = slice(before[0], before[0] + rows + 1), slice(before[1], before[1] + columns + 1)
    found = []
    for axis in (0, 1):
        here = tuple(slice(0, -1) if one == axis else slice(None) for one in (0, 1))
        there = tuple(slice(1, None) if one == axis else slice(None) for one in (0, 1))
        parts = [
            np.stack([owner[inner][side], *copy[:, *inner][:, *side], *place[:, *inner][:, *side]])
            for side in (here, there)
        ]
        length = (distance[inner][here] + distance[inner][there] + raster.spacing[axis]).ravel()
        a, b = (part.reshape(5, -1) for part in parts)
        unlike = (a[:3] != b[:3]).any(axis=0)
        found.append(np.vstack([a[:, unlike], b[:, unlike], length[unlike]]))
    edges = np.concatenate(found, axis=1)
    edges = edges[:, np.argsort(edges[-1], kind="stable")]
    kinds = np.stack([edges[0], edges[5], edges[6] - edges[1], edges[7] - edges[2]])
    _, first = np.unique(kinds, axis=1, return_index=True)
    for edge in edges[:, np.sort(first)].T.tolist():
        a, row, column, y, x, b, other_row, other_column, to_y, to_x, _ = edge
        shift = int(other_row - row), int(other_column - column)
        yield _Link(int(a) - 1, int(b) - 1, shift, (int(y), int(x), int(to_y), int(to_x)))


class _Tree:
    """Sets of connected cores of a periodic pattern, and the translations that each is connected by."""

    def __init__(self, count: int) -> None:
        self._set = np.arange(count)
        #: The copy of each core that is connected with its set's first core.
        self._copy = np.zeros((count, 2), int)
        self._shifts: list[tuple[_Shift, ...]] = [()] * count

    def joins(self, link: _Link) -> bool:
        """Connect two cores; return False where they were connected so already."""
        a, b = int(self._set[link.a]), int(self._set[link.b])
        shift = self._copy[link.a] + np.array(link.shift) - self._copy[link.b]
        if a != b:
            members = self._set == b
            self._copy[members] += shift
            self._set[members] = a
            self._shifts[a] = _basis([*self._shifts[a], *self._shifts[b]])
            return True
        basis = _basis([*self._shifts[a], (int(shift[0]), int(shift[1]))])
        new: bool = basis != self._shifts[a]
        self._shifts[a] = basis
        return new

    def is_whole(self, closed: bool) -> bool:
        """Test whether all cores are connected, and in a closed pattern with all their copies."""
        one = int(self._set[0])
        connected = bool((self._set == one).all())
        return connected and (not closed or tuple(self._shifts[one]) == _WHOLE)


def _basis(shifts: list[_Shift]) -> tuple[_Shift, ...]:
    """Return the basis, in Hermite normal form, of the translations that the given ones make."""
    down = [shift for shift in shifts if shift[0]]
    across = [shift[1] for shift in shifts if not shift[0]]
    while len(down) > 1:  # Euclid's algorithm on the first numbers
        down.sort(key=lambda shift: abs(shift[0]))
        (row, column), (other, beside) = down[0], down.pop()
        times = other // row
        rest = other - times * row, beside - times * column
        if rest[0]:
            down.append(rest)
        else:
            across.append(rest[1])
    width = int(np.gcd.reduce(across)) if across else 0
    if not down:
        return ((0, width),) if width else ()
    row, column = down[0] if down[0][0] > 0 else (-down[0][0], -down[0][1])
    if not width:
        return ((row, column),)
    return (row, column % width), (0, width)
