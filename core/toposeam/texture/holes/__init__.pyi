from .crossing_lines import CrossingBand, crossing_bands, kept_by, strips_of
from .hole_window import Holed, read_holed
from .homogeneity import is_texture
from .shift_candidates import candidate_shifts
from .shift_map_moves import Ground, ShiftMoves

__all__ = [
    "CrossingBand",
    "Ground",
    "Holed",
    "ShiftMoves",
    "candidate_shifts",
    "crossing_bands",
    "is_texture",
    "kept_by",
    "read_holed",
    "strips_of",
]
