from .object_exchange import make_objects_whole
from .scattered_objects import ScatteredObjects, atlas_without, find_scattered, lay_scattered

__all__ = [
    "ScatteredObjects",
    "atlas_without",
    "find_scattered",
    "lay_scattered",
    "make_objects_whole",
]
