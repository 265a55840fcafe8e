from .bending import bent
from .equations import finer, flat_meshes, solved
from .lines import find_lines
from .trial import is_seen, reduced_copies, toned_copies, trial_seam
from .verticals import MOST_PITCH, costs_too_much, down_of, lines_of

__all__ = [
    "MOST_PITCH",
    "bent",
    "costs_too_much",
    "down_of",
    "find_lines",
    "finer",
    "flat_meshes",
    "is_seen",
    "lines_of",
    "reduced_copies",
    "solved",
    "toned_copies",
    "trial_seam",
]
