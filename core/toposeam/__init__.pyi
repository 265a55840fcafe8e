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
from .motif.generate import generate_motif, random_recipe
from .motif.join import JoinedMotifs, arrange, border_mismatch, join_motifs, random_arrangement
from .motif.layer import Step
from .motif.motif import Motif, repeat, repeat_densities
from .motif.palettes import PALETTES, Palette, palette
from .motif.recipe import LayerRecipe, Recipe
from .motif.symmetry import REPEATS
from .optimize.history import Frame, Iteration, Termination
from .path.plan import PathIteration, PathOptions, PlannedPath, path_cost, plan_path
from .seam.find import METHODS, Method, find_seam
from .seam.heat import HeatOptions
from .seam.match_cost import MatchCost
from .seam.overlap import SIDES, Side
from .seam.seam import Seam
from .seam.thesis import ThesisOptions
from .texture.fill import fill, make_tileable
from .texture.lay import LayOptions
from .texture.synthesis import Synthesis, apply_coordinates
from .texture.synthesize import Tileable, synthesize
from .vector.polyline import Polyline
from .vector.svg import SvgSeam, read_svg

__version__: str

__all__ = [
    "BLENDS",
    "MAX_PIXELS",
    "METHODS",
    "PALETTES",
    "REPEATS",
    "SIDES",
    "Aligned",
    "Blend",
    "Frame",
    "HeatOptions",
    "ImageError",
    "Iteration",
    "JoinedMotifs",
    "LayOptions",
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
    "PathIteration",
    "PathOptions",
    "PlannedPath",
    "Polyline",
    "Recipe",
    "Seam",
    "Side",
    "SolverError",
    "Step",
    "Stitched",
    "SvgSeam",
    "Synthesis",
    "Termination",
    "ThesisOptions",
    "Tileable",
    "TopoSeamError",
    "align",
    "apply_coordinates",
    "arrange",
    "border_mismatch",
    "common_canvas",
    "fill",
    "find_seam",
    "generate_motif",
    "join_motifs",
    "make_tileable",
    "pair_name",
    "palette",
    "path_cost",
    "plan_path",
    "random_arrangement",
    "random_recipe",
    "read_svg",
    "repeat",
    "repeat_densities",
    "stitch",
    "synthesize",
]
