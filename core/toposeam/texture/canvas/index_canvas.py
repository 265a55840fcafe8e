"""The canvas: which pixel of the atlas shows at each pixel of the texture, on a plane, a cylinder or
a torus.
"""

from __future__ import annotations

import math
from mmap import mmap
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Ints32, Mask
from toposeam.texture.canvas.copy_borders import ROWS

#: Number of patches for which there is room at first; more room is made as it is needed.
_FIRST_PATCHES = 1024


class Copies(NamedTuple):
    """The copies in a window of a canvas."""

    #: (n,) row and column in the window of a pixel of each, and the flat index that shows there.
    y: npt.NDArray[np.intp]
    x: npt.NDArray[np.intp]
    shown: Ints32
    #: The first patch of each.
    first: list[int]


class IndexCanvas:
    """A texture in the making.

    Parameters
    ----------
    shape : (int, int)
        Height and width in px.
    wrap : (bool, bool)
        Whether the lower border continues at the upper one, and the right border at the left one.
    pixels : int
        Number of pixels of the atlas.
    ground : (H, W) bool array, optional
        The pixels that belong to the canvas, where not all do.
    """

    def __init__(
        self, shape: tuple[int, int], wrap: tuple[bool, bool], pixels: int, ground: Mask | None = None
    ) -> None:
        self.shape = shape
        self.wrap = wrap
        self.ground = ground
        #: (H, W) int32, flat index into the atlas; -1 where nothing has been laid.
        self.index: Ints32 = np.full(shape, -1, np.int32)
        #: (H, W) int32, number of the patch that shows; -1 where nothing has been laid.
        self.labels: Ints32 = np.full(shape, -1, np.int32)
        #: (pixels,) int32, how often each pixel of the atlas shows.
        self.usage: Ints32 = np.zeros(pixels, np.int32)
        self.patches = 0
        #: An earlier patch that each patch continues, or itself; all that are joined so are one copy.
        self._copies: Ints32 = np.zeros(_FIRST_PATCHES, np.int32)
        #: Number of pixels of each copy that show, by its first patch.
        self._areas: npt.NDArray[np.int64] = np.zeros(_FIRST_PATCHES, np.int64)

    def share(self, patches: int) -> None:
        """Move everything that changes into memory that forked processes have in common.

        Parameters
        ----------
        patches : int
            Largest number of patches that there will be.
        """
        self.index, self.labels, self.usage = map(_shared, (self.index, self.labels, self.usage))
        self._copies, self._areas = _shared(self._copies, patches), _shared(self._areas, patches)

    def shown(self, copied: Mask) -> float:
        """Compute the share of the pixels of the atlas that may be copied, (AH, AW) bool, that shows."""
        used = self.usage.reshape(copied.shape)[copied]
        return float(np.count_nonzero(used) / max(used.size, 1))

    def window(
        self, top: int, left: int, height: int, width: int
    ) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Mask]:
        """Compute the rows (h, 1) and columns (1, w) of a window that may reach over the borders, and where
        it is on the canvas (h, w).
        """
        if self._within(top, left, height, width):
            rows, columns = np.arange(top, top + height), np.arange(left, left + width)
            return rows[:, np.newaxis], columns[np.newaxis], np.ones((height, width), bool)
        axes, inside = [], []
        for start, length, limit, wraps in zip(
            (top, left), (height, width), self.shape, self.wrap, strict=True
        ):
            line = np.arange(start, start + length)
            inside.append(np.ones(length, bool) if wraps else (line >= 0) & (line < limit))
            axes.append(line % limit if wraps else np.clip(line, 0, limit - 1))
        rows, columns, on = (
            axes[0][:, np.newaxis],
            axes[1][np.newaxis],
            inside[0][:, np.newaxis] & inside[1][np.newaxis],
        )
        return rows, columns, on if self.ground is None else on & self.ground[rows, columns]

    def around(
        self, at: tuple[int, int], shape: tuple[int, int], reach: int, step: int
    ) -> list[npt.NDArray[np.int32]]:
        """Compute rows (n,) and columns (m,) of a window and of what is within reach of it, every `step` px.
        Where the canvas wraps they go on across its borders, but the opposite side is not counted twice.
        """
        axes = []
        for start, length, limit, wraps in zip(at, shape, self.shape, self.wrap, strict=True):
            most = min(reach, max((limit - length) // 2, 0)) if wraps else reach
            line = np.arange(start - most, start + length + most, step, dtype=np.int32)
            axes.append(line if wraps else line[(line >= 0) & (line < limit)])
        return axes

    def distance(self, axis: int, away: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
        """Compute distances along an axis from differences of places: the shorter way where it wraps."""
        limit = self.shape[axis]
        return np.minimum(away % limit, -away % limit) if self.wrap[axis] else np.abs(away)

    def _within(self, top: int, left: int, height: int, width: int) -> bool:
        """Test whether a window lies on the canvas and all of it belongs to it."""
        bottom, right = top + height, left + width
        return (
            self.ground is None and min(top, left) >= 0 and bottom <= self.shape[0] and right <= self.shape[1]
        )

    def read(self, top: int, left: int, height: int, width: int) -> Ints32:
        """Read the (h, w) flat indices of a window, -1 beyond the canvas and where nothing has been laid."""
        return self._part(self.index, top, left, height, width)

    def _part(self, plane: Ints32, top: int, left: int, height: int, width: int) -> Ints32:
        """Read a window of the flat indices, or of the patches' numbers; -1 beyond the canvas."""
        if self._within(top, left, height, width):
            return plane[top : top + height, left : left + width].copy()
        rows, columns, inside = self.window(top, left, height, width)
        return np.where(inside, plane[rows, columns], np.int32(-1))

    def paint(self, top: int, left: int, source: Ints32, shows: Mask) -> int:
        """Lay a patch.

        Parameters
        ----------
        source : (h, w) int32 array
            Flat indices of the patch's pixels, all different.
        shows : (h, w) bool array
            Where it shows; only on the canvas.

        Returns
        -------
        int
            Its number.
        """
        number = self.patches
        rows, columns, inside = self.window(top, left, *shows.shape)
        places = rows * self.shape[1] + columns
        there = self.index.take(places)
        same = np.flatnonzero((there == source) & inside)
        self._join(set(self.labels.take(places.take(same)).tolist()))
        self.patches += 1
        chosen = np.flatnonzero(shows)
        at = places.take(chosen)
        new = source.take(chosen)
        index, labels = self.index.reshape(-1), self.labels.reshape(-1)
        before = there.take(chosen)
        covered = np.flatnonzero(before >= 0)
        if len(covered):
            # One of its own type, or it takes ten times as long.
            np.subtract.at(self.usage, before.take(covered), np.int32(1))
            counts = np.bincount(labels.take(at.take(covered)))
            for label in np.flatnonzero(counts).tolist():
                self._areas[self.copy_of(label)] -= int(counts[label])
        self.usage[new] += 1
        self._areas[self.copy_of(number)] += len(at)
        index[at], labels[at] = new, number
        return number

    def begin(self, index: Ints32) -> None:
        """Show something as patch 0 before any other is laid.

        Parameters
        ----------
        index : (H, W) int32 array
            Flat indices, -1 where nothing shows.
        """
        shown = index >= 0
        self.index[:] = index
        np.copyto(self.labels, np.int32(0), where=shown)
        self._copies[0], self._areas[0], self.patches = 0, int(np.count_nonzero(shown)), 1

    def copy_labels(self) -> Ints32:
        """Number the copies that show: (H, W) int32, for patches that continue one another the number of the
        first one, -1 where nothing shows.
        """
        first, labels = self.first_patches(), self.labels.copy()
        if (first != np.arange(len(first))).any():
            first = np.append(first, np.int32(-1))
            for rows in (slice(top, top + ROWS) for top in range(0, len(labels), ROWS)):
                first.take(self.labels[rows], out=labels[rows], mode="wrap")
        return labels

    def first_patches(self) -> Ints32:
        """Find the first patch of the copy that each patch belongs to: (patches,) int32."""
        first: dict[int, int] = {}
        numbers = [first.setdefault(self.copy_of(patch), patch) for patch in range(self.patches)]
        return np.array(numbers, np.int32)

    def copies(self, top: int, left: int, height: int, width: int) -> Copies:
        """List the copies in a window. One that goes once round a torus may meet it twice, and is listed
        twice.
        """
        index, labels = (
            self._part(plane, top, left, height, width).ravel() for plane in (self.index, self.labels)
        )
        shown = np.flatnonzero(labels >= 0)
        labels = labels.take(shown)
        lowest = int(labels.min(initial=self.patches))
        last = np.full(int(labels.max(initial=lowest)) - lowest + 1, -1)
        last[labels - lowest] = shown
        found = np.flatnonzero(last >= 0)
        one = last.take(found)
        first = [self.copy_of(lowest + label) for label in found.tolist()]
        y, x = np.divmod(one, width)
        return Copies(y, x, index.take(one), first)

    def area_of(self, first: int) -> int:
        """Count the pixels of a copy that show, by its first patch."""
        return int(self._areas[first])

    def _join(self, touched: set[int]) -> None:
        """Make the next patch part of the copy of those that it continues, if it does."""
        first = {self.copy_of(label) for label in touched}
        copy = min(first) if first else self.patches
        if self.patches == len(self._copies):
            self._grow(2 * self.patches)
        self._copies[self.patches], self._areas[self.patches] = copy, 0
        for other in first - {copy}:
            self._copies[other] = copy
            self._areas[copy] += self._areas[other]
            self._areas[other] = 0

    def copy_of(self, patch: int) -> int:
        """Find the first patch of the copy that a patch belongs to."""
        copies = self._copies
        while (before := int(copies[patch])) != patch:
            copies[patch] = patch = int(copies[before])
        return patch

    def _grow(self, patches: int) -> None:
        """Make room for more patches."""
        more = patches - len(self._copies)
        self._copies = np.concatenate([self._copies, np.zeros(more, np.int32)])
        self._areas = np.concatenate([self._areas, np.zeros(more, np.int64)])


def _shared(values: npt.NDArray[Any], length: int = 0) -> npt.NDArray[Any]:
    """Copy an array into memory that forks of this process share; with room for a length, which takes no
    memory before it is used.
    """
    shape = max(len(values), length), *values.shape[1:]
    size = math.prod(shape)
    found: npt.NDArray[Any] = np.frombuffer(mmap(-1, max(size * values.itemsize, 1)), values.dtype, size)
    found = found.reshape(shape)
    found[: len(values)] = values
    return found
