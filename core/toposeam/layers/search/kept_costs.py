"""Match costs that are computed once and kept, at full size and reduced, for searches that are repeated.

A stroke of a brush changes where layers are allowed, not what their pixels cost. So a labelling that is
searched after every stroke keeps its costs as tables, and those at half the size, a quarter and so on, each
from the time it is first read.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

from toposeam.arrays import Floats32, Mask
from toposeam.checks import check_kind, check_number
from toposeam.layers.canvas.layer import Box
from toposeam.layers.labelling.problem import Labelling, PairCost
from toposeam.layers.labelling.table_costs import TableCost

#: Bytes of the two costs of a pixel.
_BYTES = 8
#: Costs of all reduced sizes together ÷ those of full size, at most.
_REDUCED = 1 / 3


class KeptCost:
    """The match cost of two layers as a table, computed when it is first read."""

    def __init__(self, cost: PairCost) -> None:
        self.cost = cost
        self._table: TableCost | None = None
        self._halves: dict[float, KeptCost] = {}

    @property
    def box(self) -> Box:
        """The overlap of the two places, grown by one pixel."""
        return self.cost.box

    def on(self, box: Box, beside: Mask | None = None) -> tuple[Floats32, Floats32]:
        """Return the costs in a box."""
        if self._table is None:
            self._table = TableCost(self.box, *self.cost.on(self.box))
        return self._table.on(box)

    def shared(self, box: Box) -> Mask:
        """(h, w) bool mask of a box, True where both layers have pixels."""
        return self.cost.shared(box)

    def part(self, box: Box, shared_parts: dict[int, Any]) -> PairCost:
        """Return the same cost for use inside a box only, in another process."""
        return self.cost.part(box, shared_parts)

    def half(self, wandering: float, reduce: Callable[[PairCost, float], PairCost]) -> KeptCost:
        """Return the cost at half the size, as `reduce` computes it with a weight."""
        if wandering not in self._halves:
            self._halves[wandering] = KeptCost(reduce(self, wandering))
        return self._halves[wandering]


def keep_costs(labelling: Labelling, megabytes: float = 256.0) -> Labelling:
    """Return the same problem with match costs that are kept in memory once they have been computed.

    Parameters
    ----------
    labelling : Labelling
    megabytes : float
        Memory that they may take. The smallest overlaps are kept first; the others are computed again
        wherever they are read.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 30, 40))
    >>> labelling = keep_costs(ts.stitch(ts.layers.overlapping(a, b, overlap=10)).labelling)
    >>> labelling.costs[0, 1].on(labelling.canvas)[0].shape
    (30, 69)
    """
    check_kind("labelling", labelling, Labelling, "a Labelling, such as Composition.labelling")
    check_number("megabytes", megabytes, 0)
    left, costs = megabytes * 1e6, dict(labelling.costs)
    for pair in sorted(costs, key=lambda pair: (math.prod(costs[pair].box.shape), pair)):
        left -= _BYTES * (1 + _REDUCED) * math.prod(costs[pair].box.shape)
        if left < 0:
            break
        if not isinstance(costs[pair], KeptCost):
            costs[pair] = KeptCost(costs[pair])
    return dataclasses.replace(labelling, costs=costs)
