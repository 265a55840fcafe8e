"""What a seam method returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Mask
from toposeam.optimize.history import Frame, Iteration, Termination


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """Labels and soft labels on the overlap's window, and how a method got there."""

    labels: Mask
    soft: npt.NDArray[np.float32]
    #: Whether the overlap was not heated whole, so that `soft` says less than it could.
    contracted: bool = False
    #: The engine that ran; empty where it is the method that was asked for.
    method: str = ""
    history: tuple[Iteration, ...] = ()
    frames: tuple[Frame, ...] = ()
    termination: Termination = Termination.DIRECT
    #: What no labelling can undercut, 0 where nothing is proven.
    bound: float = 0.0
