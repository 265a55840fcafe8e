from .recipe import LAWS, MAX_SIDE, MIN_SIDE, LayerRecipe, Point, Recipe, pack_base, unpack_base
from .styles import STYLES, Style, draw_rule, styles_of

__all__ = [
    "LAWS",
    "MAX_SIDE",
    "MIN_SIDE",
    "STYLES",
    "LayerRecipe",
    "Point",
    "Recipe",
    "Style",
    "draw_rule",
    "pack_base",
    "styles_of",
    "unpack_base",
]
