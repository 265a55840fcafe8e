"""TopoSeam: join, grow and invent images by heat.

Arrays in, arrays and dataclasses out; files belong to the command line (``toposeam``) and GIMP plug-in.
"""

from toposeam.errors import (
    ImageError,
    MissingPackageError,
    OptionError,
    OverlapError,
    PathError,
    SolverError,
    TopoSeamError,
)
from toposeam.optimize.history import Frame, Iteration, Termination
from toposeam.seam.find import METHODS, Method, find_seam
from toposeam.seam.heat import HeatOptions
from toposeam.seam.match_cost import MatchCost
from toposeam.seam.overlap import SIDES, Side
from toposeam.seam.seam import Seam
from toposeam.seam.thesis import ThesisOptions
from toposeam.stitch.composite import MAX_PIXELS, Stitched, stitch
from toposeam.stitch.layers import Layer, common_canvas
from toposeam.vector.polyline import Polyline
from toposeam.vector.svg import read_svg

__version__ = "0.1.0"

__all__ = [
    "MAX_PIXELS",
    "METHODS",
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
    "read_svg",
    "stitch",
]
