from .copy_borders import ROWS, joints
from .index_canvas import IndexCanvas
from .places import Guide, Offers, Penalty, PlaceGrid, Site
from .progress import Previews, Report, stage, together
from .rendering import MAX_SMOOTH, Lift, near_seams, render, render_normals, render_seen
from .synthesis import Synthesis, apply_coordinates
from .tileable import TILEABLE, Tileable, wraps_of
from .visible_joints import FEW, JointSteps, JointVerdict, busyness, middle_of

__all__ = [
    "FEW",
    "MAX_SMOOTH",
    "ROWS",
    "TILEABLE",
    "Guide",
    "IndexCanvas",
    "JointSteps",
    "JointVerdict",
    "Lift",
    "Offers",
    "Penalty",
    "PlaceGrid",
    "Previews",
    "Report",
    "Site",
    "Synthesis",
    "Tileable",
    "apply_coordinates",
    "busyness",
    "joints",
    "middle_of",
    "near_seams",
    "render",
    "render_normals",
    "render_seen",
    "stage",
    "together",
    "wraps_of",
]
