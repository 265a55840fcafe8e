from .border_light import levelled_borders
from .levelling import levelled, membrane
from .seam_easing import EasedLight, Level, level_for
from .slow_light import CopyLight, flatten_light, flattened, levelled_copies, without_light

__all__ = [
    "CopyLight",
    "EasedLight",
    "Level",
    "flatten_light",
    "flattened",
    "level_for",
    "levelled",
    "levelled_borders",
    "levelled_copies",
    "membrane",
    "without_light",
]
