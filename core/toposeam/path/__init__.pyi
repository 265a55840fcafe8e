from .gather import PathIteration, PathOptions
from .plan import PlannedPath, path_cost

__all__ = [
    "PathIteration",
    "PathOptions",
    "PlannedPath",
    "path_cost",
]
