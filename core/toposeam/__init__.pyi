from .errors import (
    ImageError,
    MissingPackageError,
    OptionError,
    OverlapError,
    PathError,
    SolverError,
    TopoSeamError,
)
from .layers.align import Aligned, align
from .layers.blend import BLENDS, Blend
from .layers.composite import MAX_PIXELS, Stitched, pair_name, stitch
from .layers.layer import Layer, common_canvas
from .optimize.history import Frame, Iteration, Termination
from .seam.find import METHODS, Method, find_seam
from .seam.heat import HeatOptions
from .seam.match_cost import MatchCost
from .seam.overlap import SIDES, Side
from .seam.seam import Seam
from .seam.thesis import ThesisOptions
from .vector.polyline import Polyline
from .vector.svg import SvgSeam, read_svg

__version__: str

__all__ = [
    "BLENDS",
    "MAX_PIXELS",
    "METHODS",
    "SIDES",
    "Aligned",
    "Blend",
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
    "Polyline",
    "Seam",
    "Side",
    "SolverError",
    "Stitched",
    "SvgSeam",
    "Termination",
    "ThesisOptions",
    "TopoSeamError",
    "align",
    "common_canvas",
    "find_seam",
    "pair_name",
    "read_svg",
    "stitch",
]
