"""Newton steps that gather the heat of a network along its cheapest cut, and the record of these steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats
from toposeam.errors import SolverError
from toposeam.heat.network import Network
from toposeam.heat.primal_dual import PrimalDual
from toposeam.optimize.history import Iteration, Termination

#: Least flux, of a total of 1, of an interface on the heat path (thesis, q_threshold).
FLUX_THRESHOLD = 0.01
#: Gap between a potential's cost and the bound, as a share of the bound, above which the potential is still
#: soft: ``soft`` is the last such one.
SOFT_GAP = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Heat:
    """The state of a network after Newton steps."""

    #: (n + 2,) bool, the hot side of the cheapest cut found.
    hot: npt.NDArray[np.bool_]
    #: (n + 2,) potential of the last step whose cost exceeded the bound by more than 10 %.
    soft: Floats
    #: (E,) flux of the last step.
    flux: Floats
    #: Lower bound on the cost of every cut.
    bound: float
    history: tuple[Iteration, ...]
    termination: Termination


def gather_heat(
    network: Network,
    cost: Floats,
    tolerance: float,
    most: int,
    multiplicity: Floats | None = None,
    watch: Callable[[Floats, int, bool], None] | None = None,
) -> Heat:
    """Take Newton steps until the heat of a network has gathered along its cheapest cut.

    Parameters
    ----------
    network : Network
    cost : (E,) float64 array
        Cost of dividing the two nodes of each element.
    tolerance : float
        The steps end when no cut can be cheaper by more than this share.
    most : int
        Steps at most.
    multiplicity : (E,) float64 array, optional
        How many interfaces each element stands for; one by default.
    watch : callable, optional
        Called with the potential of each step, the step's number from 0, and whether it is the last one.
    """
    hot = np.append(np.zeros(network.n, bool), [False, True])
    soft, flux = hot.astype(np.float64), np.ones(len(cost))
    if not network.n:
        return Heat(hot, soft, flux, 0.0, (), Termination.SINGLE_LINE)
    history: list[Iteration] = []
    termination = Termination.ITERATIONS
    state = PrimalDual(network, cost)
    soft = state.potential
    raised = float(np.maximum(state.cost - cost, 0.0).sum())  # the flow may exceed the given costs by this
    bound, cheapest = 0.0, np.inf
    for step in range(most):
        cut, threshold = state.best_cut()
        if cut < cheapest:
            cheapest, hot = cut, state.potential > threshold
        size = state.bound
        bound = max(bound, size - raised)
        new = np.abs(state.jump)
        objective = float(state.cost @ new)
        used = new > FLUX_THRESHOLD
        history.append(
            Iteration(
                stage=1,
                objective=objective,
                compliance=size,
                bound=float("nan"),
                n_flux=int(np.count_nonzero(used) if multiplicity is None else multiplicity @ used),
                change=float(np.abs(new - flux).max()),
                unknowns=network.n,
            )
        )
        flux = new
        if objective > (1 + SOFT_GAP) * bound:
            soft = state.potential
        proven = cheapest <= (1 + tolerance) * bound
        if watch is not None:
            watch(state.potential, step, proven)
        if proven:
            termination = Termination.SINGLE_LINE
            break
        try:
            state.step()
        except SolverError:
            break  # double precision ends here; the best cut so far stands
    return Heat(hot, soft, flux, bound, tuple(history), termination)
