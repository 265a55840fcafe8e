from .recipe import LAWS, MAX_SIDE, MIN_SIDE, LayerRecipe, Point, Recipe, pack_base, unpack_base

__all__ = [
    "LAWS",
    "MAX_SIDE",
    "MIN_SIDE",
    "LayerRecipe",
    "Point",
    "Recipe",
    "pack_base",
    "unpack_base",
]
