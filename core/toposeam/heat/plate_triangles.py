r"""A plate on a lattice of equilateral triangles, joined to a torus: the cell of the hexagonal wallpaper
groups.

The lattice vectors a₁ = (1, 0) and a₂ = (-1/2, √3/2) span rhombi, which the short diagonal cuts into two
triangles::

    0 ──── 1          first triangle 0 1 3
     \  ╲   \         second triangle 0 2 3
      2 ──── 3

Rhombi are not turned into rhombi by 60°, but nodes are turned into nodes and triangles into triangles. The
conduction matrix of an equilateral triangle with linear shape functions couples each pair of corners by -k /
(2√3), for any size.
"""

from __future__ import annotations

import numpy as np

from toposeam.arrays import Floats
from toposeam.heat.plate import Plate
from toposeam.heat.plate_joints import Joint
from toposeam.heat.plate_multigrid import Stencil, pack

#: Coupling of two corners of a triangle with k = 1.
_COUPLING = 1 / (2 * np.sqrt(3.0))


def _triangle(corners: tuple[int, int, int]) -> Floats:
    matrix = np.zeros((4, 4))
    for a in corners:
        for b in corners:
            matrix[a, b] = 2 * _COUPLING if a == b else -_COUPLING
    return matrix


_AT_FIRST_CORNER = np.diag([1.0, 0, 0, 0])


class TrianglePlate(Plate):
    """A :class:`~toposeam.heat.plate.Plate` of triangles, with heat and convection at nodes.

    Parameters
    ----------
    heat, convection : (h, w) float arrays
        Of the nodes of the torus.
    """

    patterns = np.stack(
        [pack(_triangle((0, 1, 3))), pack(_triangle((0, 2, 3))), pack(_AT_FIRST_CORNER)], axis=1
    )

    def __init__(self, heat: Floats, convection: Floats) -> None:
        super().__init__(heat, convection, Joint.TRANSLATE)

    def energy(self, nodes: Floats) -> Floats:
        """Compute θᵀ K⁰ θ of both triangles of every rhombus, (2, h, w)."""
        across, down = np.square(nodes[:, 1:] - nodes[:, :-1]), np.square(nodes[1:] - nodes[:-1])
        diagonal = np.square(nodes[1:, 1:] - nodes[:-1, :-1])
        energy: Floats = np.stack(
            [across[:-1] + down[:, 1:] + diagonal, down[:, :-1] + across[1:] + diagonal]
        )
        energy *= _COUPLING
        return energy

    def _nodal(self, values: Floats) -> Floats:
        """Place values of the torus's nodes on (h + 1) × (w + 1) nodes, each once."""
        return np.pad(values, ((0, 1), (0, 1)))

    def _stencil(self, conductivity: Floats) -> Stencil:
        first, second = conductivity * _COUPLING
        h, w = self.shape
        diagonal = self._sink.copy()
        right, down, falling, rising = (np.zeros((h + 1, w + 1)) for _ in range(4))
        right[:-1, :-1] -= first
        right[1:, :-1] -= second
        down[:-1, :-1] -= second
        down[:-1, 1:] -= first
        falling[:-1, :-1] -= first + second
        for part, y, x in ((right, 0, 1), (down, 1, 0), (falling, 1, 1)):
            diagonal -= part
            diagonal[y:, x:] -= part[: h + 1 - y, : w + 1 - x]
        return Stencil((diagonal, right, down, falling, rising), self._groups)
