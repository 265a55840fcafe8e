from .compound import JoinOptions, Member, generate_row
from .conduction import MIN_DENSITY, VOID, nominal_conductivity, power
from .hexagonal_lattice import tile_size, to_tile
from .layer import TOLERANCE, Step, optimise_layer, plan, problem_at
from .spots import Points, lay_spots, place_around

__all__ = [
    "MIN_DENSITY",
    "TOLERANCE",
    "VOID",
    "JoinOptions",
    "Member",
    "Points",
    "Step",
    "generate_row",
    "lay_spots",
    "nominal_conductivity",
    "optimise_layer",
    "place_around",
    "plan",
    "power",
    "problem_at",
    "tile_size",
    "to_tile",
]
