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
from .optimize.history import Frame, Iteration, Termination
from .seam.find import METHODS, Method, find_seam
from .seam.heat import HeatOptions
from .seam.match_cost import MatchCost
from .seam.overlap import SIDES, Side
from .seam.seam import Seam
from .seam.thesis import ThesisOptions
from .texture.fill import fill, make_tileable
from .texture.lay import LayOptions
from .texture.synthesis import Synthesis
from .texture.synthesize import Tileable, synthesize
from .vector.polyline import Polyline
from .vector.svg import read_svg

__version__: str

__all__ = [
    "MAX_PIXELS",
    "METHODS",
    "SIDES",
    "Frame",
    "HeatOptions",
    "ImageError",
    "Iteration",
    "LayOptions",
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
    "Synthesis",
    "Termination",
    "ThesisOptions",
    "Tileable",
    "TopoSeamError",
    "common_canvas",
    "fill",
    "find_seam",
    "make_tileable",
    "read_svg",
    "stitch",
    "synthesize",
]
