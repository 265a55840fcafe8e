from .compose import shown_as
from .composition import Composition, Outline
from .local_warp import MOST
from .options import StitchOptions
from .stitch import Stitched, pair_name, seams_svg, stitched

__all__ = [
    "MOST",
    "Composition",
    "Outline",
    "StitchOptions",
    "Stitched",
    "pair_name",
    "seams_svg",
    "shown_as",
    "stitched",
]
