"""Regions of two layers divided anew, here or in another process, by methods that know no bands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
import numpy.typing as npt

from toposeam.layers.band import write_pixels
from toposeam.layers.dividing import Pixels, Potential
from toposeam.layers.labelling import Labelling, Pair
from toposeam.layers.layer import Box
from toposeam.layers.painting import LabelMap
from toposeam.layers.progressed import Progressed
from toposeam.layers.tasks import Executor, on_boxes
from toposeam.seam.solution import Solution


class Dividing(Protocol):
    """What divides regions: :class:`toposeam.layers.rounds.Rounds`."""

    labelling: Labelling
    label_map: LabelMap
    steps: Progressed
    solved: dict[Pair, tuple[Box, Solution]]
    undecided: dict[tuple[int, ...], Pixels]
    potentials: dict[Pair, Potential]
    seconds: dict[Pair, float]

    def swap(self, pair: Pair) -> None:
        """Divide the region of two layers anew."""

    def part(self, box: Box) -> Self:
        """The same as far as a box of the canvas is concerned."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Swapped:
    """What came of it in a part of the canvas."""

    #: Pixels that change, and what shows there.
    pixels: Pixels
    values: npt.NDArray[np.int16]
    solved: tuple[Box, Solution]
    undecided: Pixels | None
    seconds: float


def swap_all(rounds: Dividing, pairs: Sequence[Pair], executor: Executor | None) -> None:
    """Divide the regions of some pairs anew, at once those that do not touch."""
    boxes = [rounds.labelling.costs[pair].box for pair in pairs]

    if executor is None:
        for _ in on_boxes(None, rounds.swap, lambda k: pairs[k], boxes):
            pass
        return

    def item(k: int) -> tuple[Dividing, Pair]:
        return rounds.part(boxes[k]), pairs[k]

    for k, found in on_boxes(executor, swapped, item, boxes):
        rounds.steps.one()
        if found is not None:
            _take(rounds, pairs[k], found)


def _take(rounds: Dividing, pair: Pair, found: Swapped) -> None:
    rounds.potentials.pop(pair, None)
    rounds.seconds[pair] = rounds.seconds.get(pair, 0.0) + found.seconds
    rounds.solved[pair] = found.solved
    if found.undecided is not None:
        rounds.undecided[pair] = found.undecided
    write_pixels(rounds.label_map, *found.pixels, found.values)


def swapped(item: tuple[Dividing, Pair]) -> Swapped | None:
    """The region of two layers divided anew in a part that nobody else has; None where there is nothing to
    decide.
    """
    rounds, pair = item
    inside = rounds.labelling.costs[pair].box.shared(rounds.labelling.canvas)
    before = np.array(rounds.label_map[inside.slices])
    rounds.swap(pair)
    if pair not in rounds.solved:
        return None
    after = rounds.label_map[inside.slices]
    rows, columns = np.nonzero(after != before)
    _, solution = rounds.solved[pair]
    for values in (solution.labels, solution.soft):
        values.setflags(write=False)  # large ones go by files
    return Swapped(
        pixels=(rows + inside.top, columns + inside.left),
        values=after[rows, columns],
        solved=rounds.solved[pair],
        undecided=rounds.undecided.get(pair),
        seconds=rounds.seconds[pair],
    )
