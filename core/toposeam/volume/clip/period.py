"""Recurrences of a clip: pairs of moments between which a jump shows little."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats32, Mask, Volume
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.volume.heat.method import SurfaceOptions, heat_surface
from toposeam.volume.problem.arrays import as_shares
from toposeam.volume.problem.posing import surface_problem
from toposeam.volume.problem.surface_problem import SurfaceProblem

#: Size of the small frames on which moments are compared, px, about.
_PIXELS = 1500
#: Largest number of values compared, frames² × px, which reduces the frames of long clips further.
_MAX_COMPARED = 4e8
#: Number of the best pairs for which a surface is found on small frames, to compare its cost.
_FINALISTS = 8
#: Of loops whose cost exceeds the least by at most this share, the longest is taken.
_COST_TOLERANCE = 0.1


@dataclass(frozen=True, slots=True)
class Jump:
    """A jump from one moment of a clip to another.

    Examples
    --------
    >>> import toposeam as ts
    >>> ts.volume.Jump(leaves=30, enters=6, cost=0.5).period
    24
    """

    #: First frames of the two stretches that overlap: each pixel leaves the clip in one of `leaves`,
    #: ``leaves + 1`` …, and goes on in `enters`, ``enters + 1`` …
    leaves: int
    enters: int
    #: Cost of the jump per pixel, on small frames.
    cost: float

    @property
    def period(self) -> int:
        """Number of frames that repeat if this is the only jump."""
        return self.leaves - self.enters


def small_frames(frames: Volume, data_range: float | None, pixels: float = _PIXELS) -> Floats32:
    """Reduce frames to (T, h, w, C) float32 by means over squares of pixels."""
    height, width = frames.shape[1:3]
    pixels = min(pixels, max(100.0, _MAX_COMPARED / len(frames) ** 2))
    side = max(1, int(np.ceil(np.sqrt(height * width / pixels))))
    side = min(side, height, width)
    rows, columns = height // side, width // side
    result = np.empty((len(frames), rows, columns, frames.shape[3]), np.float32)
    for index in range(len(frames)):
        shares = as_shares(frames[index : index + 1], "frames", data_range)[0]
        squares = shares[: rows * side, : columns * side].reshape(rows, side, columns, side, -1)
        result[index] = squares.mean(axis=(1, 3))
    return result


def small_mask(mask: Mask, shape: tuple[int, int]) -> Mask:
    """Reduce a mask to small frames: True where more than half of a square is."""
    side = mask.shape[0] // shape[0]
    squares = mask[: shape[0] * side, : shape[1] * side].reshape(shape[0], side, shape[1], side)
    most: Mask = squares.mean(axis=(1, 3)) > 0.5
    return most


def jump_costs(small: Floats32, lag: int, transition: int, moving: Mask) -> npt.NDArray[np.float64]:
    """Estimate the cost of a jump from ``t + lag`` to ``t``, or from ``t`` to ``t + lag``, for every ``t``.

    Within the transition each pixel changes when it shows least: its cost is the least sum of two successive
    differences, which is a surface's cost along time. The result is the mean over the moving pixels.

    Returns
    -------
    (T - lag - transition + 1,) float64 array
    """
    difference = np.linalg.norm(small[lag:] - small[: len(small) - lag], axis=3)[:, moving]
    pairs = difference[1:] + difference[:-1]
    count = len(pairs) - (transition - 1) + 1
    if count <= 0:
        return np.zeros(0)
    least = ndimage.minimum_filter1d(pairs, transition - 1, axis=0, origin=-((transition - 1) // 2))[:count]
    scores: npt.NDArray[np.float64] = least.mean(axis=1, dtype=np.float64)
    return scores


def best_jump(
    small: Floats32,
    transition: int,
    lengths: tuple[int, int],
    starts: tuple[int, int],
    moving: Mask,
    cost: MatchCost,
    spacing: Sequence[float],
) -> Jump:
    """Find the jump back by which a clip repeats with the least visible change.

    Parameters
    ----------
    small : (T, h, w, C) float32 array
    transition : int
        Number of frames of the transition.
    lengths, starts : (int, int)
        Least and greatest allowed period and first frame; at least one pair must fit the clip.
    moving : (h, w) bool array
        Pixels that count.
    cost : MatchCost
    spacing : three floats
        As for :func:`toposeam.volume.clip.loop.loop`.
    """
    found: list[Jump] = []
    for period in range(lengths[0], lengths[1] + 1):
        scores = jump_costs(small, period, transition, moving)[starts[0] : starts[1] + 1]
        found += [
            Jump(starts[0] + at + period, starts[0] + at, float(score)) for at, score in enumerate(scores)
        ]
    finalists = _distinct(found, _FINALISTS, max(1, transition // 4))
    joined = [with_surface_cost(small, jump, transition, moving, cost, spacing) for jump in finalists]
    least = min(jump.cost for jump in joined)
    return max(
        (jump for jump in joined if jump.cost <= (1 + _COST_TOLERANCE) * least), key=lambda jump: jump.period
    )


def with_surface_cost(
    small: Floats32, jump: Jump, transition: int, moving: Mask, cost: MatchCost, spacing: Sequence[float]
) -> Jump:
    """Return a jump with the cost per pixel of its surface on small frames."""
    problem, labels = small_surface(small, jump, transition, moving, cost, spacing)
    least = problem.cost(labels) / int(np.count_nonzero(moving))
    return Jump(jump.leaves, jump.enters, least)


def small_surface(
    small: Floats32, jump: Jump, transition: int, moving: Mask, cost: MatchCost, spacing: Sequence[float]
) -> tuple[SurfaceProblem, Mask]:
    """Find a jump's surface on small frames; return the problem and the labels."""
    a = small[jump.leaves : jump.leaves + transition]
    b = small[jump.enters : jump.enters + transition]
    problem, _ = surface_problem(
        a,
        b,
        None,
        None,
        0,
        cost,
        spacing,
        np.broadcast_to(moving_weights(moving), a.shape[:3]),
        data_range=1.0,
    )
    solution, _ = heat_surface(problem, SurfaceOptions(tolerance=0.02, max_iterations=600))
    return problem, solution.labels


def moving_weights(moving: Mask) -> npt.NDArray[np.float64]:
    """Return the weights of pixels for a surface: 1 on moving ones, 0.001 on still ones."""
    return np.where(moving, 1.0, 1e-3)


def _distinct(jumps: list[Jump], count: int, distance: int) -> list[Jump]:
    """Select the `count` best jumps that differ by at least `distance` frames in a moment."""
    kept: list[Jump] = []
    for jump in sorted(jumps, key=lambda jump: (jump.cost, -jump.period)):
        near = (
            max(abs(jump.leaves - other.leaves), abs(jump.enters - other.enters)) < distance for other in kept
        )
        if not any(near):
            kept.append(jump)
            if len(kept) == count:
                break
    return kept


def good_jumps(
    small: Floats32, transition: int, moving: Mask, cost: MatchCost, spacing: Sequence[float], count: int
) -> list[Jump]:
    """Find jumps back and forth of low cost, the cheapest first."""
    found: list[Jump] = []
    for lag in range(transition, len(small) - transition + 1):
        for at, score in enumerate(jump_costs(small, lag, transition, moving)):
            found += [Jump(at + lag, at, float(score)), Jump(at, at + lag, float(score))]
    back = [jump for jump in found if jump.period > 0]
    forth = [jump for jump in found if jump.period < 0]
    picked = [*_distinct(back, count, transition), *_distinct(forth, count // 2, transition)]
    joined = [with_surface_cost(small, jump, transition, moving, cost, spacing) for jump in picked]
    return sorted(joined, key=lambda jump: jump.cost)
