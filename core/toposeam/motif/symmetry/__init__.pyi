from .borders import (
    border_edges,
    border_visibility,
    compared_distance,
    edge_visibility,
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
    fits_twice,
    joint,
    move_onto_axes,
    operations,
    symmetry,
)
from .tiling import Placed, Scalar, copy_at, extend, lines_of_copies, period, shift_of, tile

__all__ = [
    "GENERATORS",
    "GROUPS",
    "HEXAGONAL",
    "REPEATS",
    "Mirrors",
    "Placed",
    "Scalar",
    "Symmetry",
    "border_edges",
    "border_visibility",
    "check_repeat",
    "compared_distance",
    "copy_at",
    "edge_visibility",
    "extend",
    "fade_to_mean",
    "fits_twice",
    "joint",
    "line_visibility",
    "lines_of_copies",
    "move_onto_axes",
    "operations",
    "period",
    "restore_mass",
    "shift_of",
    "symmetry",
    "tile",
]
