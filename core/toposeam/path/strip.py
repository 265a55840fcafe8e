"""Heat conduction on the free elements of a plate only, solved by elimination.

Elements and loads are those of :mod:`toposeam.heat.plate`. A narrow strip along a way has few unknowns,
however large the map. Insulating walls do not slow elimination down, as they do multigrid.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats
from toposeam.heat.elimination import system
from toposeam.heat.plate import CONDUCTION, Temperature

#: The six pairs of an element's four corners.
_FIRST, _SECOND = np.triu_indices(4, 1)


class Strip:
    """The free elements of a plate, their heat loads and their convection.

    Parameters
    ----------
    heat, convection : (h, w) float array
        As of :class:`toposeam.heat.plate.Plate`; every piece of free elements has some convection.
    free : (h, w) bool array
        The elements that conduct.
    """

    def __init__(self, heat: Floats, convection: Floats, free: npt.NDArray[np.bool_]) -> None:
        self.free = free
        width = free.shape[1]
        row, column = np.nonzero(free)
        first = row * (width + 1) + column
        corners = np.column_stack([first, first + 1, first + width + 1, first + width + 2])
        self.nodes, flat = np.unique(corners, return_inverse=True)
        self.corners = flat.reshape(-1, 4)
        n = len(self.nodes)
        pairs = np.sort(self.corners[:, np.stack([_FIRST, _SECOND])].transpose(0, 2, 1), axis=2)
        known, self._pair = np.unique(pairs[..., 0] * n + pairs[..., 1], return_inverse=True)
        self._system = system(n, known // n, known % n)
        self._sink = self._nodal(np.repeat(convection[free][:, np.newaxis] / 4, 4, axis=1))
        self._load = self._nodal(np.repeat(heat[free][:, np.newaxis] / 4, 4, axis=1))

    def solve(self, conductivity: Floats, start: Floats | None = None) -> Temperature:
        """Solve for the steady state at (h, w) conductivities, positive on free elements.

        `start` is ignored: elimination needs no first guess.
        """
        k = conductivity[self.free][:, np.newaxis]
        coupling = np.bincount(self._pair.ravel(), (k * -CONDUCTION[_FIRST, _SECOND]).ravel()).astype(float)
        diagonal = self._sink + self._nodal(k * np.diag(CONDUCTION))
        flat = self._system.factor(coupling, diagonal)(self._load.copy())
        around = flat[self.corners]
        energy = np.zeros(self.free.shape)
        energy[self.free] = np.einsum("ea,ab,eb->e", around, CONDUCTION, around)
        nodes = np.zeros((self.free.shape[0] + 1, self.free.shape[1] + 1))
        nodes.ravel()[self.nodes] = flat
        return Temperature(nodes=nodes, compliance=float(self._load @ flat), energy=energy, iterations=1)

    def _nodal(self, shares: Floats) -> Floats:
        """Sum the shares of the corners of each element, (elements, 4), at the nodes."""
        sums: Floats = np.bincount(self.corners.ravel(), shares.ravel(), len(self.nodes)).astype(np.float64)
        return sums
