from .display import to_pil
from .errors import (
    ImageError,
    MissingPackageError,
    OptionError,
    OverlapError,
    PathError,
    SolverError,
    TopoSeamError,
)
from .images import MAX_PIXELS, Windows
from .layers.align import Aligned, align, correlations
from .layers.blend import BLENDS, Blend
from .layers.compose import compose
from .layers.composite import Stitched, pair_name, stitch
from .layers.composition import Composition
from .layers.layer import Layer, common_canvas
from .layers.overlapping import overlapping
from .layers.placing import Placement, find_places
from .layers.restitch import restitch
from .layers.tones import match_tones
from .layers.turning import placed
from .motif.arrange import Arrangement, arrange, random_arrangement
from .motif.borders import border_visibility
from .motif.edges import EDGES
from .motif.generate import generate_motif, random_recipe
from .motif.join import JoinedMotifs, border_mismatch, join_motifs
from .motif.kaleidoscope import kaleidoscope
from .motif.layer import Step
from .motif.motif import Motif, repeat, repeat_densities
from .motif.palettes import PALETTES, Palette, palette
from .motif.recipe import LayerRecipe, Recipe
from .motif.simplify import simplify
from .motif.svg import SvgOptions, draw_svg
from .motif.symmetry import REPEATS
from .motif.vary import vary
from .optimize.history import Frame, Iteration, Termination
from .path.gather import PathIteration, PathOptions
from .path.plan import PlannedPath, path_cost, plan_path
from .seam.drawing import draw_seams
from .seam.find import METHODS, Method, find_seam
from .seam.heat import HeatOptions
from .seam.likeness import seam_verdict
from .seam.match_cost import LAWS, Law, MatchCost
from .seam.overlap import SIDES, Side
from .seam.seam import Seam, apply_paths
from .seam.thesis_options import ThesisOptions
from .seam.verdict import Verdict
from .solid.generate import Solid, generate_solid
from .texture.fill import BYS, By, fill
from .texture.keeping_step import closing_size
from .texture.lay_options import LayOptions
from .texture.light import flatten_light
from .texture.scale import natural_patch
from .texture.synthesis import Synthesis, apply_coordinates
from .texture.synthesize import synthesize
from .texture.tile import make_tileable
from .texture.tileable import TILEABLE, Tileable
from .texture.turning import TURNS, Turns
from .vector.polyline import Polyline
from .vector.smooth import SmoothPath, smooth_path
from .vector.svg import SvgSeam, read_svg
from .volume.find import SURFACE_METHODS, SurfaceMethod, find_surface
from .volume.heat import SurfaceOptions
from .volume.join import JoinedVolume, join_volumes
from .volume.loop import Loop, loop
from .volume.mesh import Mesh
from .volume.period import Jump
from .volume.surface import Surface

__version__: str

__all__ = [
    "BLENDS",
    "BYS",
    "EDGES",
    "LAWS",
    "MAX_PIXELS",
    "METHODS",
    "PALETTES",
    "REPEATS",
    "SIDES",
    "SURFACE_METHODS",
    "TILEABLE",
    "TURNS",
    "Aligned",
    "Arrangement",
    "Blend",
    "By",
    "Composition",
    "Frame",
    "HeatOptions",
    "ImageError",
    "Iteration",
    "JoinedMotifs",
    "JoinedVolume",
    "Jump",
    "Law",
    "LayOptions",
    "Layer",
    "LayerRecipe",
    "Loop",
    "MatchCost",
    "Mesh",
    "Method",
    "MissingPackageError",
    "Motif",
    "OptionError",
    "OverlapError",
    "Palette",
    "PathError",
    "PathIteration",
    "PathOptions",
    "Placement",
    "PlannedPath",
    "Polyline",
    "Recipe",
    "Seam",
    "Side",
    "SmoothPath",
    "Solid",
    "SolverError",
    "Step",
    "Stitched",
    "Surface",
    "SurfaceMethod",
    "SurfaceOptions",
    "SvgOptions",
    "SvgSeam",
    "Synthesis",
    "Termination",
    "ThesisOptions",
    "Tileable",
    "TopoSeamError",
    "Turns",
    "Verdict",
    "Windows",
    "align",
    "apply_coordinates",
    "apply_paths",
    "arrange",
    "border_mismatch",
    "border_visibility",
    "closing_size",
    "common_canvas",
    "compose",
    "correlations",
    "draw_seams",
    "draw_svg",
    "fill",
    "find_places",
    "find_seam",
    "find_surface",
    "flatten_light",
    "generate_motif",
    "generate_solid",
    "join_motifs",
    "join_volumes",
    "kaleidoscope",
    "loop",
    "make_tileable",
    "match_tones",
    "natural_patch",
    "overlapping",
    "pair_name",
    "palette",
    "path_cost",
    "placed",
    "plan_path",
    "random_arrangement",
    "random_recipe",
    "read_svg",
    "repeat",
    "repeat_densities",
    "restitch",
    "seam_verdict",
    "simplify",
    "smooth_path",
    "stitch",
    "synthesize",
    "to_pil",
    "vary",
]
