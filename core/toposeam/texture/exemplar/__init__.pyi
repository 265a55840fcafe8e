from .atlas import Atlas, values_at
from .landmarks import add_guard, find_landmarks
from .mirror_narrow import widened
from .patch_search import PatchSearch, box_sum, reduced, refined, whole
from .scale import SMALLEST_PATCH, autocorrelation, coarse_patch, natural_patch, patch_for
from .sources import UNSEEN_STEP, DataRange, Images, Sources, as_list, check_varied, read_sources, white_of
from .turns import TURNS, Turns, count_of, turned, turned_sources

__all__ = [
    "SMALLEST_PATCH",
    "TURNS",
    "UNSEEN_STEP",
    "Atlas",
    "DataRange",
    "Images",
    "PatchSearch",
    "Sources",
    "Turns",
    "add_guard",
    "as_list",
    "autocorrelation",
    "box_sum",
    "check_varied",
    "coarse_patch",
    "count_of",
    "find_landmarks",
    "natural_patch",
    "patch_for",
    "read_sources",
    "reduced",
    "refined",
    "turned",
    "turned_sources",
    "values_at",
    "white_of",
    "whole",
    "widened",
]
