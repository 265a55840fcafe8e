from .box_search import best_box
from .fit import fitted_boundary, fitted_box, laid_in_memory
from .ground import HOLE, BorderGround, ground_of, prices_of
from .reduced import Overview, overview

__all__ = [
    "HOLE",
    "BorderGround",
    "Overview",
    "best_box",
    "fitted_boundary",
    "fitted_box",
    "ground_of",
    "laid_in_memory",
    "overview",
    "prices_of",
]
