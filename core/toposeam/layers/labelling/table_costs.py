"""Match costs of pairs of layers as tables, on reduced canvases."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from toposeam.arrays import Floats32, Mask
from toposeam.layers.canvas.layer import Box, cut
from toposeam.layers.labelling.problem import PairCost

#: Margin, px, of a part of the canvas that is cut out: gradients need one more pixel, and each halving
#: doubles that.
AROUND = 8


def spread(costs: tuple[Floats32, Floats32] | None, at: Box, box: Box) -> tuple[Floats32, Floats32]:
    """Copy costs that are known in box `at` to another box, 0 beyond."""
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
    """The match cost of two layers on a reduced canvas, as tables."""

    box: Box
    right: Floats32
    down: Floats32
    #: The part of the box that the tables cover; the costs are 0 elsewhere. None for the whole box.
    at: Box | None = None

    def __post_init__(self) -> None:
        for table in (self.right, self.down):
            table.setflags(write=False)  # read-only arrays may be passed as files

    def on(self, box: Box, beside: Mask | None = None) -> tuple[Floats32, Floats32]:
        """Return the costs in a box."""
        return spread((self.right, self.down), self.at or self.box, box)

    def shared(self, box: Box) -> Mask:
        """(h, w) bool mask of a box, True inside the common box of both layers."""
        inside = self.box.grown(-1)
        return cut(np.ones(inside.shape, bool), inside, box)

    def part(self, box: Box, shared_parts: dict[int, Any]) -> PairCost:
        """Cut the tables to a box and a margin; a part is returned as it is."""
        if self.at is not None:
            return self
        common = box.grown(AROUND).shared(self.box)
        if min(common.shape) < 2:
            common = Box(self.box.top, self.box.left, self.box.top + 2, self.box.left + 2)
        rows, columns = common.within(self.box)
        right = self.right[rows, columns.start : columns.stop - 1]
        return TableCost(self.box, right, self.down[rows.start : rows.stop - 1, columns], common)
