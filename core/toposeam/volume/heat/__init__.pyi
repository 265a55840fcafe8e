from .block_surface import COARSE_SHARE, block_costs, block_sides, coarse_labels, coarse_span
from .levels import refined
from .method import SurfaceKeywords, SurfaceOptions, heat_surface, spread

__all__ = [
    "COARSE_SHARE",
    "SurfaceKeywords",
    "SurfaceOptions",
    "block_costs",
    "block_sides",
    "coarse_labels",
    "coarse_span",
    "heat_surface",
    "refined",
    "spread",
]
