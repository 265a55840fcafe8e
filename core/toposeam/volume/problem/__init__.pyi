from .arrays import as_shares, as_volume
from .canvas import Places, place_stacks
from .posing import check_spacing, face_areas, match_costs
from .surface_problem import SurfaceProblem

__all__ = [
    "Places",
    "SurfaceProblem",
    "as_shares",
    "as_volume",
    "check_spacing",
    "face_areas",
    "match_costs",
    "place_stacks",
]
