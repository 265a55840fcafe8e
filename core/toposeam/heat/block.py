r"""A block that conducts heat, in cubes of side 1: the plate's third dimension.

Temperatures belong to the cubes. The flow between two is their difference times the conductance of half of
each in series, :math:`g = 2 k_1 k_2 / (k_1 + k_2)`; heat leaves by convection, as from a plate. So there are
seven couplings a cube, and

.. math:: \partial\Pi / \partial k_1 = -\sum_{faces} \frac{2 k_2^2}{(k_1 + k_2)^2} (\theta_1 - \theta_2)^2 .

*Multigrid.* A coarse cube is 2 × 2 × 2 fine ones at one temperature. Four faces between two of them, over
twice the way: their sum is halved, which corrects the overestimate of constant temperatures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Floats32
from toposeam.errors import OptionError, SolverError
from toposeam.heat.conjugate import DAMPING, conjugate_gradients

#: Most cubes of the coarsest grid.
_COARSEST_CUBES = 300
#: Smoothing steps, of two sweeps each, before a coarse correction, and as many after it.
_SMOOTHING_STEPS = 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlockTemperature:
    """The steady state of a block."""

    #: Temperatures of the (d, h, w) cubes.
    cubes: Floats
    #: Compliance Fᵀθ.
    compliance: float
    #: -∂Π/∂k of every cube, (d, h, w).
    energy: Floats
    #: Iterations the solver took.
    iterations: int


class Block:
    """A block of cubes with heat sources and convection.

    Parameters
    ----------
    heat : (d, h, w) float array
        Heat generated in every cube, not negative.
    convection : (d, h, w) float array
        Convection of every cube, not negative.
    joined : bool
        Whether opposite sides are the same (not floor and ceiling); else they are insulated.

    Raises
    ------
    OptionError
        When there is no heat, or no way for it to leave.

    Examples
    --------
    >>> heat, sink = np.zeros((2, 4, 4)), np.zeros((2, 4, 4))
    >>> heat[1, 0, 0], sink[0, 3, 3] = 1, 1
    >>> bool(np.isclose(Block(heat, sink).solve(np.ones((2, 4, 4))).cubes[0, 3, 3], 1))
    True
    """

    def __init__(self, heat: Floats, convection: Floats, joined: bool = False) -> None:
        if heat.shape != convection.shape or heat.ndim != 3:
            raise OptionError(
                "heat has shape {heat!s} and convection {convection!s}; pass two (d, h, w) arrays",
                kind="shape",
                heat=heat.shape,
                convection=convection.shape,
            )
        if not (np.isfinite(heat).all() and np.isfinite(convection).all()):
            raise OptionError("heat and convection must be finite", kind="number")
        if min(heat.min(), convection.min()) < 0 or not heat.any() or not convection.any():
            raise OptionError(
                "heat and convection must not be negative, and both somewhere above 0", kind="number"
            )
        self.shape: tuple[int, int, int] = heat.shape
        self.heat, self.convection = heat.astype(np.float64), convection.astype(np.float64)
        self.joined = joined

    def solve(
        self,
        conductivity: Floats,
        start: Floats | None = None,
        *,
        tolerance: float = 1e-5,
        max_iterations: int = 300,
    ) -> BlockTemperature:
        """Compute the steady state for (d, h, w) conductivities, all positive, from an optional guess.

        Raises
        ------
        SolverError
        """
        faces = [self._conductance(conductivity, axis) for axis in range(3)]
        levels = [_Level(faces, self.convection)]
        while levels[-1].sink.size > _COARSEST_CUBES and (coarser := levels[-1].coarser()) is not None:
            levels.append(coarser)

        def multiply(theta: Floats) -> Floats:
            field = theta.reshape(self.shape)
            product = self.convection * field
            _add_flow(product, field, faces)
            return product.ravel()

        solved = conjugate_gradients(
            multiply,
            lambda load: _cycle(levels, load.reshape(self.shape)).ravel(),
            self.heat.ravel(),
            None if start is None else start.ravel(),
            inner=lambda a, b: float(a @ b),
            tolerance=tolerance,
            max_iterations=max_iterations,
        )
        if solved is None:
            raise SolverError(
                "the block's temperatures did not settle in {iterations} iterations; give more, or a "
                "larger tolerance",
                kind="not settled",
                iterations=max_iterations,
            )
        cubes = solved.theta.reshape(self.shape)
        return BlockTemperature(
            cubes=cubes,
            compliance=solved.compliance,
            energy=self._energy(cubes, conductivity),
            iterations=solved.iterations,
        )

    def _ends(self, axis: int) -> bool:
        """Return whether faces at the far end of an axis are insulated."""
        return axis == 0 or not self.joined

    def _conductance(self, k: Floats, axis: int) -> Floats:
        """Compute the conductance between every cube and the next along an axis, (d, h, w)."""
        beyond = np.roll(k, -1, axis)
        g: Floats = 2.0 * k * beyond / (k + beyond)
        if self._ends(axis):
            g[_last(axis)] = 0.0
        return g

    def _energy(self, cubes: Floats, k: Floats) -> Floats:
        energy = np.zeros(self.shape)
        for axis in range(3):
            beyond = np.roll(k, -1, axis)
            flow = 2.0 * np.square((np.roll(cubes, -1, axis) - cubes) / (k + beyond))
            if self._ends(axis):
                flow[_last(axis)] = 0.0
            energy += flow * np.square(beyond)
            energy += np.roll(flow * np.square(k), 1, axis)
        return energy


def _last(axis: int) -> tuple[slice | int, ...]:
    return (*(slice(None) for _ in range(axis)), -1)


def _add_flow(
    product: npt.NDArray[np.floating],
    field: npt.NDArray[np.floating],
    faces: Sequence[npt.NDArray[np.floating]],
) -> None:
    """Add the heat that flows out of every cube, in place."""
    for axis, g in enumerate(faces):
        here, there = [slice(None)] * 3, [slice(None)] * 3
        here[axis], there[axis] = slice(None, -1), slice(1, None)
        one, other = tuple(here), tuple(there)
        flow = field[one] - field[other]
        flow *= g[one]
        product[one] += flow
        product[other] -= flow
        here[axis], there[axis] = slice(-1, None), slice(None, 1)
        one, other = tuple(here), tuple(there)
        if g[one].any():
            flow = (field[one] - field[other]) * g[one]
            product[one] += flow
            product[other] -= flow


class _Level:
    """One grid: conductances of faces, convection of cubes, and the smoother."""

    def __init__(self, faces: list[Floats], sink: Floats) -> None:
        self.exact, self.sink = faces, sink
        self.faces = [g.astype(np.float32) for g in faces]
        self._convection: Floats32 = sink.astype(np.float32)
        diagonal = sink + sum(g + np.roll(g, 1, axis) for axis, g in enumerate(faces))
        self._jacobi: Floats32 = (1.0 / np.maximum(diagonal, 1e-30)).astype(np.float32)

    def coarser(self) -> _Level | None:
        """Build the grid of 2 × 2 × 2 cubes; None where a side is odd or too short."""
        if any(side % 2 for side in self.sink.shape) or min(self.sink.shape) < 4:
            return None
        faces = []
        for axis, g in enumerate(self.exact):
            between = [slice(None)] * 3
            between[axis] = slice(1, None, 2)
            faces.append(0.5 * _summed(g[tuple(between)], [other for other in range(3) if other != axis]))
        return _Level(faces, _summed(self.sink, [0, 1, 2]))

    def residual(self, load: Floats32, theta: Floats32) -> Floats32:
        """Compute load - K θ."""
        product: Floats32 = self._convection * theta
        _add_flow(product, theta, self.faces)
        return load - product

    def sweep(self, load: Floats32, theta: Floats32, dampings: tuple[np.float32, ...]) -> None:
        """Run Jacobi sweeps, in place."""
        for damping in dampings:
            theta += damping * self._jacobi * self.residual(load, theta)

    @cached_property
    def _inverse(self) -> Floats:
        count = self.sink.size
        matrix = np.empty((count, count))
        for column, unit in enumerate(np.eye(count).reshape(count, *self.sink.shape)):
            product = self.sink * unit
            _add_flow(product, unit, self.exact)
            matrix[:, column] = product.ravel()
        inverse: Floats = np.asarray(np.linalg.inv((matrix + matrix.T) / 2), np.float64)
        return inverse

    def solved(self, load: Floats32) -> Floats32:
        """Solve directly, on the coarsest grid."""
        solved: Floats32 = (self._inverse @ load.ravel()).reshape(load.shape).astype(np.float32)
        return solved


def _summed(values: Floats, axes: list[int]) -> Floats:
    """Add up pairs of values along some axes."""
    for axis in axes:
        even, odd = [slice(None)] * 3, [slice(None)] * 3
        even[axis], odd[axis] = slice(None, None, 2), slice(1, None, 2)
        values = values[tuple(even)] + values[tuple(odd)]
    return values


def _cycle(levels: list[_Level], load: Floats32, depth: int = 0) -> Floats32:
    """Run one W-cycle from zero."""
    level = levels[depth]
    if depth == len(levels) - 1:
        return level.solved(load)
    theta = np.zeros_like(load)
    for _ in range(_SMOOTHING_STEPS):
        level.sweep(load, theta, DAMPING)
    for _ in range(2 if depth else 1):
        coarse = _summed(level.residual(load, theta), [0, 1, 2])  # type: ignore[arg-type]
        correction = _cycle(levels, coarse, depth + 1)  # type: ignore[arg-type]
        for axis in range(3):
            correction = correction.repeat(2, axis)
        theta += correction
    for _ in range(_SMOOTHING_STEPS):
        level.sweep(load, theta, DAMPING[::-1])
    return theta
