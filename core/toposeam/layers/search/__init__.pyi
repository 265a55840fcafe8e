from .expansion_moves import Choices
from .kept_costs import keep_costs
from .local_search import refine
from .multilevel import minimise
from .options import BEST, Effort, SearchOptions, search_options
from .problem import Problem
from .recutting import recut
from .two_label_band import band_of, costs_at, write_pixels

__all__ = [
    "BEST",
    "Choices",
    "Effort",
    "Problem",
    "SearchOptions",
    "band_of",
    "costs_at",
    "keep_costs",
    "minimise",
    "recut",
    "refine",
    "search_options",
    "write_pixels",
]
