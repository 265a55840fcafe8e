from .align import Aligned, correlations
from .alignments import cheapest
from .bundle_adjustment import adjust_cameras, adjust_plane, left_over
from .consensus import evidence_of, without_contradictions
from .features import find_features
from .find_places import PlaceOptions, Places, among, found_places
from .homography import applied
from .pair_matching import Match
from .perspective import View, camera_transforms, plane_transforms
from .placement import MODELS, VISIBLE_PX, Placement, Residual, large_canvas
from .planes import find_planes, together_verified

__all__ = [
    "MODELS",
    "VISIBLE_PX",
    "Aligned",
    "Match",
    "PlaceOptions",
    "Placement",
    "Places",
    "Residual",
    "View",
    "adjust_cameras",
    "adjust_plane",
    "among",
    "applied",
    "camera_transforms",
    "cheapest",
    "correlations",
    "evidence_of",
    "find_features",
    "find_planes",
    "found_places",
    "large_canvas",
    "left_over",
    "plane_transforms",
    "together_verified",
    "without_contradictions",
]
