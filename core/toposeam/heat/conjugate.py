"""Conjugate gradients preconditioned by a multigrid cycle, in any number of dimensions.

Smoothers are two damped Jacobi sweeps, with the dampings of the Chebyshev polynomial of degree two. Cycles
run in single precision, the conjugate gradients around them in double.

*When to stop.* A step α d takes α² dᵀKd off the squared error in the energy norm, (θ* - θ)ᵀK(θ* - θ). Let e²
be that error as a share of the compliance fᵀθ*. It is the error that matters to a design: e² in the
compliance, and 2e at most in all sensitivities together. Where conductivities differ a thousandfold residuals
say little about it: when they are 10⁻³ of the load, e² is 10⁻⁸.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from toposeam.arrays import Floats, Floats32

#: Interval of the eigenvalues of D⁻¹K that the smoother damps; below, the dampings of its two sweeps.
_SMOOTHED = (0.45, 1.6)
_middle, _half = sum(_SMOOTHED) / 2, (_SMOOTHED[1] - _SMOOTHED[0]) / 2 / np.sqrt(2.0)
DAMPING = (np.float32(1.0 / (_middle + _half)), np.float32(1.0 / (_middle - _half)))


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """The solution of a system."""

    #: θ, (N,) floats.
    theta: Floats
    #: (f + r)ᵀθ with the residual r: the compliance less the squared error in the energy norm.
    compliance: float
    #: Iterations it took.
    iterations: int


def conjugate_gradients(
    multiply: Callable[[Floats], Floats],
    cycle: Callable[[Floats32], Floats32],
    load: Floats,
    start: Floats | None,
    *,
    inner: Callable[[Floats, Floats], float],
    tolerance: float,
    max_iterations: int,
    energy: float = 0.0,
) -> Solved | None:
    """Solve K θ = f.

    Parameters
    ----------
    multiply : callable
        K θ.
    cycle : callable
        A symmetric positive approximation of K⁻¹, for a residual of norm 1.
    load : (N,) float array
        f.
    start : (N,) float array, optional
        A guess.
    inner : callable
        Inner product.
    tolerance : float
        Stop when the residual's norm is this share of the load's.
    max_iterations : int
    energy : float
        Also stop after a step that takes no more than this share of the compliance off the squared error.

    Returns
    -------
    Solved or None
        None where the iterations did not converge.
    """
    goal = tolerance * np.sqrt(inner(load, load))
    theta = np.zeros_like(load) if start is None else start.copy()
    residual = load.copy()
    if start is not None:
        residual -= multiply(theta)
    direction, before = np.zeros_like(load), 1.0
    compliance, gained = inner(load, theta) + inner(residual, theta), np.inf
    for iteration in range(max_iterations + 1):
        size = np.sqrt(inner(residual, residual))
        if size <= goal or gained <= energy * compliance:
            return Solved(theta, compliance, iteration)
        if iteration == max_iterations:
            break
        scaled = (residual * (1.0 / size)).astype(np.float32)
        preconditioned = cycle(scaled).astype(np.float64)
        preconditioned *= size
        slope = inner(residual, preconditioned)
        direction *= slope / before if iteration else 0.0
        direction += preconditioned
        before = slope
        product = multiply(direction)
        curvature = inner(direction, product)
        if not curvature > 0:
            break
        step = slope / curvature
        theta += step * direction
        product *= step
        residual -= product
        gained = step * slope
        compliance += gained
    return None
