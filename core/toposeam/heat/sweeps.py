"""The sweeps of :mod:`toposeam.heat.grid_flow`, over all bricks of a grid or over those that are awake."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from toposeam import _kernels
from toposeam.arrays import Floats, Floats32, Indices, Mask
from toposeam.heat.bricks import HIGH, LOW, Bricks, along

#: s: the temperature of the hot terminal, where that of the cold one is 0 and a difference of 1 fills a
#: conductor in one step.
HOT = np.float32(0.15)
#: τ Σ M; below 2/3 the sweeps converge.
_STEP_SIZE = np.float32(0.65)
#: Voxels, about, of the bricks that are swept at a time, so that they fit a processor's cache.
_BLOCK_VOXELS = 1 << 17
#: Least change of a temperature, as a share of s, that keeps its brick and those beside it awake.
_MOVED = 1e-6
FIRST, LAST = slice(1), slice(-1, None)


@dataclass(frozen=True, slots=True, eq=False)
class Merged:
    """Voxels that share one temperature, such as those that must not be divided."""

    #: (m,) flat index of each such voxel, and its group.
    voxel: Indices
    group: Indices


class Sweeps:
    """Bricks that are swept, with their temperatures and flows."""

    def __init__(
        self,
        at: Floats32,
        ahead: Floats32,
        rate: Floats32,
        filled: list[Floats32],
        cost: list[Floats32],
        lower: list[Indices],
        upper: list[Indices],
        groups: MergedMoves | None,
    ) -> None:
        self.at, self.ahead, self.rate = at, ahead, rate  #: ψ and ψ̄ in [0, s], τ
        self.filled, self.cost = filled, cost
        #: Per axis the neighbours of the bricks that are swept.
        self.lower, self.upper = lower, upper
        self.groups = groups
        self.count, self.side = len(lower[0]), at.shape[1:]
        #: The flow that leaves each brick through its upper end.
        self.leaving = [
            np.zeros((len(ahead), *(1 if k == axis else n for k, n in enumerate(self.side))), np.float32)
            for axis in range(len(self.side))
        ]
        self._step = max(1, _BLOCK_VOXELS // int(np.prod(self.side)))
        # All chunks share two arrays, which stay in the cache.
        self._scratch = np.empty((2, min(self._step, self.count), *self.side), np.float32)
        self._addresses = self._in_memory()

    def chunks(self) -> Iterator[slice]:
        """Yield the bricks that are swept, as many at a time as fit into the cache."""
        for start in range(0, self.count, self._step):
            yield slice(start, min(start + self._step, self.count))

    def set_rates(self, free: Mask) -> None:
        """Set τ = 0.65 / Σ M, and 0 where the temperature is fixed."""
        for here in self.chunks():
            total, cost = self._scratch[:, : here.stop - here.start]
            for axis, part in enumerate(self.cost):
                cost[...] = part[here]
                self._arrive(np.add, axis, here, cost, total)
            moves = free[here] & (total > 0)
            np.divide(_STEP_SIZE, total, out=self.rate[here], where=moves)

    def sweep(self) -> None:
        """Let the heat move on by one step."""
        if self._addresses:
            if _kernels.library.sweep_bricks(self.count, *self.side, HOT, *self._addresses):
                raise MemoryError
        else:
            self._sweep_chunks()
        if self.groups is not None:
            self.groups.move(self.filled, self.at, self.ahead)

    def _in_memory(self) -> list[int]:
        """Return where the arrays begin, for the kernel, as they are changed in place; none without one."""
        floats = [self.at, self.ahead, self.rate, *self.filled, *self.cost, *self.leaving]
        indices = [*self.lower, *self.upper]
        fit = all(
            array.dtype == kind and array.flags.c_contiguous
            for arrays, kind in ((floats, np.float32), (indices, np.int64))
            for array in arrays
        )
        if _kernels.library is None or len(self.side) != 3 or not fit:
            return []
        return [array.ctypes.data for array in (*floats[:9], *indices, *floats[9:])]

    def _sweep_chunks(self) -> None:
        """Do what the kernel does, on some bricks at a time."""
        for here in self.chunks():
            surplus, flow = self._scratch[:, : here.stop - here.start]
            for axis, (filled, cost) in enumerate(zip(self.filled, self.cost, strict=True)):
                self._rise(axis, here, flow)
                share = filled[here]
                share += flow
                np.clip(share, -1, 1, out=share)
                np.multiply(share, cost[here], out=flow)
                self._arrive(np.subtract, axis, here, flow, surplus)
            at, ahead = self.at[here], self.ahead[here]
            surplus *= self.rate[here]
            np.subtract(at, surplus, out=surplus)
            np.clip(surplus, 0, HOT, out=surplus)
            np.subtract(surplus, at, out=ahead)
            at[...] = surplus
            ahead += surplus

    def awake(self) -> npt.NDArray[np.bool_]:
        """Return the bricks in which the last sweep moved something, and those next to it, (n,) bool."""
        result = np.zeros(len(self.ahead), bool)
        for here in self.chunks():
            moved = np.abs(self.ahead[here] - self.at[here]) > _MOVED * HOT
            result[here] |= moved.any(axis=tuple(range(1, moved.ndim)))
            for axis, ends in enumerate(zip(self.lower, self.upper, strict=True)):
                for end, beyond in zip((FIRST, LAST), ends, strict=True):
                    at_end = moved[along(axis + 1, end)].any(axis=tuple(range(1, moved.ndim)))
                    result[beyond[here][at_end]] = True
        if self.groups is not None:
            result[self.groups.bricks] = True
        awake: npt.NDArray[np.bool_] = result[: self.count]
        return awake

    def surplus(self) -> Iterator[tuple[slice, Floats32]]:
        """Yield the net flow into every voxel, chunk by chunk."""
        for here in self.chunks():
            surplus, flow = self._scratch[:, : here.stop - here.start]
            for axis, (filled, cost) in enumerate(zip(self.filled, self.cost, strict=True)):
                np.multiply(filled[here], cost[here], out=flow)
                self._arrive(np.subtract, axis, here, flow, surplus)
            yield here, surplus

    def above(self, values: Floats32, axis: int, here: slice) -> Floats32:
        """Return the values of the next voxels along an axis."""
        own, result = values[here], np.empty((here.stop - here.start, *self.side), values.dtype)
        result[along(axis + 1, LOW)] = own[along(axis + 1, HIGH)]
        result[along(axis + 1, LAST)] = values[along(axis + 1, FIRST)][self.upper[axis][here]]
        return result

    def _rise(self, axis: int, here: slice, out: Floats32) -> None:
        """Compute Dψ̄, from every voxel to the next one along an axis."""
        own = self.ahead[here]
        if axis == len(self.side) - 1:
            # Short rows all at once; differences at the ends of rows are corrected below.
            row, difference = own.reshape(-1), out.reshape(-1)
            np.subtract(row[1:], row[:-1], out=difference[:-1])
        else:
            np.subtract(own[along(axis + 1, HIGH)], own[along(axis + 1, LOW)], out=out[along(axis + 1, LOW)])
        last = along(axis + 1, LAST)
        beyond = self.ahead[along(axis + 1, FIRST)][self.upper[axis][here]]
        np.subtract(beyond, own[last], out=out[last])

    def _arrive(self, leave: np.ufunc, axis: int, here: slice, flow: Floats32, surplus: Floats32) -> None:
        """Add the flow along an axis to the surplus of the voxels where it arrives.

        From the surplus of the voxels that it leaves it is taken (`leave` is subtract), or also added to it
        (add). The flow is overwritten.
        """
        first, last = along(axis + 1, FIRST), along(axis + 1, LAST)
        self.leaving[axis][here] = flow[last]
        entering = self.leaving[axis][self.lower[axis][here]]
        low, high = along(axis + 1, LOW), along(axis + 1, HIGH)
        if axis == 0:
            leave(flow[low], flow[high], out=surplus[high])
            leave(entering, flow[first], out=surplus[first])
            return
        leave(surplus, flow, out=surplus)
        if axis == len(self.side) - 1:
            flow[last] = 0
            beyond = surplus.reshape(-1)[1:]
            beyond += flow.reshape(-1)[:-1]
        else:
            surplus[high] += flow[low]
        surplus[first] += entering


class Part:
    """A copy of the bricks that are awake, with the temperatures and flows of resting bricks beside them."""

    def __init__(self, everything: Sweeps, awake: npt.NDArray[np.bool_]) -> None:
        self._own = np.flatnonzero(awake)
        n = len(awake)
        around = np.zeros(n + 1, bool)
        for beyond in (*everything.lower, *everything.upper):
            around[beyond[self._own]] = True
        around[:-1] &= ~awake
        around[-1] = True
        rows = np.concatenate([self._own, np.flatnonzero(around)])
        number = np.empty(n + 1, np.intp)
        number[rows] = np.arange(len(rows))
        self.sweeps = Sweeps(
            everything.at[self._own],
            everything.ahead[rows],
            everything.rate[self._own],
            [part[self._own] for part in everything.filled],
            [part[self._own] for part in everything.cost],
            [number[beyond[self._own]] for beyond in everything.lower],
            [number[beyond[self._own]] for beyond in everything.upper],
            None if everything.groups is None else everything.groups.renumbered(number),
        )
        for axis, leaving in enumerate(self.sweeps.leaving):
            last = along(axis + 1, LAST)
            leaving[...] = everything.filled[axis][last][rows] * everything.cost[axis][last][rows]

    def give_back(self, everything: Sweeps) -> None:
        """Copy the swept bricks back to their places."""
        everything.at[self._own] = self.sweeps.at
        everything.ahead[self._own] = self.sweeps.ahead[: len(self._own)]
        for all_of_them, part in zip(everything.filled, self.sweeps.filled, strict=True):
            all_of_them[self._own] = part


class MergedMoves:
    """The moves of voxels that share one temperature; places are flat indices into arrays of the bricks."""

    def __init__(self, voxel: Indices, group: Indices, size: int, faces: list[_Faces], rate: Floats) -> None:
        self.voxel, self.group, self._size = voxel, group, size
        self._faces, self._rate = faces, rate
        places = [voxel, *(face.place for face in faces)]
        #: Bricks that must be swept along.
        self.bricks = np.unique(np.concatenate(places) // size)

    @classmethod
    def posed(cls, merged: Merged | None, cost: Sequence[Floats32], bricks: Bricks) -> MergedMoves | None:
        """Build the groups of a grid that is cut into bricks; None without merged voxels."""
        if merged is None:
            return None
        count = int(merged.group.max()) + 1
        place = np.unravel_index(merged.voxel, bricks.shape)
        faces, total = [], np.zeros(count)
        for axis, part in enumerate(cost):
            for step, sign in ((-1, 1.0), (0, -1.0)):
                at = place[axis] + step
                inside = (at >= 0) & (at < part.shape[axis])
                owner = [(at if other == axis else index)[inside] for other, index in enumerate(place)]
                costs = part[tuple(owner)].astype(np.float64)
                joins = costs > 0
                costs, group = costs[joins], merged.group[inside][joins]
                total += np.bincount(group, costs, count)
                flat = np.ravel_multi_index(tuple(index[joins] for index in owner), bricks.shape)
                faces.append(_Faces(axis, bricks.flat_index(flat), group, sign * costs))
        rate = np.divide(_STEP_SIZE, total, out=np.zeros(count), where=total > 0)
        return cls(bricks.flat_index(merged.voxel), merged.group, int(np.prod(bricks.side)), faces, rate)

    def renumbered(self, number: Indices) -> MergedMoves:
        """Return the same groups where bricks have other numbers."""

        def moved(place: Indices) -> Indices:
            return number[place // self._size] * self._size + place % self._size

        faces = [face._replace(place=moved(face.place)) for face in self._faces]
        return MergedMoves(moved(self.voxel), self.group, self._size, faces, self._rate)

    def move(self, filled: Sequence[Floats32], at: Floats32, ahead: Floats32) -> None:
        """Let every group move on by one step."""
        surplus = self._surplus(filled)
        before = at.reshape(-1)[self.voxel]
        # All voxels of a group have one temperature; they may differ at the start, hence the mean.
        mean = np.bincount(self.group, before) / np.bincount(self.group)
        after = np.clip(mean - self._rate * surplus, 0, HOT)[self.group].astype(np.float32)
        at.reshape(-1)[self.voxel] = after
        ahead.reshape(-1)[self.voxel] = 2 * after - before

    def lost(self, filled: Sequence[Floats32]) -> float:
        """Sum the negative net flows into groups."""
        return float(np.minimum(self._surplus(filled), 0).sum())

    def _surplus(self, filled: Sequence[Floats32]) -> Floats:
        total = np.zeros(len(self._rate))
        for axis, place, group, cost in self._faces:
            total += np.bincount(group, filled[axis].reshape(-1)[place] * cost, len(total))
        return total


class _Faces(NamedTuple):
    """Conductors at one end of merged voxels."""

    axis: int
    place: Indices
    group: Indices
    cost: Floats  #: negative where the flow along the axis leaves the group
