from .gains import match_tones
from .linear_light import encoded

__all__ = [
    "encoded",
    "match_tones",
]
