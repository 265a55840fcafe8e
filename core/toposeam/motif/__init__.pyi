from .arrangement import Arrangement, arrange, random_arrangement
from .generate import random_recipe
from .ink.palettes import PALETTES, Palette, palette
from .ink.stroke_edges import EDGES
from .ink.svg import SvgOptions, draw_svg
from .join import JoinedMotifs, border_mismatch, join_motifs
from .motif import Motif, repeat_densities
from .optimise.growth import Growth, grow
from .optimise.layer import Step
from .recipe.recipe import LayerRecipe, Recipe
from .recipe.simplify import simplify
from .recipe.styles import STYLES, Style
from .symmetry.borders import border_visibility
from .symmetry.kaleidoscope import kaleidoscope
from .symmetry.rules import REPEATS
from .variation import restyle, vary

__all__ = [
    "EDGES",
    "PALETTES",
    "REPEATS",
    "STYLES",
    "Arrangement",
    "Growth",
    "JoinedMotifs",
    "LayerRecipe",
    "Motif",
    "Palette",
    "Recipe",
    "Step",
    "Style",
    "SvgOptions",
    "arrange",
    "border_mismatch",
    "border_visibility",
    "draw_svg",
    "grow",
    "join_motifs",
    "kaleidoscope",
    "palette",
    "random_arrangement",
    "random_recipe",
    "repeat_densities",
    "restyle",
    "simplify",
    "vary",
]
