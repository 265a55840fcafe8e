from .block_surface import COARSE_SHARE, block_costs, block_sides, coarse_labels, coarse_span
from .levels import refine
from .method import SurfaceKeywords, SurfaceOptions, dilate, heat_surface

__all__ = [
    "COARSE_SHARE",
    "SurfaceKeywords",
    "SurfaceOptions",
    "block_costs",
    "block_sides",
    "coarse_labels",
    "coarse_span",
    "dilate",
    "heat_surface",
    "refine",
]
