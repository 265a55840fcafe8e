"""Rounds of expansions from several starts.

The layers lie on top of each other, by rows and by columns of where they are, from either end, and in large
problems are joined one after another in the given order and the opposite one. In small ones layers recede
instead (:mod:`toposeam.layers.receding`), and the order in which they are given does not matter. On few
pixels all starts are stacked and taken to their ends together, because what a small network costs is mostly
what it costs to pose it. On more pixels, after one round of each, the cheapest two go on, and the others
where these do not end alike. Wherever another end costs less than the cheapest one its patch is taken over.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toposeam.images import Mask
from toposeam.layers.choices import Choices
from toposeam.layers.deciding import Decide
from toposeam.layers.layer import Box
from toposeam.layers.painting import LabelMap
from toposeam.layers.progressed import Progressed

#: Starts of up to so many pixels altogether are stacked.
_STACKED = 30_000
#: The best two starts end alike when their costs differ by less than this share: then no other goes on.
_AGREED = 1e-4


def best_of_starts(
    choices: Choices,
    allowed: Sequence[Mask],
    boxes: Sequence[Box],
    order: Sequence[int] | None,
    decide: Decide,
    most: int,
    steps: Progressed,
) -> tuple[int, list[int]]:
    """Let the choices show the best of what several starts end in, none of them joined where no order is
    given; how many rounds that took, and the layers in the order of their places.
    """
    count = len(boxes)
    places = sorted(range(count), key=lambda k: boxes[k])
    across = sorted(range(count), key=lambda k: boxes[k][1::-1])
    piled = dict.fromkeys(map(tuple, (places, places[::-1], across, across[::-1])))
    starts = [laid_on_top(allowed, start) for start in piled]
    for one_way in () if order is None else (order, order[::-1]):
        joined(choices, allowed, one_way, decide, steps)
        starts.append(choices.shows)
    if int(choices.several.sum()) * len(starts) <= _STACKED:
        stack = choices.stacked(starts)
        number = stack.run(decide, most, places)
        ends: list[tuple[float, int, LabelMap]] = []
        for choices.shows in stack.parts(len(starts)):
            ends.append((choices.total(), len(ends), choices.shows))
            steps.one()
    else:
        number, ends = _one_by_one(choices, starts, places, decide, most, steps)
    ends.sort(key=lambda end: end[:2])
    choices.shows = ends[0][2]
    for _, _, other in ends[1:]:
        choices.fuse(other)
    return number, places


def _one_by_one(
    choices: Choices,
    starts: Sequence[LabelMap],
    places: Sequence[int],
    decide: Decide,
    most: int,
    steps: Progressed,
) -> tuple[int, list[tuple[float, int, LabelMap]]]:
    """How many rounds were made, and of each start what its end costs, a number, and the end."""
    ends: list[tuple[float, int, LabelMap]] = []
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


def joined(
    choices: Choices, allowed: Sequence[Mask], order: Sequence[int], decide: Decide, steps: Progressed
) -> None:
    """Lay the layers one after another, each joined to what is there along the best seam."""
    choices.shows = np.full(choices.shows.shape, len(allowed), np.int16)
    for k in order:
        choices.lay(k, allowed[k].ravel())
        choices.expand(k, decide)
        steps.one()


def laid_on_top(allowed: Sequence[Mask], order: Sequence[int]) -> LabelMap:
    """(h w,) int16, the last layer of an order that is allowed; as many as there are where none is."""
    shows = np.full(allowed[0].size, len(allowed), np.int16)
    for k in order:
        shows[allowed[k].ravel()] = k
    return shows
