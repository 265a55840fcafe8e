from .arrays import as_shares, as_volume
from .canvas import Places, place_stacks
from .cells import add_prices, brightness, brightness_by_slabs, reach_of, window_sides
from .posing import check_spacing, face_areas, match_costs
from .surface_problem import SurfaceProblem
from .tones import Tones, tones_of

__all__ = [
    "Places",
    "SurfaceProblem",
    "Tones",
    "add_prices",
    "as_shares",
    "as_volume",
    "brightness",
    "brightness_by_slabs",
    "check_spacing",
    "face_areas",
    "match_costs",
    "place_stacks",
    "reach_of",
    "tones_of",
    "window_sides",
]
