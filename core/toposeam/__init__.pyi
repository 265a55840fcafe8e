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
from .layers.blending.blend import BLENDS, Blend
from .layers.canvas.layer import Layer, common_canvas
from .layers.canvas.resampling import placed
from .layers.canvas.side_by_side import overlapping
from .layers.composite.compose import compose
from .layers.composite.composition import Composition
from .layers.composite.restitch import restitch
from .layers.composite.stitch import Stitched, pair_name, stitch
from .layers.exposure.gains import match_tones
from .layers.registration.align import Aligned, align, correlations
from .layers.registration.find_places import find_places
from .layers.registration.placement import Placement
from .motif.arrange import Arrangement, arrange, random_arrangement
from .motif.generate import generate_motif, random_recipe
from .motif.ink.palettes import PALETTES, Palette, palette
from .motif.ink.stroke_edges import EDGES
from .motif.ink.svg import SvgOptions, draw_svg
from .motif.join import JoinedMotifs, border_mismatch, join_motifs
from .motif.motif import Motif, repeat, repeat_densities
from .motif.optimise.layer import Step
from .motif.recipe.recipe import LayerRecipe, Recipe
from .motif.recipe.simplify import simplify
from .motif.recipe.vary import vary
from .motif.symmetry.borders import border_visibility
from .motif.symmetry.kaleidoscope import kaleidoscope
from .motif.symmetry.rules import REPEATS
from .optimize.history import Frame, Iteration, Termination
from .path.gather import PathIteration, PathOptions
from .path.plan import PlannedPath, path_cost, plan_path
from .seam.find import METHODS, Method, find_seam
from .seam.heat.method import HeatOptions
from .seam.problem.match_cost import LAWS, Law, MatchCost
from .seam.problem.overlap import SIDES, Side
from .seam.result.drawing import draw_seams
from .seam.result.likeness import seam_verdict
from .seam.result.seam import Seam, apply_paths
from .seam.result.verdict import Verdict
from .seam.thesis.options import ThesisOptions
from .solid.generate import Solid, generate_solid
from .texture.canvas.synthesis import Synthesis, apply_coordinates
from .texture.canvas.tileable import TILEABLE, Tileable
from .texture.exemplar.scale import natural_patch
from .texture.exemplar.turns import TURNS, Turns
from .texture.fill import BYS, By, fill
from .texture.light.slow_light import flatten_light
from .texture.periodicity.phase import closing_size
from .texture.placement.options import LayOptions
from .texture.synthesize import synthesize
from .texture.tile import make_tileable
from .vector.polyline import Polyline
from .vector.smooth import SmoothPath, smooth_path
from .vector.svg import SvgSeam, read_svg
from .volume.clip.loop import Loop, loop
from .volume.clip.period import Jump
from .volume.clip.verdict import LoopVerdict
from .volume.find import SURFACE_METHODS, SurfaceMethod, find_surface
from .volume.heat.method import SurfaceOptions
from .volume.join import JoinedVolume, join_volumes
from .volume.mesh import Mesh
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
    "LoopVerdict",
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
