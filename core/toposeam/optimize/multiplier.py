"""The Lagrange multiplier of a single constraint.

With one constraint the dual of a separable problem is one-dimensional: the design is a closed form in the
multiplier, and the constraint's residual falls as the multiplier grows. Its root is bracketed and then closed
in on by regula falsi (Illinois variant), on a logarithmic scale because multipliers of different problems
differ by many orders of magnitude.
"""

from __future__ import annotations

import math
from collections.abc import Callable

#: Largest distance of a multiplier from the first guess, as a natural logarithm (about 26 orders of magnitude
#: each way).
_LOG_REACH = 60.0
#: Largest absolute natural logarithm of a multiplier, so that products with it stay finite.
_LOG_LIMIT = 300.0


def find_multiplier(residual: Callable[[float], float], guess: float, tolerance: float) -> float:
    """Find the multiplier at which a falling residual becomes zero.

    Parameters
    ----------
    residual : callable
        Value of the constraint (feasible where ≤ 0) at a multiplier; does not increase with it.
    guess : float, positive
    tolerance : float, positive
        Stop when the residual lies in [-tolerance, 0].

    Returns
    -------
    float
        On the feasible side of the root. Where no multiplier within reach is feasible, or every one is, the
        end of the reach.
    """
    start = min(max(math.log(guess), -_LOG_LIMIT), _LOG_LIMIT)
    lowest, highest = max(start - _LOG_REACH, -_LOG_LIMIT), min(start + _LOG_REACH, _LOG_LIMIT)
    value = residual(math.exp(start))
    feasible, infeasible = (start, math.nan) if value <= 0 else (math.nan, start)
    value_feasible = value_infeasible = value
    stride = 0.1
    while math.isnan(feasible) or math.isnan(infeasible):
        if math.isnan(feasible) and infeasible >= highest:
            return math.exp(highest)
        if math.isnan(infeasible) and feasible <= lowest:
            return math.exp(lowest)
        at = min(infeasible + stride, highest) if math.isnan(feasible) else max(feasible - stride, lowest)
        value = residual(math.exp(at))
        if value <= 0:
            feasible, value_feasible = at, value
        else:
            infeasible, value_infeasible = at, value
        stride *= 4.0
    last = 0
    for _ in range(100):
        if value_feasible >= -tolerance or feasible - infeasible < 1e-12 * max(1.0, abs(feasible)):
            break
        # The target is the middle of the tolerated interval, not its end.
        share = (value_infeasible + tolerance / 2) / (value_infeasible - value_feasible)
        at = infeasible + min(max(share, 1e-4), 0.9999) * (feasible - infeasible)
        value = residual(math.exp(at))
        if value <= 0:
            feasible, value_feasible = at, value
            if last < 0:
                value_infeasible /= 2
            last = -1
        else:
            infeasible, value_infeasible = at, value
            if last > 0:
                value_feasible /= 2
            last = 1
    return math.exp(feasible)
