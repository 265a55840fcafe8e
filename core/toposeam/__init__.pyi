from .errors import (
    ImageError,
    MissingPackageError,
    OptionError,
    OverlapError,
    PathError,
    SolverError,
    TopoSeamError,
)
from .layers.composite import MAX_PIXELS, Stitched, stitch
from .layers.layer import Layer, common_canvas
from .motif.palette import PALETTES, palette
from .optimize.history import Frame, Iteration, Termination
from .path.plan import PathIteration, PathOptions, PlannedPath, path_cost, plan_path
from .seam.find import METHODS, Method, find_seam
from .seam.heat import HeatOptions
from .seam.match_cost import MatchCost
from .seam.overlap import SIDES, Side
from .seam.seam import Seam
from .seam.thesis import ThesisOptions
from .vector.polyline import Polyline
from .vector.svg import read_svg

__version__: str

__all__ = [
    "MAX_PIXELS",
    "METHODS",
    "PALETTES",
    "SIDES",
    "Frame",
    "HeatOptions",
    "ImageError",
    "Iteration",
    "Layer",
    "MatchCost",
    "Method",
    "MissingPackageError",
    "OptionError",
    "OverlapError",
    "PathError",
    "PathIteration",
    "PathOptions",
    "PlannedPath",
    "Polyline",
    "Seam",
    "Side",
    "SolverError",
    "Stitched",
    "Termination",
    "ThesisOptions",
    "TopoSeamError",
    "common_canvas",
    "find_seam",
    "palette",
    "path_cost",
    "plan_path",
    "read_svg",
    "stitch",
]
