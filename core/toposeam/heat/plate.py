r"""A plate that conducts heat from its sources to its sinks, in four-node square elements of side 1.

The steady state of k∇²θ - hθ + Q = 0 (thesis 4.1): heat Q is generated in some elements and leaves by
convection h in others. With bilinear shape functions an element's conduction matrix is (2.3)

.. math::
    \mathbf K_e = \frac{k_e}{6}
    \begin{pmatrix} 4 & -1 & -1 & -2 \\ -1 & 4 & -2 & -1 \\ -1 & -2 & 4 & -1 \\ -2 & -1 & -1 & 4 \end{pmatrix}

for corners numbered as in :mod:`toposeam.heat.plate_multigrid`. Convection and heat are shared equally by the
four corners (row sums of the consistent matrices), which keeps temperatures positive. Compliance Π = θᵀKθ
(4.3), K including convection, equals Fᵀθ, and

.. math:: \partial\Pi / \partial k_e = -\theta_e^T \mathbf K_e^0 \theta_e.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toposeam.arrays import Floats
from toposeam.errors import OptionError
from toposeam.heat.plate_joints import Joint, Shift
from toposeam.heat.plate_multigrid import Hierarchy, Multigrid, Stencil, pack

#: Conduction of a square element with k = 1.
CONDUCTION = np.array([[4.0, -1, -1, -2], [-1, 4, -2, -1], [-1, -2, 4, -1], [-2, -1, -1, 4]]) / 6
#: Convection of a square element with h = 1, lumped.
CONVECTION = np.eye(4) / 4
#: Iterations of multigrid after which a plate is solved by elimination.
MOST_ITERATIONS = 60


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Temperature:
    """The steady state of a plate."""

    #: Temperatures of the (h + 1, w + 1) nodes.
    nodes: Floats
    #: Compliance Fᵀθ.
    compliance: float
    #: -∂Π/∂k_e, of the conductivities' shape.
    energy: Floats
    #: Iterations the solver took.
    iterations: int


class Plate:
    """A plate of square elements with heat sources, convection and a border that may be joined to itself.

    Parameters
    ----------
    heat : (h, w) float array
        Heat Q generated in every element, not negative.
    convection : (h, w) float array
        Convection h of every element, not negative.
    joint : Joint, Shift or str

    Raises
    ------
    OptionError
        When there is no heat or no convection (the problem has no solution, or an empty one), or the joint
        does not fit the shape.
    """

    #: Element matrices for k = 1 and for h = 1, packed.
    patterns = np.stack([pack(CONDUCTION), pack(CONVECTION)], axis=1)

    def __init__(self, heat: Floats, convection: Floats, joint: Joint | Shift | str = Joint.FREE) -> None:
        if heat.shape != convection.shape or heat.ndim != 2:
            raise OptionError(
                "heat has shape {heat!s} and convection {convection!s}; pass two (h, w) arrays",
                kind="shape",
                heat=heat.shape,
                convection=convection.shape,
            )
        self.shape: tuple[int, int] = (heat.shape[0], heat.shape[1])
        self.joint = joint if isinstance(joint, Shift) else Joint(joint)
        if not (
            np.isfinite(heat).all()
            and np.isfinite(convection).all()
            and min(heat.min(), convection.min()) >= 0
        ):
            raise OptionError("heat and convection must be finite and not negative", kind="number")
        if not heat.any():
            raise OptionError(
                "the plate has no heat source; give at least one source a strength above 0", kind="no source"
            )
        if not convection.any():
            raise OptionError(
                "the plate has no heat sink, so its temperature is not determined; give at least one sink "
                "convection above 0",
                kind="no sink",
            )
        if not self.joint.fits(self.shape):
            raise OptionError(
                "a plate of {rows} × {columns} elements cannot be joined by {joint}; use even sizes from 8",
                kind="shape",
                rows=self.shape[0],
                columns=self.shape[1],
                joint=str(self.joint),
            )
        self._hierarchy = Hierarchy(self.shape, self.joint)
        self._groups = self._hierarchy.groups[0]
        self.heat, self.convection = heat.astype(np.float64), convection.astype(np.float64)
        self._sink = self._nodal(self.convection)
        self._load = self._nodal(self.heat).ravel()
        self._groups.gather(self._load)

    def solve(
        self,
        conductivity: Floats,
        start: Floats | None = None,
        *,
        tolerance: float = 1e-5,
        max_iterations: int = MOST_ITERATIONS,
        energy: float = 0.0,
    ) -> Temperature:
        """Compute the steady state for (h, w) conductivities, all positive.

        `start` is an optional guess, the nodes of another state; `tolerance` and `energy` are those of
        `conjugate_gradients`.
        """
        system = self._stencil(conductivity)
        elements = np.concatenate([conductivity.reshape(-1, *self.shape), self.convection[np.newaxis]])
        solver = Multigrid(elements, self.patterns, system, self._hierarchy)
        guess = None if start is None else start.ravel()
        solved = solver.solve(
            self._load, guess, tolerance=tolerance, max_iterations=max_iterations, energy=energy
        )
        nodes = solved.theta.reshape(self.shape[0] + 1, self.shape[1] + 1)
        return Temperature(
            nodes=nodes,
            compliance=solved.compliance,
            energy=self.energy(nodes),
            iterations=solved.iterations,
        )

    def energy(self, nodes: Floats) -> Floats:
        """Compute θ_eᵀ K⁰ θ_e of every element, (h, w), for (h + 1, w + 1) temperatures.

        It is a sixth of the squared differences along the four sides plus a third of those along the two
        diagonals.
        """
        across = np.square(nodes[:, 1:] - nodes[:, :-1])
        down = np.square(nodes[1:] - nodes[:-1])
        energy: Floats = across[1:] + across[:-1]
        energy += down[:, 1:]
        energy += down[:, :-1]
        energy *= 0.5
        energy += np.square(nodes[1:, 1:] - nodes[:-1, :-1])
        energy += np.square(nodes[1:, :-1] - nodes[:-1, 1:])
        energy *= 1 / 3
        return energy

    def _nodal(self, values: Floats) -> Floats:
        """Share element values equally among their corners, (h + 1, w + 1)."""
        h, w = self.shape
        nodes = np.zeros((h + 1, w + 1))
        quarter = values * 0.25
        nodes[:-1, :-1] = quarter
        nodes[:-1, 1:] += quarter
        nodes[1:, :-1] += quarter
        nodes[1:, 1:] += quarter
        return nodes

    def _stencil(self, k: Floats) -> Stencil:
        """Assemble the matrix as `stencil` of `plate_multigrid`, with the constants of the square element."""
        h, w = self.shape
        total = self._nodal(k)
        diagonal = total * (8 / 3)
        diagonal += self._sink
        right, down, falling = (np.zeros((h + 1, w + 1)) for _ in range(3))
        side = k * (-1 / 6)
        right[:-1, :-1] = side
        right[1:, :-1] += side
        down[:-1, :-1] = side
        down[:-1, 1:] += side
        np.multiply(k, -1 / 3, out=falling[:-1, :-1])
        return Stencil((diagonal, right, down, falling, falling), self._groups)
