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
        #: An earlier patch that each patch continues, or itself; all that are joined so are one copy.
        self._copies: list[int] = []
        #: How many pixels of the copy show, by its first patch.
        self._areas: list[int] = []

    def window(
        self, top: int, left: int, height: int, width: int
    ) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Mask]:
        """Rows (h, 1), columns (1, w) and where they are on the canvas (h, w), of a window that may reach
        over its borders.
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

    def _within(self, top: int, left: int, height: int, width: int) -> bool:
        """Whether a window lies on the canvas and all of it belongs to it."""
        bottom, right = top + height, left + width
        return (
            self.ground is None and min(top, left) >= 0 and bottom <= self.shape[0] and right <= self.shape[1]
        )

    def read(self, top: int, left: int, height: int, width: int) -> Ints32:
        """The (h, w) flat indices of a window, -1 off the canvas and where nothing has been laid."""
        if self._within(top, left, height, width):
            return self.index[top : top + height, left : left + width].copy()
        rows, columns, inside = self.window(top, left, height, width)
        return np.where(inside, self.index[rows, columns], np.int32(-1))

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
        same = (self.index[rows, columns] == source) & inside
        self._join(set(np.unique(self.labels[rows, columns][same]).tolist()) if same.any() else set())
        self.patches += 1
        self.extend(number, top, left, source, shows)
        return number

    def extend(self, number: int, top: int, left: int, source: Ints32, shows: Mask) -> None:
        """Show more of a patch that has been laid.

        Parameters
        ----------
        number : int
            The patch's.
        top, left, source, shows
            As for :meth:`paint`.
        """
        rows, columns, _ = self.window(top, left, *shows.shape)
        chosen = np.flatnonzero(shows)
        at = (rows * self.shape[1] + columns).ravel().take(chosen)
        new = source.ravel().take(chosen)
        index, labels = self.index.reshape(-1), self.labels.reshape(-1)
        before = index.take(at)
        covered = before >= 0
        if covered.any():
            np.subtract.at(self.usage, before[covered], 1)
            for label, count in zip(*np.unique(labels.take(at[covered]), return_counts=True), strict=True):
                self._areas[self._copy_of(int(label))] -= int(count)
        self.usage[new] += 1
        self._areas[self._copy_of(number)] += len(at)
        index[at], labels[at] = new, number

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
        numbers = [first.setdefault(self._copy_of(patch), patch) for patch in range(self.patches)]
        return np.array([*numbers, -1], np.int32)[self.labels]

    def copies(
        self, top: int, left: int, height: int, width: int, larger: int = -1
    ) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Ints32, npt.NDArray[np.intp]]:
        """The copies in a window that show on more than so many pixels of the canvas: row and column in the
        window of a pixel of each, the flat index that shows there, and how many pixels of the copy show.

        A copy that goes once round a torus meets a window twice, and is told twice.
        """
        rows, columns, inside = self.window(top, left, height, width)
        labels = np.where(inside, self.labels[rows, columns], np.int32(-1)).ravel()
        place = np.full(self.patches + 1, -1, np.intp)  # the last is of what shows nothing
        place[labels] = np.arange(len(labels))
        found = np.flatnonzero(place[:-1] >= 0)
        areas = np.array([self._areas[self._copy_of(label)] for label in found.tolist()], np.intp)
        many = areas > larger
        y, x = np.divmod(place[found[many]], width)
        return y, x, self.index[rows[y, 0], columns[0, x]], areas[many]

    def _join(self, touched: set[int]) -> None:
        """The next patch as part of the copy of those that it continues, if it does."""
        first = {self._copy_of(label) for label in touched}
        copy = min(first) if first else self.patches
        self._copies.append(copy)
        self._areas.append(0)
        for other in first - {copy}:
            self._copies[other] = copy
            self._areas[copy] += self._areas[other]
            self._areas[other] = 0

    def _copy_of(self, patch: int) -> int:
        """The first patch of the copy that a patch belongs to."""
        copies = self._copies
        while copies[patch] != patch:
            copies[patch] = patch = copies[copies[patch]]
        return patch
