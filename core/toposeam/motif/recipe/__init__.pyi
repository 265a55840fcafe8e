from .composition import OUTLINES, pack_guide, pack_outline, places_in_drawing, places_in_picture
from .recipe import (
    LAWS,
    MAX_SIDE,
    MIN_SIDE,
    ONE_PIECE,
    PLACES,
    LayerRecipe,
    Point,
    Recipe,
    pack_base,
    unpack_base,
)
from .styles import STYLES, Style, draw_rule, styles_of

__all__ = [
    "LAWS",
    "MAX_SIDE",
    "MIN_SIDE",
    "ONE_PIECE",
    "OUTLINES",
    "PLACES",
    "STYLES",
    "LayerRecipe",
    "Point",
    "Recipe",
    "Style",
    "draw_rule",
    "pack_base",
    "pack_guide",
    "pack_outline",
    "places_in_drawing",
    "places_in_picture",
    "styles_of",
    "unpack_base",
]
