from .bridging import one_piece
from .mixing import INKINGS, mix
from .palettes import PALETTES, Palette, palette
from .pdf import draw_pdf
from .printing import MAX_PATTERN, Inked, checked_size
from .raster import Raster
from .sampling import resample
from .stroke_edges import EDGES, coverage_beyond, fineness, level, print_layer, stroke_ends
from .stroke_repair import repair_strokes
from .svg import SvgKeywords, SvgOptions, check_counts, draw_frames, draw_svg

__all__ = [
    "EDGES",
    "INKINGS",
    "MAX_PATTERN",
    "PALETTES",
    "Inked",
    "Palette",
    "Raster",
    "SvgKeywords",
    "SvgOptions",
    "check_counts",
    "checked_size",
    "coverage_beyond",
    "draw_frames",
    "draw_pdf",
    "draw_svg",
    "fineness",
    "level",
    "mix",
    "one_piece",
    "palette",
    "print_layer",
    "repair_strokes",
    "resample",
    "stroke_ends",
]
