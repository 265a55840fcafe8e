"""What type checkers know of the rooms that are called: the function, and everything else that they offer."""

from toposeam.motif.animation import animate as _animate
from toposeam.motif.arrangement import arrange as _arrange
from toposeam.motif.arrangement import random_arrangement as _random_arrangement
from toposeam.motif.generate import motif as _motif
from toposeam.motif.generate import random_recipe as _random_recipe
from toposeam.motif.ink.palettes import palette as _palette
from toposeam.motif.ink.svg import draw_svg as _draw_svg
from toposeam.motif.join import border_mismatch as _border_mismatch
from toposeam.motif.join import join_motifs as _join_motifs
from toposeam.motif.motif import repeat_densities as _repeat_densities
from toposeam.motif.optimise.growth import grow as _grow
from toposeam.motif.recipe.composition import places_in_drawing as _places_in_drawing
from toposeam.motif.recipe.composition import places_in_picture as _places_in_picture
from toposeam.motif.recipe.simplify import simplify as _simplify
from toposeam.motif.symmetry.borders import border_edges as _border_edges
from toposeam.motif.symmetry.borders import border_visibility as _border_visibility
from toposeam.motif.symmetry.kaleidoscope import kaleidoscope as _kaleidoscope
from toposeam.motif.variation import restyle as _restyle
from toposeam.motif.variation import vary as _vary
from toposeam.path.plan import path as _path
from toposeam.path.plan import path_cost as _path_cost
from toposeam.volume.join import volume as _volume

class MotifVerb:
    from toposeam.motif.animation import Animation
    from toposeam.motif.arrangement import Arrangement
    from toposeam.motif.ink.palettes import PALETTES, Palette
    from toposeam.motif.ink.stroke_edges import EDGES
    from toposeam.motif.ink.svg import SvgOptions
    from toposeam.motif.join import JoinedMotifs
    from toposeam.motif.motif import Motif
    from toposeam.motif.optimise.growth import Growth
    from toposeam.motif.optimise.layer import Step
    from toposeam.motif.recipe.composition import OUTLINES
    from toposeam.motif.recipe.recipe import LayerRecipe, Recipe
    from toposeam.motif.recipe.styles import STYLES, Style
    from toposeam.motif.symmetry.rules import REPEATS

    __call__ = staticmethod(_motif)
    animate = staticmethod(_animate)
    arrange = staticmethod(_arrange)
    border_edges = staticmethod(_border_edges)
    border_mismatch = staticmethod(_border_mismatch)
    border_visibility = staticmethod(_border_visibility)
    draw_svg = staticmethod(_draw_svg)
    grow = staticmethod(_grow)
    join_motifs = staticmethod(_join_motifs)
    kaleidoscope = staticmethod(_kaleidoscope)
    palette = staticmethod(_palette)
    places_in_drawing = staticmethod(_places_in_drawing)
    places_in_picture = staticmethod(_places_in_picture)
    random_arrangement = staticmethod(_random_arrangement)
    random_recipe = staticmethod(_random_recipe)
    repeat_densities = staticmethod(_repeat_densities)
    restyle = staticmethod(_restyle)
    simplify = staticmethod(_simplify)
    vary = staticmethod(_vary)

class VolumeVerb:
    from toposeam.volume.clip.period import Jump
    from toposeam.volume.clip.result import Loop
    from toposeam.volume.clip.verdict import LoopVerdict
    from toposeam.volume.find import SURFACE_METHODS
    from toposeam.volume.heat.method import SurfaceOptions
    from toposeam.volume.join import JoinedVolume
    from toposeam.volume.mesh import Mesh
    from toposeam.volume.surface import Surface
    from toposeam.volume.verdict import SurfaceVerdict

    __call__ = staticmethod(_volume)

class PathVerb:
    from toposeam.path.gather import PathIteration, PathOptions
    from toposeam.path.plan import PlannedPath

    __call__ = staticmethod(_path)
    path_cost = staticmethod(_path_cost)

def called(room: str, module: str, function: str) -> None: ...
