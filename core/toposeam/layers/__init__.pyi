from .blending.blend import BLENDS
from .canvas.layer import common_canvas
from .canvas.resampling import placed
from .canvas.side_by_side import overlapping
from .composite.compose import compose
from .composite.composition import Composition
from .composite.options import StitchOptions
from .composite.restitch import restitch
from .composite.stitch import Stitched, pair_name
from .exposure.gains import match_tones
from .registration.align import Aligned, align, correlations
from .registration.placement import Placement

__all__ = [
    "BLENDS",
    "Aligned",
    "Composition",
    "Placement",
    "StitchOptions",
    "Stitched",
    "align",
    "common_canvas",
    "compose",
    "correlations",
    "match_tones",
    "overlapping",
    "pair_name",
    "placed",
    "restitch",
]
