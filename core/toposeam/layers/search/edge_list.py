"""The interfaces beside pixels that may change, as a list of edges, and their costs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Mask
from toposeam.layers.canvas.layer import Box
from toposeam.layers.labelling.problem import Labelling
from toposeam.seam.exact.expansion import interfaces_beside

#: Slices of the pixels and of their right neighbours; of the pixels and of their lower ones.
SIDES: Any = (np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])


class Edges(NamedTuple):
    """Edges between pixels, as (E,) arrays."""

    #: Flat indices of the two pixels of each edge, the left or upper one first.
    p: npt.NDArray[np.intp]
    q: npt.NDArray[np.intp]
    #: The edge's column in the table of costs.
    column: npt.NDArray[np.intp]

    @classmethod
    def beside(cls, open_: Mask, known: Mask) -> Edges:
        """List the edges beside open pixels of a box, both pixels of which are known; (h, w) bool masks."""
        p, q = interfaces_beside(open_, known)
        return cls(p, q, np.arange(len(p)))

    def some(self, chosen: npt.NDArray[np.intp]) -> Edges:
        """Select edges by their indices."""
        return Edges(self.p[chosen], self.q[chosen], self.column[chosen])


class EdgeCosts:
    """The cost of every edge for each two layers that may adjoin there.

    Parameters
    ----------
    labelling : Labelling
    box : Box
        The box in which pixels have their flat indices.
    layers : sequence of int
        The layers that 0, 1, … stand for.
    may_show : sequence of (h, w) bool arrays
        Per layer, True where it may show.
    edges : Edges
        All edges, as :meth:`Edges.beside` lists them.
    """

    def __init__(
        self, labelling: Labelling, box: Box, layers: Sequence[int], may_show: Sequence[Mask], edges: Edges
    ) -> None:
        count, size = len(layers), len(edges.p)
        tables = [np.zeros(size, np.float32)]
        #: (count + 1, count + 1) index at which the row of each pair begins in the table; row 0 holds zeros.
        self._begin = np.zeros((count + 1, count + 1), np.intp)
        number = np.full((2, *box.shape), -1, np.int32)
        for numbers, step in zip(number, (1, box.shape[1]), strict=True):
            own = np.flatnonzero(edges.q - edges.p == step)
            numbers.ravel()[edges.p[own]] = own
        for i in range(count):
            for j in range(i + 1, count):
                cost = labelling.costs.get((min(layers[i], layers[j]), max(layers[i], layers[j])))
                common = None if cost is None else cost.box.shared(box)
                if cost is None or common is None or not all(common.shape):
                    continue
                window = common.within(box)
                one, other = may_show[i][window], may_show[j][window]
                wanted = [(one[s] & other[t]) | (other[s] & one[t]) for s, t in SIDES]
                there = [numbers[window][s] for numbers, (s, _) in zip(number, SIDES, strict=True)]
                for chosen, numbers in zip(wanted, there, strict=True):
                    chosen &= numbers >= 0
                if not any(chosen.any() for chosen in wanted):
                    continue
                values = np.zeros(size, np.float32)
                for paid, chosen, numbers in zip(cost.on(common), wanted, there, strict=True):
                    values[numbers[chosen]] = paid[chosen]
                self._begin[i, j] = self._begin[j, i] = len(tables) * size
                tables.append(values)
        self._table = np.concatenate(tables)

    def paid(self, i: Any, j: Any, column: npt.NDArray[np.intp]) -> Floats:
        """Return the costs of edges whose pixels show layers i and j; integers, or arrays of them."""
        place = self._begin.take(i * np.intp(len(self._begin)) + j)
        place += column
        return np.asarray(self._table.take(place), np.float64)
