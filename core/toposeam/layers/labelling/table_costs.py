"""Costs of pairs of layers that are known as tables, on reduced canvases."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from toposeam.arrays import Floats32, Mask
from toposeam.layers.canvas.layer import Box, cut
from toposeam.layers.labelling.problem import PairCost

#: How far beyond a part of the canvas its costs are looked up, px: gradients look one farther, and halving
#: doubles it.
AROUND = 8


def spread(costs: tuple[Floats32, Floats32] | None, at: Box, box: Box) -> tuple[Floats32, Floats32]:
    """Costs known in a box as those in another one, 0 beyond."""
    right_box, down_box = (
        Box(box.top, box.left, box.bottom, box.right - 1),
        Box(box.top, box.left, box.bottom - 1, box.right),
    )
    if costs is None:
        return np.zeros(right_box.shape, np.float32), np.zeros(down_box.shape, np.float32)
    return cut(costs[0], Box(at.top, at.left, at.bottom, at.right - 1), right_box), cut(
        costs[1], Box(at.top, at.left, at.bottom - 1, at.right), down_box
    )


@dataclass(frozen=True, slots=True, eq=False)
class TableCost:
    """The cost of two layers on a reduced canvas, as tables."""

    box: Box
    right: Floats32
    down: Floats32
    #: The part of the box that the tables are of, 0 elsewhere; all of it where None.
    at: Box | None = None

    def __post_init__(self) -> None:
        for table in (self.right, self.down):
            table.setflags(write=False)  # who hands them on need not look whether they are still the same

    def on(self, box: Box, beside: Mask | None = None) -> tuple[Floats32, Floats32]:
        """The costs in a box."""
        return spread((self.right, self.down), self.at or self.box, box)

    def shared(self, box: Box) -> Mask:
        """(h, w) bool, the whole of their common box."""
        inside = self.box.grown(-1)
        return cut(np.ones(inside.shape, bool), inside, box)

    def part(self, box: Box, seen: dict[int, Any]) -> PairCost:
        """The tables in a box; of a part they are that already."""
        if self.at is not None:
            return self
        common = box.grown(AROUND).shared(self.box)
        if min(common.shape) < 2:
            common = Box(self.box.top, self.box.left, self.box.top + 2, self.box.left + 2)
        rows, columns = common.within(self.box)
        right = self.right[rows, columns.start : columns.stop - 1]
        return TableCost(self.box, right, self.down[rows.start : rows.stop - 1, columns], common)
