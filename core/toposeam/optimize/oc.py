r"""The optimality-criteria (OC) update for minimal compliance under a mass bound.

At an optimum with bounds inactive the compliance saved per mass added is the same everywhere, B = -∂C/∂x / (λ
∂M/∂x) = 1. The update (Bendsøe and Sigmund 2003, doi:10.1007/978-3-662-05086-6)

.. math:: x \leftarrow \operatorname{clip}(x\,B^{\eta}, \max(x - m, x_{min}), \min(x + m, x_{max}))

moves every variable towards that, with damping η and move limit m; λ is found such that the mass meets its
bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toposeam.arrays import Floats
from toposeam.checks import check_range
from toposeam.optimize.multiplier import find_multiplier


@dataclass(frozen=True, slots=True, kw_only=True)
class OCOptions:
    """Move limit and damping of an update."""

    #: Move limit m: largest change of a variable.
    move: float = 0.2
    #: Damping exponent η: 1/2 is exact for fixed fluxes and p = 1; 1/(p + 1) in general.
    damping: float = 0.5

    def __post_init__(self) -> None:
        check_range(0, above=True, move=self.move)
        check_range(0, 1, above=True, damping=self.damping)


def oc_step(
    x: Floats,
    sensitivity: Floats,
    mass: Floats | float,
    bound: float,
    lower: Floats | float,
    upper: Floats | float,
    options: OCOptions | None = None,
) -> Floats:
    """Compute the next design.

    Parameters
    ----------
    x : (N,) float array, positive
        The design, within its bounds.
    sensitivity : (N,) float array
        ∂C/∂x. Positive values, which a compliance does not have but a filter may leave, count as zero.
    mass : (N,) float array or float, positive
        ∂M/∂x: mass of each variable at x = 1.
    bound : float
        Upper bound of the mass Σ mass x.
    lower, upper : (N,) float arrays or floats
    options : OCOptions

    Returns
    -------
    (N,) float array
        Its mass is at most the bound, unless the move limits and lower bounds do not allow that: then the
        lightest design they allow.
    """
    chosen = options if options is not None else OCOptions()
    lowest, highest = np.maximum(x - chosen.move, lower), np.minimum(x + chosen.move, upper)
    benefit = np.maximum(-sensitivity, 0.0) / mass
    scaled = x * benefit**chosen.damping

    def design(multiplier: float) -> Floats:
        value: Floats = np.clip(scaled * multiplier**-chosen.damping, lowest, highest)
        return value

    def residual(multiplier: float) -> float:
        return float(np.sum(mass * design(multiplier))) - bound

    mean = float(np.mean(benefit))
    if mean == 0.0:
        return np.asarray(lowest, float)
    # Raising every useful variable to its upper bound may meet the mass bound, which then is not active.
    if float(np.sum(mass * np.where(benefit > 0, highest, lowest))) <= bound:
        return np.where(benefit > 0, highest, lowest)
    return design(find_multiplier(residual, mean, 1e-9 * abs(bound)))
