from .blending.blend import BLENDS
from .canvas.canvas import Canvas, common_canvas
from .canvas.resampling import placed
from .canvas.side_by_side import overlapping
from .composite.composition import Composition
from .composite.fitting import fitted
from .composite.options import StitchOptions
from .composite.recutting import restitch
from .composite.sinks import ArraySink, Sink
from .composite.summary import pair_name
from .exposure.gains import match_tones
from .labelling.label_map import LabelMap
from .labelling.problem import Labelling
from .labelling.strokes import Stroke, apply_strokes
from .registration.align import Aligned, align, correlations
from .registration.placement import Placement
from .search.kept_costs import keep_costs
from .search.recutting import recut

__all__ = [
    "BLENDS",
    "Aligned",
    "ArraySink",
    "Canvas",
    "Composition",
    "LabelMap",
    "Labelling",
    "Placement",
    "Sink",
    "StitchOptions",
    "Stroke",
    "align",
    "apply_strokes",
    "common_canvas",
    "correlations",
    "fitted",
    "keep_costs",
    "match_tones",
    "overlapping",
    "pair_name",
    "placed",
    "recut",
    "restitch",
]
