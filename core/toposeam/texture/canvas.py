"""The canvas: which pixel of the atlas shows at each pixel of the texture, on a plane, a cylinder or
a torus.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from toposeam.images import Mask
from toposeam.texture.atlas import Ints32


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
        #: Which copy each patch belongs to: patches that continue one another are one copy.
        self._copies: list[int] = []
        #: How many pixels of each copy show.
        self._areas: list[int] = []

    def window(
        self, top: int, left: int, height: int, width: int
    ) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Mask]:
        """Rows (h, 1), columns (1, w) and where they are on the canvas (h, w), of a window that may reach
        over its borders.
        """
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

    def read(self, top: int, left: int, height: int, width: int) -> Ints32:
        """The (h, w) flat indices of a window, -1 off the canvas and where nothing has been laid."""
        rows, columns, inside = self.window(top, left, height, width)
        return np.where(inside, self.index[rows, columns], np.int32(-1))

    def paint(self, top: int, left: int, source: Ints32, shows: Mask) -> None:
        """Lay a patch.

        Parameters
        ----------
        source : (h, w) int32 array
            Flat indices of the patch's pixels.
        shows : (h, w) bool array
            Where it shows; only on the canvas.
        """
        rows, columns, _ = self.window(top, left, *shows.shape)
        y, x = np.nonzero(shows)
        at = rows[y, 0], columns[0, x]
        before = self.index[at]
        np.subtract.at(self.usage, before[before >= 0], 1)
        np.add.at(self.usage, source[shows], 1)
        for label, count in zip(*np.unique(self.labels[at], return_counts=True), strict=True):
            if label >= 0:
                self._areas[self._copies[label]] -= int(count)
        self._join(self.window(top, left, *shows.shape), source, len(y))
        self.index[at] = source[shows]
        self.labels[at] = self.patches
        self.patches += 1

    def begin(self, index: Ints32) -> None:
        """Show something as patch 0 before any other is laid.

        Parameters
        ----------
        index : (H, W) int32 array
            Flat indices, -1 where nothing shows.
        """
        self.index[:] = index
        self.labels[index >= 0] = 0
        self._copies, self._areas, self.patches = [0], [int((index >= 0).sum())], 1

    def copy_labels(self) -> Ints32:
        """(H, W) int32, the number of the copy that shows: patches that continue one another have one number,
        the first one's. -1 where nothing shows.
        """
        first: dict[int, int] = {}
        numbers = [first.setdefault(copy, patch) for patch, copy in enumerate(self._copies)]
        return np.array([*numbers, -1], np.int32)[self.labels]

    def copies(
        self, top: int, left: int, height: int, width: int
    ) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Ints32, npt.NDArray[np.intp]]:
        """The copies in a window: row and column in the window of a pixel of each, the flat index that shows
        there, and how many pixels of the copy show on the canvas.

        A copy that goes once round a torus meets a window twice, and is told twice.
        """
        rows, columns, inside = self.window(top, left, height, width)
        labels = np.where(inside, self.labels[rows, columns], np.int32(-1)).ravel()
        found, first = np.unique(labels, return_index=True)
        first, found = first[found >= 0], found[found >= 0]
        y, x = np.divmod(first, width)
        areas = np.array([self._areas[self._copies[label]] for label in found.tolist()], np.intp)
        return y, x, self.index[rows[y, 0], columns[0, x]], areas

    def _join(
        self, window: tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Mask], source: Ints32, count: int
    ) -> None:
        """The next patch as part of the copy that it continues, if it does."""
        rows, columns, inside = window
        same = (self.index[rows, columns] == source) & inside
        touched = {self._copies[label] for label in np.unique(self.labels[rows, columns][same]).tolist()}
        copy = min(touched) if touched else len(self._areas)
        if not touched:
            self._areas.append(0)
        for other in touched - {copy}:
            self._areas[copy] += self._areas[other]
            self._areas[other] = 0
            self._copies = [copy if one == other else one for one in self._copies]
        self._copies.append(copy)
        self._areas[copy] += count
