from .border_fit import BorderFit, fit_borders
from .canvas.synthesis import Synthesis, apply_coordinates
from .canvas.tileable import TILEABLE, Tileable
from .canvas.visible_joints import JointVerdict
from .corner_tiles import TileSet, tile_set
from .exemplar.scale import natural_patch
from .exemplar.turns import TURNS
from .fill import BYS
from .light.slow_light import flatten_light
from .periodicity.phase import closing_size
from .placement.options import LayOptions
from .setting_trial import SETTINGS

__all__ = [
    "BYS",
    "SETTINGS",
    "TILEABLE",
    "TURNS",
    "BorderFit",
    "JointVerdict",
    "LayOptions",
    "Synthesis",
    "TileSet",
    "Tileable",
    "apply_coordinates",
    "closing_size",
    "fit_borders",
    "flatten_light",
    "natural_patch",
    "tile_set",
]
