"""Walks through a short clip: orders of stretches, each joined to the next by a jump."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toposeam.volume.clip.period import Jump

#: Largest cost of a jump in a walk, as a multiple of the least.
_MAX_COST_RATIO = 2.0


def closed_walk(jumps: Sequence[Jump], transition: int, frames: int, rng: np.random.Generator) -> list[Jump]:
    """Draw a closed walk of jumps that plays at least `frames` frames.

    After a jump the clip plays from ``enters``, until a jump whose ``leaves`` lies at least a transition
    later. The last jump is followed by the first. Rarely taken jumps are preferred, and cheap ones of these.

    Parameters
    ----------
    jumps : sequence of Jump
        At least one must jump back: ``period >= transition``.
    transition, frames : int
    rng : numpy.random.Generator

    Examples
    --------
    >>> walk = closed_walk([Jump(20, 0, 1.0), Jump(30, 4, 1.2)], 4, 60, np.random.default_rng(0))
    >>> walk_length(walk) >= 60
    True
    """
    least = min(jump.cost for jump in jumps)
    usable = [jump for jump in jumps if jump.cost <= _MAX_COST_RATIO * least + 1e-9]
    home = next((jump for jump in usable if jump.period >= transition), None)
    if home is None:
        home = next(jump for jump in jumps if jump.period >= transition)
        usable.append(home)
    usable = _leading_to(home, usable, transition)
    taken = dict.fromkeys(range(len(usable)), 0)
    walk, seen = [home], 0  # frames seen between the first jump and the last one
    taken[usable.index(home)] += 1
    while True:
        at = walk[-1].enters + transition
        if seen + walk[0].leaves - walk[-1].enters >= frames and walk[0].leaves >= at:
            return walk
        ahead = [index for index, jump in enumerate(usable) if jump.leaves >= at]
        wanted = np.array(
            [
                min(usable[index].cost / (least + 1e-9), _MAX_COST_RATIO + 1) + 2 * taken[index]
                for index in ahead
            ]
        )
        chance = np.exp(wanted.min() - wanted)
        index = ahead[int(rng.choice(len(ahead), p=chance / chance.sum()))]
        taken[index] += 1
        seen += usable[index].leaves - walk[-1].enters
        walk.append(usable[index])


def walk_length(walk: Sequence[Jump]) -> int:
    """Count the frames of a closed walk."""
    return sum(after.leaves - jump.enters for jump, after in zip(walk, [*walk[1:], walk[0]], strict=True))


def _leading_to(home: Jump, jumps: Sequence[Jump], transition: int) -> list[Jump]:
    """Return the jumps after which the jump `home` can still be reached; others would never end the walk."""
    leading = {home}
    while True:
        reach = (
            max(jump.leaves for jump in leading) - transition
        )  # jumps that enter up to here reach one of them
        more = {jump for jump in jumps if jump.enters <= reach} - leading
        if not more:
            return [jump for jump in jumps if jump in leading]
        leading |= more
