from .recipe import LARGEST, LAWS, SMALLEST, LayerRecipe, Point, Recipe, pack_base, unpack_base

__all__ = [
    "LARGEST",
    "LAWS",
    "SMALLEST",
    "LayerRecipe",
    "Point",
    "Recipe",
    "pack_base",
    "unpack_base",
]
