from .gains import burnt_apart, match_tones, toned_as
from .linear_light import encoded

__all__ = [
    "burnt_apart",
    "encoded",
    "match_tones",
    "toned_as",
]
