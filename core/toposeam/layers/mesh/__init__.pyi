from .bending import bent
from .equations import flat_meshes, solved
from .lines import find_lines
from .trial import is_seen, reduced_copies, trial_seam

__all__ = [
    "bent",
    "find_lines",
    "flat_meshes",
    "is_seen",
    "reduced_copies",
    "solved",
    "trial_seam",
]
