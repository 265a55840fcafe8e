from .mixing import mix
from .palettes import PALETTES, Palette, palette
from .printing import MAX_PATTERN, Inked, checked_size
from .sampling import resample
from .stroke_edges import EDGES, beyond, fineness, level, printed, shading
from .stroke_repair import mended
from .svg import SvgOptions, check_counts, draw_svg

__all__ = [
    "EDGES",
    "MAX_PATTERN",
    "PALETTES",
    "Inked",
    "Palette",
    "SvgOptions",
    "beyond",
    "check_counts",
    "checked_size",
    "draw_svg",
    "fineness",
    "level",
    "mended",
    "mix",
    "palette",
    "printed",
    "resample",
    "shading",
]
