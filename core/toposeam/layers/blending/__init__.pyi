from .blend import BLENDS, Blend, Blender, Fading, Placed, check_blend, reach_of

__all__ = [
    "BLENDS",
    "Blend",
    "Blender",
    "Fading",
    "Placed",
    "check_blend",
    "reach_of",
]
