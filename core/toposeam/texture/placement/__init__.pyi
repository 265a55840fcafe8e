from .near_copies import NEAR
from .options import LayKeywords, LayOptions
from .patch_placer import ClosedPatch, PatchPlacer
from .request import TextureRequest

__all__ = [
    "NEAR",
    "ClosedPatch",
    "LayKeywords",
    "LayOptions",
    "PatchPlacer",
    "TextureRequest",
]
