"""Expansion moves of a shift-map at one stride (:mod:`toposeam.texture.holes.shift_map`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.images import Mask, box_of
from toposeam.seam.find import Method, method_options
from toposeam.seam.labels import MethodOptions, decided_by
from toposeam.seam.problem.overlap import FREE, TOUCHING, A, B, Overlap
from toposeam.seam.problem.seam_problem import SeamProblem
from toposeam.texture.canvas.progress import stage
from toposeam.texture.exemplar.atlas import Floats32, Ints32
from toposeam.texture.holes.expectation import Planes, gap_box
from toposeam.texture.holes.shift_candidates import Shifts

#: What the data term counts.
_DATA = 6.0
#: How far from a coarser seam, in coarser pixels, a finer one may run.
_BAND = 2
#: Least cost of an interface, so that no pixel is without connection.
_LEAST_LINK = 1e-6
#: A move has to lower the cost by this share of it.
_LEAST_GAIN = 1e-6

#: Where more pixels than this would be decided, counted once for each shift that may expand there, it is done
#: window by window, of this many rows and columns, and shifts expand only beyond their own edges.
_AT_ONCE, _SIDE = 1_000_000, 128

Ints = npt.NDArray[np.intp]
Part = tuple[slice, slice]
EVERYWHERE: Part = np.s_[:, :]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ground:
    """The picture that shifts copy from."""

    #: What is compared, anything in the hole; made again each time, as floats would take much memory.
    planes: Planes
    #: (H, W) bool: what has to go; what may be copied; where the picture has pixels.
    hole: Mask
    copied: Mask
    present: Mask
    #: (H, W) bool: the hole and the band round it, where shifts are chosen.
    near: Mask


class ShiftMoves:
    """Expansion moves at one stride.

    Parameters
    ----------
    ground : Ground
    shifts : (K, 2) int array
    box : (slice, slice)
        Rows and columns of the picture where shifts are chosen.
    stride : int
        How far apart, px, the pixels that stand for all are.
    expected, like : (h, w, F + 2), (H, W, F + 2) float32 arrays
        What the surroundings let expect in the box of what the picture lacks
        (:func:`toposeam.texture.holes.expectation.gap_box`), and what each pixel is like; the features first.
    """

    def __init__(
        self,
        ground: Ground,
        shifts: Shifts,
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
        self.weight = (np.float32(_DATA * stride / radius) * self.hole).astype(np.float32)
        self._like = like
        self.label = np.full(self.hole.shape, self.itself, np.intp)
        #: How far beyond their edges shifts expand; None for anywhere.
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

    def shown(self, label: Ints, dy: int = 0, dx: int = 0, part: Part = EVERYWHERE) -> Floats32:
        """Return what a labelling of a part of the region brings to each pixel's neighbour (dy, dx)."""
        return self._brought(self.features, label, part, dy, dx)

    def _brought(self, of: Floats32, label: Ints, part: Part, dy: int = 0, dx: int = 0) -> Floats32:
        """Return the values of a picture as large as the ground at the place that a labelling takes each
        pixel's neighbour from.
        """
        height, width = self.ground.hole.shape
        row = self.rows[part[0], np.newaxis] + self.shifts[label, 0] + dy * self.stride
        column = self.columns[part[1]] + self.shifts[label, 1] + dx * self.stride
        at = np.clip(row, 0, height - 1) * width + np.clip(column, 0, width - 1)
        found: Floats32 = of.reshape(height * width, -1).take(at, axis=0)
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

    def data(self, label: Ints, part: Part = EVERYWHERE) -> Floats32:
        """Return the data term of a labelling of a part of the region."""
        like = self._brought(self._like, label, part)
        cost: Floats32 = self.weight[part] * np.einsum("yxc->yx", np.abs(like - self.wanted[part]))
        cost[label == self.itself] = 0
        return cost

    def begin(self) -> None:
        """Give each pixel of the hole the shift whose data term is least there."""
        best = np.full(self.hole.shape, np.inf, np.float32)
        for index in range(self.itself):
            data = self.data(np.full(self.hole.shape, index, np.intp))
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

    def total(self, label: Ints, part: Part = EVERYWHERE) -> float:
        """Compute the cost of a labelling of a part of the region."""
        present = self.present[part]
        here = self.shown(label, part=part)
        cost = float(self.data(label, part).sum(dtype=float))
        for dy, dx, s, t in _NEIGHBOURS:
            ahead, behind = self.shown(label, dy, dx, part), self.shown(label, -dy, -dx, part)
            differs = (label[s] != label[t]) & present[s] & present[t]
            both = _norm(here[s], behind[t]) + _norm(ahead[s], here[t])
            cost += float(both[differs].sum(dtype=float))
        return cost

    def sweep(
        self, order: Iterable[int], most: int, method: Method, progress: Callable[[float], None] | None
    ) -> None:
        """Expand shift after shift until nothing gets better, in one window after another."""
        order, options = set(order), method_options(method, {})
        if np.count_nonzero(self.free) * len(order) <= _AT_ONCE:
            self._reach = None
        windows = list(self._windows())
        for number, window in enumerate(windows):
            tried = order if self._reach is None else set(np.unique(self.label[_grown(window)]).tolist())
            report = stage(progress, number / len(windows), 1 / len(windows))
            self._sweep(window, tried | {self.itself}, most, method, options, report)

    def _sweep(
        self,
        window: Part,
        active: set[int],
        most: int,
        method: Method,
        options: MethodOptions,
        progress: Callable[[float], None] | None,
    ) -> None:
        total = self.total(self.label[window], window)
        for number in range(most):
            gained: set[int] = set()
            before = total
            for done, index in enumerate(sorted(active, key=lambda one: (one != self.itself, one))):
                gain = self._expand(index, window, total, method, options)
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
        side = max(height, width) if self._reach is None else _SIDE
        for top in range(0, height, side):
            for left in range(0, width, side):
                window = slice(top, min(top + side, height)), slice(left, min(left + side, width))
                if self._reach is None or self.free[window].any():
                    yield window

    def _expand(
        self, index: int, window: Part, total: float, method: Method, options: MethodOptions
    ) -> float:
        """Compute by how much the cost falls when one shift expands in a window as is best; 0 where it does
        not.
        """
        around = _grown(window)
        own = self.label[around] == index
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
        rows, columns = (np.flatnonzero(free.any(axis=axis)) for axis in (1, 0))
        box = _grown((slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)))
        part = (
            slice(around[0].start + box[0].start, around[0].start + box[0].stop),
            slice(around[1].start + box[1].start, around[1].start + box[1].stop),
        )
        label, free, own = self.label[part], free[box], own[box]
        problem = self._problem(index, part, free, own)
        if not (problem.overlap.side == FREE).any():
            turned = problem.overlap.side == B
        else:
            turned = problem.complete(decided_by(problem, method, options)).astype(bool)
        new = np.where(turned[1:-1, 1:-1] & free, index, label)
        gain = self.total(label, part) - self.total(new, part)
        if gain <= _LEAST_GAIN * total:
            return 0.0
        self.label[part] = new
        return gain

    def _problem(self, index: int, part: Part, free: Mask, own: Mask) -> SeamProblem:
        """Pose the expansion move of a shift: ``b`` is the shift."""
        label = self.label[part]
        other = np.full(label.shape, index, np.intp)
        here, brought = self.shown(label, part=part), self.shown(other, part=part)
        turned = np.zeros(label.shape, np.float32)
        links = []
        for dy, dx, s, t in _NEIGHBOURS:
            ahead, behind = self.shown(label, dy, dx, part), self.shown(label, -dy, -dx, part)
            both = np.where(
                label[s] != label[t], _norm(here[s], behind[t]) + _norm(ahead[s], here[t]), np.float32(0)
            )
            turn_p = _norm(brought[s], behind[t]) + _norm(brought[t], here[t])
            turn_q = _norm(here[s], brought[s]) + _norm(ahead[s], brought[t])
            known = (free[s] | free[t]) & self.present[part][s] & self.present[part][t]
            turn_p[own[t]] = 0
            turn_q[own[s]] = 0
            both = np.minimum(both, turn_p + turn_q)
            link = np.maximum((turn_p + turn_q - both) / 2, np.float32(_LEAST_LINK))
            links.append(np.where(known, link, np.float32(0)))
            turned[s] += np.where(known & free[s], (turn_p - turn_q - both) / 2, np.float32(0))
            turned[t] += np.where(known & free[t], (turn_q - turn_p - both) / 2, np.float32(0))
        turned += np.where(free, self.data(other, part) - self.data(label, part), np.float32(0))
        side = np.full(label.shape, A, np.uint8)
        side[own], side[free] = B, FREE
        padded = np.pad(side, 1, constant_values=A)
        overlap = Overlap(padded, padded != A, (-1, -1), label.shape)
        right = np.pad(links[0], ((1, 1), (1, 1)))
        down = np.pad(links[1], ((1, 1), (1, 1)))
        problem = SeamProblem(
            overlap,
            right,
            down,
            showing_a=np.pad(np.maximum(-turned, 0), 1),
            showing_b=np.pad(np.maximum(turned, 0), 1),
        )
        return _decided(problem, label.shape)

    def spread(self) -> Ints32:
        """Return the labels of the box at full size: each stands for the pixels round it."""
        rows, columns = (
            (np.arange(side.start, side.stop) - (int(line[0]) - self.stride // 2)) // self.stride
            for side, line in zip(self.box, (self.rows, self.columns), strict=True)
        )
        result: Ints32 = self.label[np.ix_(rows, columns)].astype(np.int32)
        result[(result == self.itself) | ~self.ground.near[self.box]] = -1
        return result


_NEIGHBOURS = (
    (0, 1, np.s_[:, :-1], np.s_[:, 1:]),
    (1, 0, np.s_[:-1], np.s_[1:]),
)


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


def _norm(a: Floats32, b: Floats32) -> Floats32:
    apart = a - b
    result: Floats32 = np.einsum("yxc,yxc->yx", apart, apart)
    return np.sqrt(result, out=result)


def _decided(problem: SeamProblem, shape: tuple[int, int]) -> SeamProblem:
    """Return the problem without its margin of one pixel where it lies, and with those free pixels decided
    that nothing ties to one of the two sides.
    """
    component, count = ndimage.label(problem.overlap.side == FREE, TOUCHING)
    tied_a, tied_b = (
        np.bincount(component.ravel(), ties.ravel(), count + 1) > 0
        for ties in (problem.grid.cold, problem.grid.hot)
    )
    if tied_a[1:].all() and tied_b[1:].all():
        return problem
    side = problem.overlap.side.copy()
    side[(~tied_b)[component] & (component > 0)] = A
    side[(tied_b & ~tied_a)[component] & (component > 0)] = B
    overlap = Overlap(side, problem.overlap.shared, (-1, -1), shape)
    return SeamProblem(
        overlap,
        problem.right,
        problem.down,
        showing_a=problem.showing_a,
        showing_b=problem.showing_b,
    )
