from .apply import labels_from_paths
from .drawing import draw_seams
from .likeness import seam_verdict
from .seam import Seam, apply_paths, knows_potential, potential_on_window, seam_of
from .verdict import (
    HALF_COST,
    SQUARE_PX,
    STEP_REACH,
    UNSEEN,
    Verdict,
    adjoining,
    breaks_at,
    steps_beside,
    verdict_of,
    worst_of,
)

__all__ = [
    "HALF_COST",
    "SQUARE_PX",
    "STEP_REACH",
    "UNSEEN",
    "Seam",
    "Verdict",
    "adjoining",
    "apply_paths",
    "breaks_at",
    "draw_seams",
    "knows_potential",
    "labels_from_paths",
    "potential_on_window",
    "seam_of",
    "seam_verdict",
    "steps_beside",
    "verdict_of",
    "worst_of",
]
