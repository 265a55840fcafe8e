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
from .motif.generate import generate_motif, random_recipe
from .motif.join import JoinedMotifs, arrange, border_mismatch, join_motifs, random_arrangement
from .motif.layer import Step
from .motif.motif import Motif, repeat, repeat_densities
from .motif.palettes import PALETTES, Palette, palette
from .motif.recipe import LayerRecipe, Recipe
from .motif.symmetry import REPEATS
from .optimize.history import Frame, Iteration, Termination
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
    "REPEATS",
    "SIDES",
    "Frame",
    "HeatOptions",
    "ImageError",
    "Iteration",
    "JoinedMotifs",
    "Layer",
    "LayerRecipe",
    "MatchCost",
    "Method",
    "MissingPackageError",
    "Motif",
    "OptionError",
    "OverlapError",
    "Palette",
    "PathError",
    "Polyline",
    "Recipe",
    "Seam",
    "Side",
    "SolverError",
    "Step",
    "Stitched",
    "Termination",
    "ThesisOptions",
    "TopoSeamError",
    "arrange",
    "border_mismatch",
    "common_canvas",
    "find_seam",
    "generate_motif",
    "join_motifs",
    "palette",
    "random_arrangement",
    "random_recipe",
    "read_svg",
    "repeat",
    "repeat_densities",
    "stitch",
]
