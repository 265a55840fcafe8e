"""The history of an optimisation, iteration by iteration, and the reason why it stopped."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt


class Termination(StrEnum):
    """The reason why a method stopped.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 12, 6))
    >>> ts.find_seam(a, b, method="heat").termination is ts.optimize.Termination.SINGLE_LINE
    True
    """

    #: Every flux is 0 or 1: the heat runs along one line.
    SINGLE_LINE = "single line"
    #: The iterations allowed ran out first; the seam is the best cut of the last state.
    ITERATIONS = "iterations exhausted"
    #: The method is direct: it returns the answer without iterating.
    DIRECT = "direct"
    #: The seam was given, not searched for.
    GIVEN = "given"


@dataclass(frozen=True, slots=True, kw_only=True)
class Iteration:
    """The record of one inner iteration.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 12, 6))
    >>> ts.find_seam(a, b, method="heat").history[0].stage
    1
    """

    #: Outer stage J, from 1.
    stage: int
    #: The value being minimised: match-cost-weighted mass, forbidden and outermost interfaces (M_max) left
    #: out.
    objective: float
    #: Thermal compliance θᵀKθ for unit heat; with method heat the size of its flow, a lower bound on the cost
    #: of every seam.
    compliance: float
    #: Upper bound C* on the compliance; NaN where the method has none.
    bound: float
    #: Number of interfaces whose flux exceeds 0.01, N_q.
    n_flux: int
    #: Largest change of a design variable since the iteration before.
    change: float
    #: Unknown temperatures solved for.
    unknowns: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """The densities of one iteration, for the film strip.

    ``right`` is (h, w - 1) and ``down`` (h - 1, w), float32 in [0, 1], one value per pixel interface of the
    overlap's window.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 12, 6))
    >>> frame = ts.find_seam(a, b, record_frames=True).frames[-1]
    >>> frame.down.shape[1] - frame.right.shape[1]
    1
    """

    iteration: int
    stage: int
    right: npt.NDArray[np.float32]
    down: npt.NDArray[np.float32]
