from .object_exchange import make_objects_whole
from .scattered_objects import ScatteredObjects, find_scattered, lay_scattered

__all__ = [
    "ScatteredObjects",
    "find_scattered",
    "lay_scattered",
    "make_objects_whole",
]
