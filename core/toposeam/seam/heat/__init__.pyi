from .method import HeatOptions, heat_path, potential_beside
from .newton import Heat, gather_heat

__all__ = [
    "Heat",
    "HeatOptions",
    "gather_heat",
    "heat_path",
    "potential_beside",
]
