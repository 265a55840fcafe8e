from .blend_reach import STEP, Reach, any_by_steps, within_reach
from .grid import SEAM_CELLS, CutGrid, grown
from .match_cost import LAWS, Law, MatchCost, check_no_reach, match_options
from .natural import CELL
from .overlap import (
    FREE,
    NONE,
    SIDES,
    TOUCHING,
    A,
    B,
    Overlap,
    Side,
    at_its_end,
    between_masks,
    check_core,
    cores,
    neighbours,
    side_by_side,
)
from .posing import as_weights, costs_on, forbid, placed, pose
from .pyramid import expand, expand_part, gaussian, in_runs, reduce
from .seam_problem import M_MAX, SeamProblem, blocked, geometry
from .solution import Solution

__all__ = [
    "CELL",
    "FREE",
    "LAWS",
    "M_MAX",
    "NONE",
    "SEAM_CELLS",
    "SIDES",
    "STEP",
    "TOUCHING",
    "A",
    "B",
    "CutGrid",
    "Law",
    "MatchCost",
    "Overlap",
    "Reach",
    "SeamProblem",
    "Side",
    "Solution",
    "any_by_steps",
    "as_weights",
    "at_its_end",
    "between_masks",
    "blocked",
    "check_core",
    "check_no_reach",
    "cores",
    "costs_on",
    "expand",
    "expand_part",
    "forbid",
    "gaussian",
    "geometry",
    "grown",
    "in_runs",
    "match_options",
    "neighbours",
    "placed",
    "pose",
    "reduce",
    "side_by_side",
    "within_reach",
]
