from .composition import WINDOW_BLOCKS, Composition
from .options import MOST_BENT, StitchOptions
from .recutting import restitch
from .seams import SeamOutline, steps_along
from .sinks import ArraySink, Sink
from .stitching import composed_of_masks, stitch
from .summary import pair_name, seams_svg

__all__ = [
    "MOST_BENT",
    "WINDOW_BLOCKS",
    "ArraySink",
    "Composition",
    "SeamOutline",
    "Sink",
    "StitchOptions",
    "composed_of_masks",
    "pair_name",
    "restitch",
    "seams_svg",
    "steps_along",
    "stitch",
]
