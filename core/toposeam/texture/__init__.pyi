from .canvas.synthesis import Synthesis, apply_coordinates
from .canvas.tileable import TILEABLE, Tileable
from .exemplar.scale import natural_patch
from .exemplar.turns import TURNS
from .fill import BYS
from .light.slow_light import flatten_light
from .periodicity.phase import closing_size
from .placement.options import LayOptions

__all__ = [
    "BYS",
    "TILEABLE",
    "TURNS",
    "LayOptions",
    "Synthesis",
    "Tileable",
    "apply_coordinates",
    "closing_size",
    "flatten_light",
    "natural_patch",
]
