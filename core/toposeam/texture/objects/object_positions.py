"""Places of objects on a canvas, kept in cells, so that the neighbours of one are found without a search of
all.
"""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np

from toposeam.texture.objects.object_catalog import At, Key


class ObjectPositions:
    """Places of objects, in cells no smaller than the distance within which two are near each other.

    Parameters
    ----------
    shape : (int, int)
        Height and width of the canvas, px.
    wrap : (bool, bool)
        Whether its rows and columns continue at the opposite border.
    reach : float
        Two objects nearer than this are near each other, px.

    Examples
    --------
    >>> here = ObjectPositions((100, 100), (True, True), 10.0)
    >>> here.put((0, 1, 50), True)
    >>> here.near((98, 50)), here.near((12, 50))
    ([(0, 1, 50)], [])
    """

    def __init__(self, shape: tuple[int, int], wrap: tuple[bool, bool], reach: float) -> None:
        self._shape, self._wrap, self._reach = shape, wrap, reach
        counts = [max(1, int(limit / reach)) for limit in shape]
        self._counts = counts[0], counts[1]
        self._cells: defaultdict[At, set[Key]] = defaultdict(set)

    def all(self) -> list[Key]:
        """List every object, in order."""
        return sorted(key for cell in self._cells.values() for key in cell)

    def put(self, key: Key, there: bool) -> None:
        """Record that an object is there, or that it is not."""
        cell = self._cells[self._cell(0, key[1]), self._cell(1, key[2])]
        (cell.add if there else cell.discard)(key)

    def near(self, at: At) -> list[Key]:
        """List the objects near a place in no order, among them one that lies exactly there."""
        return self._near([at])[0]

    def neighbours(self) -> dict[Key, list[Key]]:
        """List the objects near each object, the object itself included."""
        cells = [list(cell) for cell in self._cells.values() if cell]
        return {
            key: near
            for cell in cells
            for key, near in zip(cell, self._near([key[1:] for key in cell]), strict=True)
        }

    def _near(self, places: list[At]) -> list[list[Key]]:
        """List the objects near each of some places of one cell."""
        around = [
            key
            for row in self._around(0, places[0][0])
            for column in self._around(1, places[0][1])
            for key in self._cells.get((row, column), ())
        ]
        apart = np.zeros((len(places), len(around)), np.intp)
        lines = [key[1] for key in around], [key[2] for key in around]
        for own, others, limit, wraps in zip(
            zip(*places, strict=True), lines, self._shape, self._wrap, strict=True
        ):
            away = np.subtract.outer(own, np.array(others, np.intp))
            away = np.minimum(away % limit, -away % limit) if wraps else away
            apart += away * away
        return [
            [around[number] for number in np.flatnonzero(line).tolist()] for line in apart < self._reach**2
        ]

    def _cell(self, axis: int, place: int) -> int:
        limit, count = self._shape[axis], self._counts[axis]
        if self._wrap[axis]:
            return place % limit * count // limit
        return math.floor(place * count / limit)

    def _around(self, axis: int, place: int) -> set[int]:
        """List the cells along one axis that may hold objects near a place."""
        cell, count = self._cell(axis, place), self._counts[axis]
        reach = 1 if self._shape[axis] >= self._reach else math.ceil(self._reach / self._shape[axis])
        cells = range(cell - reach, cell + reach + 1)
        return {one % count for one in cells} if self._wrap[axis] else set(cells)
