from .method import Heat, HeatOptions, gather_heat, heat_path, potential_beside

__all__ = [
    "Heat",
    "HeatOptions",
    "gather_heat",
    "heat_path",
    "potential_beside",
]
