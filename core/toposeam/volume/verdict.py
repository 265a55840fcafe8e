"""Verdict on the surface of joined stacks: which slice shows it, and where."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from toposeam.arrays import Floats32, Mask
from toposeam.seam.result.verdict import STEP_REACH, steps_beside
from toposeam.volume.problem.canvas import Places

#: Slices across each axis that are judged at most.
_MOST_SLICES = 12
#: Reads a box of the canvas: (d, h, w, C) float32 shares of white of a stack and (d, h, w) bool where it has
#: voxels; by "a" or "b".
Reader = Callable[[tuple[slice, ...], str], tuple[Floats32, Mask]]


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceVerdict:
    """How visibly slices of a joined volume show its surface.

    Examples
    --------
    >>> str(SurfaceVerdict(step=0.4)), str(SurfaceVerdict(step=2.5, where=(12, 30, 40)))
    ('no visible surface', 'look at 40,30 of slice 12')
    """

    #: The largest step of brightness, hue or grain across the surface: 1 is just seen.
    step: float
    #: (z, y, x) on the canvas, voxels: the middle of its piece.
    where: tuple[int, int, int] | None = None

    @property
    def unseen(self) -> bool:
        """True if the surface will probably not be noticed in any slice."""
        return self.step <= 1

    def moved(self, by: Iterable[int]) -> SurfaceVerdict:
        """Return the verdict with its place moved by z, y, x, voxels."""
        if self.where is None:
            return self
        z, y, x = (int(one + step) for one, step in zip(self.where, by, strict=True))
        return replace(self, where=(z, y, x))

    def __str__(self) -> str:
        if self.unseen or self.where is None:
            return "no visible surface"
        z, y, x = self.where
        return f"look at {x},{y} of slice {z}"


def surface_verdict(places: Places, labels: Any, read: Reader) -> SurfaceVerdict:
    """Judge the surface between two stacks by slices across all three axes.

    Each is judged as the seam of two pictures (:func:`toposeam.seam.result.verdict.steps_beside`).

    Parameters
    ----------
    places : Places
    labels : (d, h, w) bool array, or dask array
        Where the second stack shows in the common box.
    read : callable
        Reads both stacks.
    """
    worst = SurfaceVerdict(step=0.0)
    for axis in range(3):
        for index in _chosen(labels, axis):
            box = [
                slice(max(0, part.start - STEP_REACH), min(side, part.stop + STEP_REACH))
                for part, side in zip(places.overlap, places.canvas, strict=True)
            ]
            box[axis] = slice(places.overlap[axis].start + index, places.overlap[axis].start + index + 1)
            pictures, covers = zip(*(read(tuple(box), which) for which in ("a", "b")), strict=True)
            common = tuple(
                slice(max(0, part.start - own.start), part.stop - own.start) if k != axis else slice(0, 1)
                for k, (part, own) in enumerate(zip(places.overlap, box, strict=True))
            )
            other = covers[1] & ~covers[0]
            other[common] = np.asarray(labels[_at(axis, index)]).reshape(other[common].shape)
            shown = np.where(other[..., np.newaxis], pictures[1], pictures[0])
            sides = covers[0] & ~other, covers[1] & other
            flat = [each.squeeze(axis) for each in (shown, *pictures, *covers, *sides)]
            steps = steps_beside(flat[0], flat[1:3], flat[3:5], flat[5:], 1.0)
            if len(steps) and steps[:, 2].max() > worst.step:
                x, y, step = steps[int(np.argmax(steps[:, 2]))]
                at = np.insert([y, x], axis, 0) + [part.start for part in box]
                worst = SurfaceVerdict(step=float(step), where=tuple(np.rint(at).astype(int).tolist()))
    return worst


def _chosen(labels: Any, axis: int) -> list[int]:
    """Choose slices of the common box across an axis that the surface crosses, evenly."""
    others = tuple(one for one in range(3) if one != axis)
    share = np.asarray(labels.mean(axis=others))
    crossed = np.flatnonzero((share > 0) & (share < 1))
    picked = np.linspace(0, len(crossed) - 1, min(_MOST_SLICES, len(crossed)))
    return [int(crossed[round(one)]) for one in picked]


def _at(axis: int, index: int) -> tuple[slice, ...]:
    return tuple(slice(index, index + 1) if k == axis else slice(None) for k in range(3))
