"""Heat of a network gathered along its cheapest cut, step by step, and what is told of the steps."""

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

#: An interface with less flux does not belong to the heat path (thesis, q_threshold).
FLUX_THRESHOLD = 0.01
#: ``soft`` is the last potential whose cost exceeded what is proven by this share.
SOFT = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class Heat:
    """What Newton steps on a network ended in."""

    #: (n + 2,) bool, the hot side of the cheapest cut that was seen.
    hot: npt.NDArray[np.bool_]
    #: (n + 2,) potential of the last step whose cost exceeded what is proven by 10 %.
    soft: Floats
    #: (E,) flux of the last step.
    flux: Floats
    #: What no cut can undercut.
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
    """Newton steps until the heat of a network has gathered along its cheapest cut.

    Parameters
    ----------
    network : Network
    cost : (E,) float64 array
        What it costs to divide the nodes of each element.
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
    raised = float(np.maximum(state.cost - cost, 0.0).sum())  # no flow may use what is only lent
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
        if objective > (1 + SOFT) * bound:
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
