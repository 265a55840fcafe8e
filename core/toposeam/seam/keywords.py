"""The options of the seam methods as keywords, for type checkers and editors."""

from __future__ import annotations

from typing import Literal, TypedDict


class SeamKeywords(TypedDict, total=False):
    """Fields of `HeatOptions` and `ThesisOptions`."""

    tolerance: float
    max_iterations: int
    formulation: Literal[1, 2]
    penalty: float
    first_penalty: float
    exponent: float
    start: float
    least_density: float
    stages: int
    first_iterations: int
    stage_iterations: int
    q_threshold: float
    least_flux: float
    length_term: float
    move: float
    asymptotes: Literal["curvature", "moving"]
    overshoot: float
    dead: float
    uneven: float
    reachable: bool
    harden: bool
    mass: float | None
