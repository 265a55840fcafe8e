"""The interfaces of a box that lie beside pixels that may change, as a list, and what each of them costs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Mask
from toposeam.layers.canvas.layer import Box
from toposeam.layers.labelling.problem import Labelling
from toposeam.seam.exact.expansion import interfaces_beside

#: Each pixel and its right, or lower, neighbour.
SIDES: Any = (np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])


class Edges(NamedTuple):
    """Interfaces between pixels, (E,) arrays."""

    #: The two pixels of each, by flat index, the left or upper one first.
    p: npt.NDArray[np.intp]
    q: npt.NDArray[np.intp]
    #: Its column in a table of costs.
    column: npt.NDArray[np.intp]

    @classmethod
    def beside(cls, open_: Mask, known: Mask) -> Edges:
        """Those beside some pixels of a box, of which both are known; (h, w) bool arrays."""
        p, q = interfaces_beside(open_, known)
        return cls(p, q, np.arange(len(p)))

    def some(self, chosen: npt.NDArray[np.intp]) -> Edges:
        """Those at some places."""
        return Edges(self.p[chosen], self.q[chosen], self.column[chosen])


class EdgeCosts:
    """What edges cost for every two layers that may adjoin there.

    Parameters
    ----------
    labelling : Labelling
    box : Box
        In which the edges are numbered.
    layers : sequence of int
        Which layers are meant by 0, 1, …
    seen : sequence of (h, w) bool arrays
        Where each of them may show.
    edges : Edges
        All that there are, as :meth:`Edges.beside` finds them.
    """

    def __init__(
        self, labelling: Labelling, box: Box, layers: Sequence[int], seen: Sequence[Mask], edges: Edges
    ) -> None:
        count, size = len(layers), len(edges.p)
        tables = [np.zeros(size, np.float32)]
        #: (count + 1, count + 1) where rows of the table begin; the first one is 0.
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
                one, other = seen[i][window], seen[j][window]
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
        """What edges cost whose ends show i and j; integers, or arrays of them."""
        place = self._begin.take(i * np.intp(len(self._begin)) + j)
        place += column
        return np.asarray(self._table.take(place), np.float64)
