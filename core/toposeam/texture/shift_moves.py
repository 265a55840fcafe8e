"""Expansion moves of a shift-map at one stride (:mod:`toposeam.texture.shifts`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.images import Mask
from toposeam.seam.find import Method, method_options, solve
from toposeam.seam.overlap import FREE, TOUCHING, A, B, Overlap
from toposeam.seam.problem import SeamProblem
from toposeam.texture.atlas import Floats32
from toposeam.texture.offsets import Shifts

#: What the data term counts.
_DATA = 6.0
#: How far from a coarser seam, in coarser pixels, a finer one may run.
_BAND = 2
#: Least cost of an interface, so that no pixel is without connection.
_LEAST_LINK = 1e-6
#: A move has to lower the cost by this share of it.
_LEAST_GAIN = 1e-6

Ints = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ground:
    """The picture that shifts copy from."""

    #: (H, W, F) float32, what is compared; anything in the hole.
    features: Floats32
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
    expected, like : (H, W, F + 1) float32 arrays
        What the surroundings let expect, and what each pixel is like.
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
        self.ground, self.stride = ground, stride
        self.shifts = np.concatenate(
            [shifts, np.zeros((1, 2), np.intp)]
        )  # the last one is the picture itself
        self.itself = len(shifts)
        half = stride // 2
        # One pixel beyond the box on every side, for the picture as it is there.
        self.rows = np.arange(box[0].start - stride + half, box[0].stop + stride, stride)
        self.columns = np.arange(box[1].start - stride + half, box[1].stop + stride, stride)
        height, width = ground.hole.shape
        inside = ((self.rows >= 0) & (self.rows < height))[:, np.newaxis] & (
            (self.columns >= 0) & (self.columns < width)
        )
        known = (ground.present & ~ground.hole).astype(np.float32)
        if stride > 1:
            share = ndimage.uniform_filter(known, stride)
            blurred = [
                ndimage.uniform_filter(plane * known, stride) / np.maximum(share, 1e-6)
                for plane in np.moveaxis(ground.features, 2, 0)
            ]
            self.features = np.stack(blurred, axis=2)
        else:
            self.features = np.where(known[..., np.newaxis] > 0, ground.features, 0)
        hole = ground.hole | ~ground.present
        self.features = np.where(hole[..., np.newaxis], expected[..., :-1], self.features).astype(np.float32)
        at = np.ix_(np.clip(self.rows, 0, height - 1), np.clip(self.columns, 0, width - 1))
        self.hole = ground.hole[at] & inside
        self.present = ground.present[at] & inside
        self.near = ground.near[at] & self.present
        self.free = self.near.copy()
        self.wanted = expected[at]
        distance = ndimage.distance_transform_edt(ground.hole)
        radius = max(float(distance.max()), 1.0)
        self.weight = (np.float32(_DATA * stride / radius) * self.hole).astype(np.float32)
        self._like = like
        self.label = np.full(self.hole.shape, self.itself, np.intp)
        self._known: dict[int, tuple[Mask, Floats32]] = {}

    def shown(
        self, label: Ints, dy: int = 0, dx: int = 0, part: tuple[slice, slice] = np.s_[:, :]
    ) -> Floats32:
        """What a labelling of a part of the region brings to each pixel's neighbour (dy, dx)."""
        height, width = self.ground.hole.shape
        row = self.rows[part[0], np.newaxis] + self.shifts[label, 0] + dy * self.stride
        column = self.columns[part[1]] + self.shifts[label, 1] + dx * self.stride
        found: Floats32 = self.features[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
        return found

    def brings(self, index: int) -> tuple[Mask, Floats32]:
        """Of one shift: where it is allowed, and its data term."""
        if index not in self._known:
            ground = self.ground
            height, width = ground.hole.shape
            row, column = self.rows + self.shifts[index, 0], self.columns + self.shifts[index, 1]
            inside = ((row >= 0) & (row < height))[:, np.newaxis] & ((column >= 0) & (column < width))
            at = np.ix_(np.clip(row, 0, height - 1), np.clip(column, 0, width - 1))
            if index == self.itself:
                allowed = self.present & ~self.hole
                data = np.zeros(allowed.shape, np.float32)
            else:
                allowed = ground.copied[at] & inside & self.near
                data = self.weight * np.abs(self._like[at] - self.wanted).sum(axis=2)
            self._known[index] = allowed, data
        return self._known[index]

    def begin(self) -> None:
        """Each pixel of the hole gets the shift whose data term is least there."""
        best = np.full(self.hole.shape, np.inf, np.float32)
        for index in range(self.itself):
            allowed, data = self.brings(index)
            better = self.hole & allowed & (data < best)
            best[better], self.label[better] = data[better], index

    def refine(self, label: Ints, coarser: int) -> None:
        """Start from a coarser stride's labels; only near its seams anything is decided again."""
        height, width = label.shape
        at = np.ix_(np.clip(self.rows, 0, height - 1), np.clip(self.columns, 0, width - 1))
        found = label[at]
        self.label = np.where((found < 0) | ~self.near, self.itself, found)
        wrong = self.hole & (self.label == self.itself)
        for index in np.unique(self.label).tolist():
            wrong |= (self.label == index) & ~self.brings(index)[0] & self.near
        self._repair(wrong & self.hole)
        self.label[wrong & ~self.hole] = self.itself
        seam = np.zeros(self.label.shape, bool)
        for axis in (0, 1):
            differs = np.diff(self.label, axis=axis) != 0
            seam |= np.pad(differs, [(0, 1) if a == axis else (0, 0) for a in (0, 1)])
            seam |= np.pad(differs, [(1, 0) if a == axis else (0, 0) for a in (0, 1)])
        reach = max(1, _BAND * coarser // self.stride)
        self.free = self.near & ndimage.binary_dilation(seam | wrong, iterations=reach)

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
            here = self.brings(index)[0] & wrong
            far = ndimage.distance_transform_edt(~(usable & (self.label == index))) if usable.any() else wrong
            distance[k] = np.where(here[wrong], np.asarray(far, float)[wrong], np.inf)
        best = order[distance.argmin(axis=0)]
        found = np.isfinite(distance.min(axis=0))
        values = self.label[wrong]
        values[found] = best[found]
        self.label[wrong] = values
        left[wrong] = ~found
        for index in range(self.itself):
            here = left & self.brings(index)[0]
            self.label[here] = index
            left &= ~here

    def total(self, label: Ints) -> float:
        """What a labelling costs."""
        cost = self._data(label)
        for dy, dx, s, t in _NEIGHBOURS:
            ahead, here = self.shown(label, dy, dx), self.shown(label)
            behind = self.shown(label, -dy, -dx)
            differs = (label[s] != label[t]) & self.present[s] & self.present[t]
            cost += float((_norm(here[s], behind[t]) + _norm(ahead[s], here[t]))[differs].sum())
        return cost

    def _data(self, label: Ints) -> float:
        cost = 0.0
        for index in np.unique(label).tolist():
            cost += float(self.brings(index)[1][label == index].sum())
        return cost

    def sweep(
        self, order: Iterable[int], most: int, method: Method, progress: Callable[[float], None] | None
    ) -> None:
        """Expand shift after shift until nothing gets better."""
        total, options = self.total(self.label), method_options(method, {})
        active = set(order) | {self.itself}
        for number in range(most):
            gained: set[int] = set()
            before = total
            for done, index in enumerate(sorted(active, key=lambda one: (one != self.itself, one))):
                new = self._expanded(index, method, options)
                if new is not None:
                    cost = self.total(new)
                    if cost < total * (1 - _LEAST_GAIN):
                        self.label, total = new, cost
                        gained.add(index)
                if progress is not None:
                    progress((number + (done + 1) / len(active)) / most)
            if not gained or total > 0.995 * before:
                break
            # Shifts that show, and a few that nearly did, are worth another try.
            active = set(np.unique(self.label).tolist()) | gained | {self.itself}

    def _expanded(self, index: int, method: Method, options: object) -> Ints | None:
        """The labelling after one shift has expanded as is best."""
        allowed = self.brings(index)[0]
        own = self.label == index
        free = self.free & allowed & ~own
        if not free.any():
            return None
        rows, columns = (np.flatnonzero(free.any(axis=axis)) for axis in (1, 0))
        part = np.s_[
            max(int(rows[0]) - 1, 0) : int(rows[-1]) + 2, max(int(columns[0]) - 1, 0) : int(columns[-1]) + 2
        ]
        problem = self._problem(index, part, free[part], own[part])
        if not (problem.overlap.side == FREE).any():
            turned = problem.overlap.side == B
        else:
            turned = problem.complete(solve(problem, method, options).labels).astype(bool)  # type: ignore[arg-type]
        turned = turned[1:-1, 1:-1]
        new = self.label.copy()
        new[part] = np.where(turned & free[part], index, self.label[part])
        return new

    def _problem(self, index: int, part: tuple[slice, slice], free: Mask, own: Mask) -> SeamProblem:
        """Whether to let a shift show more of itself: ``b`` is the shift."""
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
        turned += np.where(free, self.brings(index)[1][part] - self._shown_data(part), np.float32(0))
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

    def _shown_data(self, part: tuple[slice, slice]) -> Floats32:
        label = self.label[part]
        data = np.zeros(label.shape, np.float32)
        for index in np.unique(label).tolist():
            here = label == index
            data[here] = self.brings(index)[1][part][here]
        return data

    def spread(self, before: Ints) -> Ints:
        """The labels at full size: each stands for the pixels round it."""
        stride = self.stride
        result = np.full(before.shape, -1, np.intp)
        height, width = before.shape
        rows = np.repeat(np.arange(len(self.rows)), stride)
        columns = np.repeat(np.arange(len(self.columns)), stride)
        top, left = int(self.rows[0]) - stride // 2, int(self.columns[0]) - stride // 2
        y, x = top + np.arange(len(rows)), left + np.arange(len(columns))
        on_y, on_x = (y >= 0) & (y < height), (x >= 0) & (x < width)
        result[np.ix_(y[on_y], x[on_x])] = self.label[np.ix_(rows[on_y], columns[on_x])]
        result[(result == self.itself) | ~self.ground.near] = -1
        return result


_NEIGHBOURS = (
    (0, 1, np.s_[:, :-1], np.s_[:, 1:]),
    (1, 0, np.s_[:-1], np.s_[1:]),
)


def _norm(a: Floats32, b: Floats32) -> Floats32:
    result: Floats32 = np.sqrt(np.square(a - b).sum(axis=2))
    return result


def _decided(problem: SeamProblem, shape: tuple[int, int]) -> SeamProblem:
    """The problem without its margin of one pixel where it lies, and with those free pixels decided that
    nothing ties to one of the two sides.
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
