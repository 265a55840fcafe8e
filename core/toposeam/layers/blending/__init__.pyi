from .blend import BLENDS, Blend, Blender, Blending, Fading, blending_of

__all__ = [
    "BLENDS",
    "Blend",
    "Blender",
    "Blending",
    "Fading",
    "blending_of",
]
