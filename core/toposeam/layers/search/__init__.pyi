from .expansion_moves import Choices
from .local_search import find_potentials, refine
from .multilevel import minimise
from .options import BEST, Effort, SearchOptions, search_options
from .problem import Problem, Report, State
from .two_label_band import SeamHeat, band_of, costs_at, write_pixels

__all__ = [
    "BEST",
    "Choices",
    "Effort",
    "Problem",
    "Report",
    "SeamHeat",
    "SearchOptions",
    "State",
    "band_of",
    "costs_at",
    "find_potentials",
    "minimise",
    "refine",
    "search_options",
    "write_pixels",
]
