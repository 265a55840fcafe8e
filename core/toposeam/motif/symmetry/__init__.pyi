from .borders import BESIDE_STROKES, FADE, border_visibility, faded, line_visibility, reach_of, with_mass
from .kaleidoscope import GROUPS
from .mirrors import Mirrors
from .rules import (
    GENERATORS,
    HEXAGONAL,
    REPEATS,
    Symmetry,
    check_repeat,
    joint,
    onto_axes,
    operations,
    symmetry,
)
from .tiling import extend, period, shift_of, tile

__all__ = [
    "BESIDE_STROKES",
    "FADE",
    "GENERATORS",
    "GROUPS",
    "HEXAGONAL",
    "REPEATS",
    "Mirrors",
    "Symmetry",
    "border_visibility",
    "check_repeat",
    "extend",
    "faded",
    "joint",
    "line_visibility",
    "onto_axes",
    "operations",
    "period",
    "reach_of",
    "shift_of",
    "symmetry",
    "tile",
    "with_mass",
]
