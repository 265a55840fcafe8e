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
from toposeam.seam.find import METHODS, find_seam
from toposeam.seam.heat import HeatOptions
from toposeam.seam.match_cost import MatchCost
from toposeam.seam.seam import Seam
from toposeam.seam.thesis import ThesisOptions
from toposeam.stitch.composite import Stitched, stitch
from toposeam.stitch.layers import Layer
from toposeam.vector.polyline import Polyline

__version__ = "0.1.0"

__all__ = [
    "METHODS",
    "Frame",
    "HeatOptions",
    "ImageError",
    "Iteration",
    "Layer",
    "MatchCost",
    "MissingPackageError",
    "OptionError",
    "OverlapError",
    "PathError",
    "Polyline",
    "Seam",
    "SolverError",
    "Stitched",
    "Termination",
    "ThesisOptions",
    "TopoSeamError",
    "find_seam",
    "stitch",
]
