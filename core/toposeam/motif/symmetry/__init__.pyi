from .borders import (
    border_visibility,
    compared_distance,
    fade_to_mean,
    line_visibility,
    restore_mass,
)
from .kaleidoscope import GROUPS
from .mirrors import Mirrors
from .rules import (
    GENERATORS,
    HEXAGONAL,
    REPEATS,
    Symmetry,
    check_repeat,
    joint,
    move_onto_axes,
    operations,
    symmetry,
)
from .tiling import extend, period, shift_of, tile

__all__ = [
    "GENERATORS",
    "GROUPS",
    "HEXAGONAL",
    "REPEATS",
    "Mirrors",
    "Symmetry",
    "border_visibility",
    "check_repeat",
    "compared_distance",
    "extend",
    "fade_to_mean",
    "joint",
    "line_visibility",
    "move_onto_axes",
    "operations",
    "period",
    "restore_mass",
    "shift_of",
    "symmetry",
    "tile",
]
