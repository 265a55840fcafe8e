from .compound import JoinOptions, Member, generate_row
from .conduction import VOID, nominal_conductivity, power
from .hexagonal_lattice import tile_size, to_tile
from .layer import THINNEST, TOLERANCE, Step, optimise_layer, plan, problem_at
from .spots import Points, placed_around

__all__ = [
    "THINNEST",
    "TOLERANCE",
    "VOID",
    "JoinOptions",
    "Member",
    "Points",
    "Step",
    "generate_row",
    "nominal_conductivity",
    "optimise_layer",
    "placed_around",
    "plan",
    "power",
    "problem_at",
    "tile_size",
    "to_tile",
]
