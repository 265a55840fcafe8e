"""Expansions from several initial labellings.

The layers are stacked in the order of their places, each time with another one at the bottom. After one round
of expansions from each start, the cheapest two go on to their ends; the others follow only if these two ends
differ in cost. In each patch of pixels where another end is cheaper than the best one, it is taken over.
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

#: Relative difference of cost below which the ends of the best two starts count as equal, so that no other
#: start is continued.
_EQUAL_COST = 1e-4


def best_of_starts(
    choices: Choices,
    allowed: Sequence[Mask],
    boxes: Sequence[Box],
    decide: Decide,
    most: int,
    options: SearchOptions,
    steps: Progressed,
) -> int:
    """Expand from several starts and combine the ends; return the number of rounds.

    Parameters
    ----------
    choices : Choices
    allowed : sequence of (h, w) bool arrays
        Per layer, True where it may show.
    boxes : sequence of Box
        The box of the canvas that each layer fills.
    decide : callable
    most : int
        Largest number of rounds.
    options : SearchOptions
        Hold the number of starts.
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
    if choices.shows is not ends[0][2]:  # a mixture of ends may allow more expansions
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
    """Expand from each start; return the number of rounds, and (cost, number, labels) of each end."""
    ends: list[tuple[float, int, Labels]] = []
    for choices.shows in starts:
        choices.run(decide, 1, places)
        steps.one()
        ends.append((choices.total(), len(ends), choices.shows))
    ends.sort(key=lambda end: end[:2])
    number = 1
    for place, (_, _, choices.shows) in enumerate(ends):
        if place == 2 and abs(ends[0][0] - ends[1][0]) <= _EQUAL_COST * ends[0][0]:
            break
        number = max(number, 1 + choices.run(decide, most - 1, places))
        ends[place] = choices.total(), place, choices.shows
        steps.one()
    return number, ends


def join(choices: Choices, allowed: Sequence[Mask], order: Sequence[int], decide: Decide) -> None:
    """Lay the layers one after another, each joined to those before it along the cheapest seam."""
    choices.shows = np.full(choices.shows.shape, len(allowed), np.int16)
    for k in order:
        choices.lay(k, allowed[k].ravel())
        choices.expand(k, decide)


def laid_on_top(allowed: Sequence[Mask], order: Sequence[int]) -> Labels:
    """(h w,) int16: the last layer of an order that is allowed; the number of layers where none is."""
    shows = np.full(allowed[0].size, len(allowed), np.int16)
    for k in order:
        shows[allowed[k].ravel()] = k
    return shows
