"""Recurrences of a clip: pairs of moments between which a jump shows little."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats32, Mask
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.volume.heat.method import SurfaceOptions, heat_surface
from toposeam.volume.problem.posing import surface_problem
from toposeam.volume.problem.surface_problem import SurfaceProblem

#: Number of the best pairs for which a surface is found on small frames, to compare its cost.
_FINALISTS = 8
#: Of longer loops than these shares of all lengths so many more are joined.
_LONGER, _LONGER_FINALISTS = (1 / 3, 2 / 3), 2
#: Of loops whose cost exceeds the least by at most one of these shares, the longest is tried, in this order.
_EXTRA_COST = (0.5, 0.1, 0.0)
#: Cost of loops, as a multiple of the least, up to which longer ones are offered.
_OFFERED_COST = 2.0
#: Number of moments up to which all are compared, and of jumps of longer clips that are refined.
_MOST_MOMENTS, _REFINED = 2000, 60


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

    def later(self, frames: int) -> Jump:
        """Return the jump as of a clip that begins so many frames earlier."""
        return replace(self, leaves=self.leaves + frames, enters=self.enters + frames)


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


def likely_jumps(
    small: Floats32,
    transition: int,
    lengths: tuple[int, int],
    starts: tuple[int, int],
    moving: Mask,
    cost: MatchCost,
    spacing: Sequence[float],
) -> tuple[list[Jump], list[Jump]]:
    """Find jumps back by which a clip repeats with little visible change, in the order in which to try them.

    First come the longest that cost little more than the cheapest, in the end the cheapest. Also returns
    longer ones, the longest first, that cost at most twice as much as the cheapest.

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
    found = _all_jumps(small, transition, lengths, starts, moving)
    distance = max(1, transition // 4)
    finalists = dict.fromkeys(_distinct(found, _FINALISTS, distance))
    for share in _LONGER:
        longer = lengths[0] + share * (lengths[1] - lengths[0])
        some = [jump for jump in found if jump.period > longer]
        finalists |= dict.fromkeys(_distinct(some, _LONGER_FINALISTS, distance))
    joined = [with_surface_cost(small, jump, transition, moving, cost, spacing) for jump in finalists]
    least = min(jump.cost for jump in joined)
    order = [
        max((jump for jump in joined if jump.cost <= (1 + extra) * least), key=lambda jump: jump.period)
        for extra in _EXTRA_COST
    ]
    dear = [jump for jump in joined if jump.cost <= _OFFERED_COST * least]
    return list(dict.fromkeys(order)), sorted(dear, key=lambda jump: -jump.period)


def _all_jumps(
    small: Floats32, transition: int, lengths: tuple[int, int], starts: tuple[int, int], moving: Mask
) -> list[Jump]:
    """Estimate the costs of all jumps back; of long clips of those between some moments, the best refined."""
    thin = -(-len(small) // _MOST_MOMENTS)
    if thin > 1:
        few = _all_jumps(
            small[::thin],
            max(2, transition // thin),
            (-(-lengths[0] // thin), max(-(-lengths[0] // thin), lengths[1] // thin - 1)),
            (-(-starts[0] // thin), max(-(-starts[0] // thin), starts[1] // thin)),
            moving,
        )
        near = _distinct(few, _REFINED, 1)
        longest = sorted(near, key=lambda jump: -jump.period)
        return [
            best
            for jump in dict.fromkeys([*near, *longest])
            if (best := _nearby(small, jump, thin, transition, lengths, starts, moving)) is not None
        ]
    found: list[Jump] = []
    for period in range(lengths[0], lengths[1] + 1):
        scores = jump_costs(small, period, transition, moving)[starts[0] : starts[1] + 1]
        found += [
            Jump(starts[0] + at + period, starts[0] + at, float(score)) for at, score in enumerate(scores)
        ]
    return found


def _nearby(
    small: Floats32,
    jump: Jump,
    thin: int,
    transition: int,
    lengths: tuple[int, int],
    starts: tuple[int, int],
    moving: Mask,
) -> Jump | None:
    """Find the cheapest jump near one between every `thin`-th frame; None if none is allowed."""
    best: Jump | None = None
    for enters in range(thin * (jump.enters - 1), thin * (jump.enters + 1) + 1):
        for leaves in range(thin * (jump.leaves - 1), thin * (jump.leaves + 1) + 1):
            fits = lengths[0] <= leaves - enters <= lengths[1] and starts[0] <= enters <= starts[1]
            if not fits or enters < 0 or leaves + transition > len(small):
                continue
            apart = small[leaves : leaves + transition] - small[enters : enters + transition]
            difference = np.linalg.norm(apart, axis=3)[:, moving]
            score = float((difference[1:] + difference[:-1]).min(axis=0).mean(dtype=np.float64))
            if best is None or score < best.cost:
                best = Jump(leaves, enters, score)
    return best


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
