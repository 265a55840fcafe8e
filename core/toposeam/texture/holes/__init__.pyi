from .hole_window import Holed, read_holed
from .homogeneity import is_texture
from .shift_candidates import candidate_shifts
from .shift_map_moves import Ground, ShiftMoves

__all__ = [
    "Ground",
    "Holed",
    "ShiftMoves",
    "candidate_shifts",
    "is_texture",
    "read_holed",
]
