"""Rounds of moves in windows round the places where three layers or more meet."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Protocol, Self

import numpy as np

from toposeam.heat.threads import one_thread
from toposeam.images import Mask
from toposeam.layers.choices import Choices
from toposeam.layers.deciding import Deciding
from toposeam.layers.junctions import junctions
from toposeam.layers.labelling import Labelling
from toposeam.layers.layer import Box
from toposeam.layers.painting import LabelMap
from toposeam.layers.progressed import Progressed
from toposeam.layers.receding import settle
from toposeam.layers.tasks import Executor, in_bundles, on_boxes, results

#: How far the windows reach round places where three layers meet, px; how many are handed on at once.
_WINDOW, _HANDED = 24, 4
#: Windows run into each other where such places are many. Where layers recede they are looked at alone, with
#: those that are so near, px, rather than in windows of more pixels than this.
_NEAR, _WHOLE_WINDOW = 4, 1 << 15
#: Rounds of expansions at most before layers recede.
_MOST = 100


class Meeting(Protocol):
    """What knows the problem: :class:`toposeam.layers.rounds.Rounds`."""

    labelling: Labelling
    label_map: LabelMap
    steps: Progressed
    near: Mask | None
    decide: Deciding

    def part(self, box: Box) -> Self:
        """The same as far as a box of the canvas is concerned."""
        ...


def meet_all(rounds: Meeting, most: int, executor: Executor | None) -> None:
    """Expansions, so many rounds at most, of what is open in windows round all places where layers meet."""
    canvas = rounds.labelling.canvas
    windows = [window.shared(canvas) for window in junctions(rounds.label_map, _WINDOW)]
    handed = in_bundles(windows, 1 if executor is None else _HANDED)
    items = ([(rounds.part(w) if executor else rounds, w, most) for w in some] for some in handed)
    for window, labels in zip(windows, chain.from_iterable(results(executor, _met, items)), strict=True):
        rounds.steps.one()
        if labels is not None:
            rounds.label_map[window.slices] = labels


def settle_all(rounds: Meeting, executor: Executor | None) -> None:
    """Expansions and receding layers in such windows, whatever is open, until nothing gains any more.

    Costs that are reduced leave crumbs of layers and detours there, which no expansion undoes.
    """
    windows = [window.shared(rounds.labelling.canvas) for window in _settled_windows(rounds.label_map)]
    for k, labels in on_boxes(executor, _settled, lambda k: (rounds.part(windows[k]), windows[k]), windows):
        rounds.steps.one()
        rounds.label_map[windows[k].slices] = labels


def _settled_windows(label_map: LabelMap) -> Iterator[Box]:
    for window in junctions(label_map, _WINDOW):
        inside = window.shared(Box(0, 0, *label_map.shape))
        height, width = inside.shape
        if height * width <= _WHOLE_WINDOW:
            yield inside
        else:
            for near in junctions(label_map[inside.slices], _NEAR):
                yield near.grown(_WINDOW - _NEAR).moved(inside.top, inside.left)


def _choices(rounds: Meeting, window: Box, near: Mask | None, layers: Sequence[int]) -> Choices:
    """What may change in a window, all but its rim."""
    labelling = rounds.labelling
    open_ = np.zeros(window.shape, bool)
    open_[1:-1, 1:-1] = True if near is None else near[window.slices][1:-1, 1:-1]
    planes = [labelling.allowed_in(k, window) & open_ for k in layers]
    return Choices(labelling, window, rounds.label_map[window.slices], planes, layers)


def _met(items: Sequence[tuple[Meeting, Box, int]]) -> list[LabelMap | None]:
    """What rounds in some windows end with; None where none gains."""
    found: list[LabelMap | None] = []
    with one_thread():
        for rounds, window, most in items:
            layers = [int(k) for k in np.unique(rounds.label_map[window.slices]) if k >= 0]
            choices = _choices(rounds, window, rounds.near, layers)
            found.append(choices.label_map() if choices.run(rounds.decide.exactly, most) else None)
    return found


def _settled(item: tuple[Meeting, Box]) -> LabelMap:
    rounds, window = item
    places = rounds.labelling.places
    layers = [k for k, place in enumerate(places) if all(place.shared(window).shape)]
    layers.sort(key=lambda k: places[k])
    with one_thread():
        choices = _choices(rounds, window, None, layers)
        choices.run(rounds.decide.exactly, _MOST)
        settle(choices, rounds.decide.exactly, range(len(layers)), 0.0)
    return choices.label_map()
