from .near_copies import NEAR
from .options import VARIED, LayKeywords, LayOptions
from .patch_placer import ClosedPatch, PatchPlacer
from .request import TextureRequest

__all__ = [
    "NEAR",
    "VARIED",
    "ClosedPatch",
    "LayKeywords",
    "LayOptions",
    "PatchPlacer",
    "TextureRequest",
]
