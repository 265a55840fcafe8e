from .blend import BLENDS, Blender, blending_of
from .mixing import Blend, Blending, Fading

__all__ = [
    "BLENDS",
    "Blend",
    "Blender",
    "Blending",
    "Fading",
    "blending_of",
]
