from .compound import JoinOptions, Member, generate_row
from .conduction import MIN_DENSITY, VOID, LayerProblem, nominal_conductivity, power
from .hexagonal_lattice import HexagonalProblem, refined, tile_size, to_tile
from .layer import TOLERANCE, Step, on_outline, optimise_layer, outline_on_cell, plan, problem_at
from .spot_layout import Points, inside_only, lay_spots, lies_in, place_around, spots

__all__ = [
    "MIN_DENSITY",
    "TOLERANCE",
    "VOID",
    "HexagonalProblem",
    "JoinOptions",
    "LayerProblem",
    "Member",
    "Points",
    "Step",
    "generate_row",
    "inside_only",
    "lay_spots",
    "lies_in",
    "nominal_conductivity",
    "on_outline",
    "optimise_layer",
    "outline_on_cell",
    "place_around",
    "plan",
    "power",
    "problem_at",
    "refined",
    "spots",
    "tile_size",
    "to_tile",
]
