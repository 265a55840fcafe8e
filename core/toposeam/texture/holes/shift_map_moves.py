"""Expansion moves of a shift-map at one stride (:mod:`toposeam.texture.holes.shift_map`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats, Floats32, Indices, Ints32, Mask
from toposeam.images import box_of
from toposeam.seam.cut_solver import CutSolver
from toposeam.seam.exact.expansion import Decide, ExpansionMove, interfaces_beside
from toposeam.seam.find import Method
from toposeam.texture.canvas.progress import stage
from toposeam.texture.holes.expectation import Planes, gap_box

#: Weight of the data term against the seams.
_DATA_WEIGHT = 6.0
#: Cost of a pixel on a line whose shift does not lay the line on itself; an interface from white to black
#: costs 1.
_BROKEN_LINE = 4.0
#: Largest distance between a finer seam and the coarser one, in coarser pixels.
_BAND = 2
#: Largest number of decisions, pixels times shifts, of a whole region. Above it the region is decided window
#: by window, and shifts expand only beyond their own edges.
_MOST_DECISIONS = 1_000_000
#: Height and width of these windows, px.
_WINDOW = 128

Part = tuple[slice, slice]
EVERYWHERE: Part = np.s_[:, :]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ground:
    """The picture that shifts copy from."""

    #: Features that are compared, anything in the hole; made anew each time, as floats would take much
    #: memory.
    planes: Planes
    #: (H, W) bool: what has to go; what may be copied; where the picture has pixels.
    hole: Mask
    copied: Mask
    present: Mask
    #: (H, W) bool: the hole and the band round it, where shifts are chosen.
    near: Mask
    #: (H, W) int32, the number of the line that crosses the hole at each pixel, 0 for none; and
    #: (K, lines + 1) bool, whether a shift lays it on itself. None where no line crosses the hole.
    lines: Ints32 | None = None
    keeps: Mask | None = None


class ShiftMoves:
    """Expansion moves at one stride.

    Parameters
    ----------
    ground : Ground
    shifts : (K, 2) int array
    box : (slice, slice)
        Rows and columns of the picture where shifts are chosen.
    stride : int
        Distance, px, between the pixels that stand for all.
    expected, like : (h, w, F + 2), (H, W, F + 2) float32 arrays
        Features expected from the surroundings in the box of the picture's gaps
        (:func:`toposeam.texture.holes.expectation.gap_box`), and those of each pixel.
    """

    def __init__(
        self,
        ground: Ground,
        shifts: Indices,
        box: tuple[slice, slice],
        stride: int,
        expected: Floats32,
        like: Floats32,
    ) -> None:
        self.ground, self.stride, self.box = ground, stride, box
        # The last one is the picture itself.
        self.shifts = np.concatenate([shifts, np.zeros((1, 2), np.intp)])
        self.itself = len(shifts)
        half = stride // 2
        # One pixel beyond the box on every side, for the picture as it is there.
        self.rows = np.arange(box[0].start - stride + half, box[0].stop + stride, stride)
        self.columns = np.arange(box[1].start - stride + half, box[1].stop + stride, stride)
        height, width = ground.hole.shape
        inside = ((self.rows >= 0) & (self.rows < height))[:, np.newaxis] & (
            (self.columns >= 0) & (self.columns < width)
        )
        gaps = ground.hole | ~ground.present
        within = gap_box(gaps)
        features = np.empty((height, width, expected.shape[2] - 2), np.float32)
        _average(ground.planes(), ~gaps, stride, out=features)
        filled = gaps[within][..., np.newaxis]
        np.copyto(features[within], expected[..., : features.shape[2]], where=filled)
        self.features = features
        at = self._at(EVERYWHERE, (height, width))
        self.hole = ground.hole[at] & inside
        self.present = ground.present[at] & inside
        self.near = ground.near[at] & self.present
        self.free = self.near.copy()
        self.wanted = expected[self._at(within, expected.shape)]
        deepest = ndimage.distance_transform_edt(ground.hole[box_of(ground.hole, 1)]).max()
        radius = max(float(deepest), 1.0)
        self.weight = (np.float32(_DATA_WEIGHT * stride / radius) * self.hole).astype(np.float32)
        self._like = like
        self._lines = None if ground.lines is None else ground.lines[at]
        #: (K, lines + 1) cost of a pixel on a line by its shift.
        self._broken = None if ground.keeps is None else np.float32(_BROKEN_LINE) * ~ground.keeps
        self.label = np.full(self.hole.shape, self.itself, np.intp)
        #: Distance beyond their edges within which shifts expand; None for anywhere.
        self._reach: int | None = None

    def _at(self, box: tuple[slice, slice], shape: tuple[int, ...]) -> tuple[npt.NDArray[np.intp], ...]:
        """Return the index that reads the region in an array that covers a box of the picture; what lies
        beyond is as its border.
        """
        rows, columns = (
            np.clip(line - (side.start or 0), 0, length - 1)
            for line, side, length in zip((self.rows, self.columns), box, shape, strict=False)
        )
        return np.ix_(rows, columns)

    def _brought(self, of: Floats32, label: Indices, rows: Indices, columns: Indices) -> Floats32:
        """Return the values of a picture as large as the ground at the place that a labelling takes pixels
        from; rows and columns are those of the region, and all three broadcast.
        """
        height, width = self.ground.hole.shape
        row = np.clip(self.rows[rows] + self.shifts[label, 0], 0, height - 1)
        column = np.clip(self.columns[columns] + self.shifts[label, 1], 0, width - 1)
        found: Floats32 = of.reshape(height * width, -1).take(row * width + column, axis=0)
        return found

    def allows(self, index: int, part: Part = EVERYWHERE) -> Mask:
        """Return the mask of a part of the region where one shift may show."""
        if index == self.itself:
            beyond: Mask = self.present[part] & ~self.hole[part]
            return beyond
        height, width = self.ground.hole.shape
        row, column = (
            self.rows[part[0]] + self.shifts[index, 0],
            self.columns[part[1]] + self.shifts[index, 1],
        )
        inside = ((row >= 0) & (row < height))[:, np.newaxis] & ((column >= 0) & (column < width))
        at = np.ix_(np.clip(row, 0, height - 1), np.clip(column, 0, width - 1))
        allowed: Mask = self.ground.copied[at] & inside & self.near[part]
        return allowed

    def _data(self, label: Indices, rows: Indices, columns: Indices) -> Floats32:
        """Return the data term of a labelling of some pixels."""
        apart = np.abs(self._brought(self._like, label, rows, columns) - self.wanted[rows, columns])
        cost: Floats32 = self.weight[rows, columns] * np.einsum("...c->...", apart)
        if self._lines is not None and self._broken is not None:
            lines = self._lines[rows, columns]
            # On a line its surroundings do not tell what is expected.
            broken = self._broken[np.minimum(label, self.itself - 1), lines]
            np.copyto(cost, broken, where=lines > 0)
        cost[label == self.itself] = 0
        return cost

    def _paid(self, i: Indices, j: Indices, *ends: tuple[Indices, Indices]) -> Floats:
        """Return what interfaces cost, given by rows and columns of their two ends, that show i and j."""
        total = np.zeros(len(i))
        for pixels in ends:
            apart = self._brought(self.features, i, *pixels) - self._brought(self.features, j, *pixels)
            total += np.sqrt(np.einsum("ec,ec->e", apart, apart))
        return total

    def begin(self) -> None:
        """Give each pixel of the hole the shift whose data term is least there."""
        best = np.full(self.hole.shape, np.inf, np.float32)
        rows, columns = np.ogrid[: best.shape[0], : best.shape[1]]
        for index in range(self.itself):
            data = self._data(np.full(self.hole.shape, index, np.intp), rows, columns)
            better = self.hole & self.allows(index) & (data < best)
            best[better], self.label[better] = data[better], index

    def refine(self, label: Ints32, coarser: int) -> None:
        """Start from a coarser stride's labels; only near its seams anything is decided again."""
        found = label[self._at(self.box, label.shape)]
        self.label = np.where((found < 0) | ~self.near, self.itself, found).astype(np.intp)
        wrong = self.hole & (self.label == self.itself)
        for index in np.unique(self.label).tolist():
            wrong |= (self.label == index) & ~self.allows(index) & self.near
        self._repair(wrong & self.hole)
        self.label[wrong & ~self.hole] = self.itself
        seam = np.zeros(self.label.shape, bool)
        for axis in (0, 1):
            differs = np.diff(self.label, axis=axis) != 0
            seam |= np.pad(differs, [(0, 1) if a == axis else (0, 0) for a in (0, 1)])
            seam |= np.pad(differs, [(1, 0) if a == axis else (0, 0) for a in (0, 1)])
        reach = max(1, _BAND * coarser // self.stride)
        self.free = self.near & ndimage.binary_dilation(seam | wrong, iterations=reach)
        self._reach = reach

    def _repair(self, wrong: Mask) -> None:
        """Give pixels whose shift is not allowed there the nearest one that is."""
        if not wrong.any():
            return
        left = wrong.copy()
        usable = ~wrong & self.hole
        order = np.unique(self.label[usable]) if usable.any() else np.arange(self.itself)
        distance = np.full((len(order), int(wrong.sum())), np.inf)
        for k, index in enumerate(order.tolist()):
            if index == self.itself:
                continue
            here = self.allows(index) & wrong
            far = ndimage.distance_transform_edt(~(usable & (self.label == index))) if usable.any() else wrong
            distance[k] = np.where(here[wrong], np.asarray(far, float)[wrong], np.inf)
        best = order[distance.argmin(axis=0)]
        found = np.isfinite(distance.min(axis=0))
        values = self.label[wrong]
        values[found] = best[found]
        self.label[wrong] = values
        left[wrong] = ~found
        for index in range(self.itself):
            here = left & self.allows(index)
            self.label[here] = index
            left &= ~here

    def total(self, label: Indices, part: Part = EVERYWHERE) -> float:
        """Compute the cost of a labelling of a part of the region."""
        label, hole = label.ravel(), np.flatnonzero(self.hole[part])
        p, q = interfaces_beside(self.present[part], self.present[part])
        seam = np.flatnonzero(label[p] != label[q])
        p, q = p[seam], q[seam]
        paid = self._paid(label[p], label[q], self._places(p, part), self._places(q, part))
        return float(self._data(label[hole], *self._places(hole, part)).sum(dtype=float) + paid.sum())

    def _places(self, pixels: Indices, part: Part) -> tuple[Indices, Indices]:
        """Return rows and columns of the region of pixels, given by flat indices in a part of it."""
        row, column = np.divmod(pixels, self.hole[part].shape[1])
        return row + (part[0].start or 0), column + (part[1].start or 0)

    def sweep(
        self, order: Iterable[int], most: int, method: Method, progress: Callable[[float], None] | None
    ) -> None:
        """Expand shift after shift until nothing gets better, in one window after another."""
        order, decide = set(order), CutSolver.of(method, {})
        if np.count_nonzero(self.free) * len(order) <= _MOST_DECISIONS:
            self._reach = None
        windows = list(self._windows())
        for number, window in enumerate(windows):
            tried = order if self._reach is None else set(np.unique(self.label[_grown(window)]).tolist())
            report = stage(progress, number / len(windows), 1 / len(windows))
            self._sweep(window, tried | {self.itself}, most, decide, report)

    def _sweep(
        self,
        window: Part,
        active: set[int],
        most: int,
        decide: Decide,
        progress: Callable[[float], None] | None,
    ) -> None:
        total = self.total(self.label[window], window)
        for number in range(most):
            gained: set[int] = set()
            before = total
            for done, index in enumerate(sorted(active, key=lambda one: (one != self.itself, one))):
                gain = self._expand(index, window, decide)
                if gain:
                    total -= gain
                    gained.add(index)
                if progress is not None:
                    progress((number + (done + 1) / len(active)) / most)
            if not gained or total > 0.995 * before:
                break
            # Shifts that show, and a few that nearly did, are worth another try.
            active = set(np.unique(self.label[window]).tolist()) | gained | {self.itself}

    def _windows(self) -> Iterator[Part]:
        """Yield the whole region, or windows of it that have something to decide, where that is much."""
        height, width = self.label.shape
        side = max(height, width) if self._reach is None else _WINDOW
        for top in range(0, height, side):
            for left in range(0, width, side):
                window = slice(top, min(top + side, height)), slice(left, min(left + side, width))
                if self._reach is None or self.free[window].any():
                    yield window

    def _expand(self, index: int, window: Part, decide: Decide) -> float:
        """Let one shift expand in a window as is best; by how much the cost falls."""
        around = _grown(window)
        label = self.label[around]
        own = label == index
        free = np.zeros(own.shape, bool)
        inside = np.s_[
            window[0].start - around[0].start : window[0].stop - around[0].start,
            window[1].start - around[1].start : window[1].stop - around[1].start,
        ]
        free[inside] = self.free[window] & self.allows(index, window)
        free &= ~own
        if self._reach is not None:
            free &= ndimage.binary_dilation(own, iterations=self._reach)
        if not free.any():
            return 0.0

        def paid(i: Indices, j: Indices, chosen: Any) -> Floats:
            return self._paid(i, j, *(self._places(end[chosen], around) for end in ends))

        ends, shows = interfaces_beside(free, self.present[around]), label.ravel()
        nodes = np.flatnonzero(free)
        places = self._places(nodes, around)
        costs = self._data(shows[nodes], *places), self._data(np.full(len(nodes), index), *places)
        turned = np.where(free.ravel(), index, shows)
        piece = ndimage.label(free)[0].ravel()
        move = ExpansionMove(piece, own.shape[1], ends, shows, turned, paid, costs)
        pixels, gain = move.gaining(move.turned(decide))
        self.label[self._places(pixels, around)] = index
        return gain

    def spread(self) -> Ints32:
        """Return the labels of the box at full size: each stands for the pixels round it."""
        rows, columns = (
            (np.arange(side.start, side.stop) - (int(line[0]) - self.stride // 2)) // self.stride
            for side, line in zip(self.box, (self.rows, self.columns), strict=True)
        )
        result: Ints32 = self.label[np.ix_(rows, columns)].astype(np.int32)
        result[(result == self.itself) | ~self.ground.near[self.box]] = -1
        return result


def _grown(part: Part) -> Part:
    """Return a part with one more pixel on every side; slices end by themselves."""
    rows, columns = (slice(max(side.start - 1, 0), side.stop + 1) for side in part)
    return rows, columns


def _average(planes: Iterable[Floats32], known: Mask, stride: int, out: Floats32) -> None:
    """Compute the mean of what is known in the square round each pixel, (H, W, F); 0 where nothing is."""
    for number, plane in enumerate(planes):
        out[..., number] = plane
    out *= known[..., np.newaxis]
    if stride == 1:
        return
    share = known.astype(np.float32)
    ndimage.uniform_filter(share, stride, output=share)
    np.maximum(share, np.float32(1e-6), out=share)
    for found in np.moveaxis(out, 2, 0):
        ndimage.uniform_filter(found, stride, output=found)
        found /= share
