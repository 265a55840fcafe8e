from .process_pool import MAX_PROCESSES, Crew
from .raster import SMALLEST_TILE, lay_all, patches_along, patches_on, shape_on
from .wavefronts import At, lay_wave

__all__ = [
    "MAX_PROCESSES",
    "SMALLEST_TILE",
    "At",
    "Crew",
    "lay_all",
    "lay_wave",
    "patches_along",
    "patches_on",
    "shape_on",
]
