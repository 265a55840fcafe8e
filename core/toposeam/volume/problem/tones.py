"""Black, white and gain of two stacks, from what both show of their common box.

Cameras write 12 bits into 16, with an offset, and light fades between two stacks. Black is what is darkest in
each, as the mean over a few voxels, which noise does not reach; white is the brightest thousandth. The gain
of the second stack is a smooth field: its logarithm is linear along z, y and x of the box, fitted to the
means over cubes, of which some may show what has moved (iterated weights of Cauchy).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import numpy as np

from toposeam.arrays import Floats, Floats32, Volume
from toposeam.images import in_dtype
from toposeam.volume.problem.canvas import Places

_Which = Literal["a", "b"]
#: Side of the cubes that are read, in voxels, and their largest number along each axis.
_CUBE, _CUBES = 32, 4
#: Side of the small cubes whose means stand for black, in voxels.
_SMALL = 4
#: Percentiles of these means, and of voxels, that are black and white.
_BLACK, _WHITE = 2.0, 99.9
#: Largest gain, or 1 ÷ it; change of a gain's logarithm that halves the weight of a cube; rounds of weights.
_LARGEST_GAIN, _SCATTER, _ROUNDS = 20.0, 0.1, 10
_BOTH: tuple[_Which, _Which] = ("a", "b")
#: Weight, as a share of that of all cubes, by which slopes of the gain are kept small.
_RIDGE = 0.01


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tones:
    """What makes the voxels of two stacks comparable."""

    #: (C,): value of black in each stack.
    black_a: Floats
    black_b: Floats
    #: Difference between white and black in the first stack.
    white: float
    #: (4, C): logarithm of the gain in the middle of the box, and its change from there to the box's end
    #: along z, y and x. Beyond the box the gain is that of its border.
    log_gain: Floats
    #: The common box on the canvas.
    box: tuple[slice, ...]

    @property
    def gain(self) -> float:
        """Light of the second stack as a multiple of the first one's, in the mean."""
        return float(np.exp(-self.log_gain[0].mean()))

    def shares(self, values: Volume, which: _Which, start: Sequence[int]) -> Floats32:
        """Return (D, H, W, C) voxels as shares of white: 0 is black, and both stacks are equally bright.

        Parameters
        ----------
        values : (D, H, W, C) array
        which : {"a", "b"}
            The stack that they are of.
        start : three int
            Index of the first of them on the canvas.
        """
        shares = values.astype(np.float32)
        shares -= (self.black_a if which == "a" else self.black_b).astype(np.float32)
        if which == "b":
            shares *= self._gains(start, values.shape[:3])
        shares /= np.float32(self.white)
        return shares

    def evened(self, values: Volume, start: Sequence[int]) -> Volume:
        """Return voxels of the second stack with black and gain of the first one, in their dtype."""
        made = values.astype(np.float64)
        made -= self.black_b
        made *= self._gains(start, values.shape[:3])
        made += self.black_a
        return in_dtype(made, values.dtype)

    def _gains(self, start: Sequence[int], shape: Sequence[int]) -> Floats32:
        """Return the gain at voxels of the canvas, (D, H, W, C) or broadcast to it."""
        result: Floats32 = np.exp(self.log_gain[0]).astype(np.float32)
        for axis, slope in enumerate(self.log_gain[1:]):
            at = _along_box(start[axis] + np.arange(shape[axis], dtype=float), self.box[axis])
            line = np.exp(at[:, np.newaxis] * slope).astype(np.float32)
            result = result * line.reshape([-1 if place == axis else 1 for place in range(3)] + [len(slope)])
        return result


def tones_of(a: Any, b: Any, places: Places, white: float | None = None, present: Any = None) -> Tones:
    """Find black, white and gain of two stacks.

    Parameters
    ----------
    a, b : (D, H, W, C) arrays, or dask arrays
        Of large ones some cubes are read.
    places : Places
    white : float, optional
        Difference between white and black, if it is known.
    present : (D, H, W) array of bool, optional
        Where the first stack has voxels; cubes that lack some are left out.
    """
    cubes = list(_cubes(places.overlap))
    if present is not None:
        full = [cube for cube in cubes if np.asarray(present[places.inside(cube, "a")]).all()]
        cubes = full or cubes
    pairs = [
        [np.asarray(stack[places.inside(cube, which)], np.float64) for stack, which in ((a, "a"), (b, "b"))]
        for cube in cubes
    ]
    black_a, black_b = (
        np.percentile(np.concatenate([_small_means(pair[which]) for pair in pairs]), _BLACK, axis=0)
        for which in (0, 1)
    )
    bright_a, bright_b = (
        np.stack([pair[which].mean(axis=(0, 1, 2)) for pair in pairs]) - black
        for which, black in ((0, black_a), (1, black_b))
    )
    middles = np.array(
        [
            [
                _along_box(np.array((part.start + part.stop - 1) / 2), whole)
                for part, whole in zip(cube, places.overlap, strict=True)
            ]
            for cube in cubes
        ]
    )
    log_gain = np.stack(
        [_fitted(middles, one, other) for one, other in zip(bright_a.T, bright_b.T, strict=True)], axis=1
    )
    tones = Tones(black_a=black_a, black_b=black_b, white=white or 1.0, log_gain=log_gain, box=places.overlap)
    if white is None:
        shown = [
            tones.shares(values, which, [part.start for part in cube])
            for cube, pair in zip(cubes, pairs, strict=True)
            for values, which in zip(pair, _BOTH, strict=True)
        ]
        found = float(np.percentile(np.concatenate([values.ravel() for values in shown]), _WHITE))
        tones = Tones(
            black_a=black_a,
            black_b=black_b,
            white=found if np.isfinite(found) and found > 0 else 1.0,
            log_gain=log_gain,
            box=places.overlap,
        )
    return tones


def _cubes(box: tuple[slice, ...]) -> Any:
    """Yield boxes that are spread over a box."""
    lines = []
    for part in box:
        length = part.stop - part.start
        side, count = min(_CUBE, length), min(_CUBES, -(-length // _CUBE))
        starts = part.start + np.linspace(0, length - side, count).round().astype(int)
        lines.append([slice(int(start), int(start) + side) for start in starts])
    return product(*lines)


def _small_means(values: Floats) -> Floats:
    """Return the means over small cubes, (N, C)."""
    sides = [min(_SMALL, length) for length in values.shape[:3]]
    depth, height, width = (length // side for length, side in zip(values.shape[:3], sides, strict=True))
    inner = values[: depth * sides[0], : height * sides[1], : width * sides[2]]
    parts = inner.reshape(depth, sides[0], height, sides[1], width, sides[2], -1)
    means: Floats = parts.mean(axis=(1, 3, 5)).reshape(-1, values.shape[3])
    return means


def _along_box(at: Floats, part: slice) -> Floats:
    """Return places on the canvas as -1 at the box's first voxel to 1 at its last one; no further."""
    middle, half = (part.start + part.stop - 1) / 2, max((part.stop - part.start - 1) / 2, 0.5)
    along: Floats = np.clip((at - middle) / half, -1, 1)
    return along


def _fitted(middles: Floats, one: Floats, other: Floats) -> Floats:
    """Fit the logarithm of the gain to the brightness, above black, of cubes."""
    least = 1e-3 * max(float(one.max(initial=0)), float(other.max(initial=0)))
    usable = (one > least) & (other > least) & np.isfinite(one + other)
    result = np.zeros(4)
    if not usable.any():
        return result
    ratio = np.clip(np.log(one[usable] / other[usable]), *np.log([1 / _LARGEST_GAIN, _LARGEST_GAIN]))
    trust = np.sqrt(one[usable] * other[usable])
    terms = np.column_stack([np.ones(len(ratio)), middles[usable]])
    ridge = np.diag([0.0, 1.0, 1.0, 1.0]) * _RIDGE
    weights = trust / trust.sum()
    result[0] = np.average(ratio, weights=weights)
    for _ in range(_ROUNDS):
        weights = trust / (1 + np.square((ratio - terms @ result) / _SCATTER))
        weights /= weights.sum()
        result = np.linalg.solve(
            terms.T @ (weights[:, np.newaxis] * terms) + ridge, terms.T @ (weights * ratio)
        )
    return result
