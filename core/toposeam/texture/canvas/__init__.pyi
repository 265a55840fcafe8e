from .copy_borders import ROWS, joints
from .index_canvas import IndexCanvas
from .places import Guide, Offers, Penalty, PlaceGrid, Site
from .progress import Previews, stage, together
from .rendering import MAX_SMOOTH, Lift, near_seams, render, render_normals, render_seen
from .synthesis import Synthesis, apply_coordinates
from .tileable import TILEABLE, Tileable, wraps_of

__all__ = [
    "MAX_SMOOTH",
    "ROWS",
    "TILEABLE",
    "Guide",
    "IndexCanvas",
    "Lift",
    "Offers",
    "Penalty",
    "PlaceGrid",
    "Previews",
    "Site",
    "Synthesis",
    "Tileable",
    "apply_coordinates",
    "joints",
    "near_seams",
    "render",
    "render_normals",
    "render_seen",
    "stage",
    "together",
    "wraps_of",
]
