"""Expansions from several starts.

The layers lie on top of each other in the order of their places, each time with another one at the bottom.
After one round of each, the cheapest two go on, and the others only if these do not end alike. Wherever
another end costs less than the cheapest one, it is taken over.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toposeam.arrays import Labels, Mask
from toposeam.layers.canvas.layer import Box
from toposeam.layers.execution.progress import Progressed
from toposeam.layers.search.expansion_moves import Choices
from toposeam.layers.search.options import SearchOptions
from toposeam.seam.exact.expansion import Decide

#: The best two starts end alike when their costs differ by less than this share: then no other goes on.
_AGREED = 1e-4


def best_of_starts(
    choices: Choices,
    allowed: Sequence[Mask],
    boxes: Sequence[Box],
    decide: Decide,
    most: int,
    options: SearchOptions,
    steps: Progressed,
) -> int:
    """Let the choices show the best of what several starts end in; the number of rounds.

    Parameters
    ----------
    choices : Choices
    allowed : sequence of (h, w) bool arrays
        Where each layer may show.
    boxes : sequence of Box
        Where each layer lies.
    decide : callable
    most : int
        Rounds at most.
    options : SearchOptions
        How many starts there are.
    steps : Progressed
    """
    places = sorted(range(len(boxes)), key=lambda k: boxes[k])
    count = min(len(places), options.starts)
    bottoms = (len(places) * k // count for k in range(count))
    starts = [laid_on_top(allowed, places[k:] + places[:k]) for k in bottoms]
    number, ends = _one_by_one(choices, starts, places, decide, most, steps)
    ends.sort(key=lambda end: end[:2])
    choices.shows = ends[0][2]
    for _, _, other in ends[1:]:
        choices.fuse(other)
    if choices.shows is not ends[0][2]:  # the mixture of several ends may not be an end itself
        number += choices.run(decide, most - number, places)
    return number


def _one_by_one(
    choices: Choices,
    starts: Sequence[Labels],
    places: Sequence[int],
    decide: Decide,
    most: int,
    steps: Progressed,
) -> tuple[int, list[tuple[float, int, Labels]]]:
    """The number of rounds, and of each start the cost of its end, its number, and the end."""
    ends: list[tuple[float, int, Labels]] = []
    for choices.shows in starts:
        choices.run(decide, 1, places)
        steps.one()
        ends.append((choices.total(), len(ends), choices.shows))
    ends.sort(key=lambda end: end[:2])
    number = 1
    for place, (_, _, choices.shows) in enumerate(ends):
        if place == 2 and abs(ends[0][0] - ends[1][0]) <= _AGREED * ends[0][0]:
            break
        number = max(number, 1 + choices.run(decide, most - 1, places))
        ends[place] = choices.total(), place, choices.shows
        steps.one()
    return number, ends


def join(choices: Choices, allowed: Sequence[Mask], order: Sequence[int], decide: Decide) -> None:
    """Lay the layers one after another, each joined along the best seam to those before it."""
    choices.shows = np.full(choices.shows.shape, len(allowed), np.int16)
    for k in order:
        choices.lay(k, allowed[k].ravel())
        choices.expand(k, decide)


def laid_on_top(allowed: Sequence[Mask], order: Sequence[int]) -> Labels:
    """(h w,) int16, the last layer of an order that is allowed; as many as there are where none is."""
    shows = np.full(allowed[0].size, len(allowed), np.int16)
    for k in order:
        shows[allowed[k].ravel()] = k
    return shows
