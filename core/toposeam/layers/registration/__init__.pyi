from .align import Aligned, correlations
from .bundle_adjustment import adjust_cameras, adjust_plane, left_over
from .consensus import evidence_of, without_contradictions
from .features import find_features
from .find_places import PlaceOptions, among, found_places
from .homography import applied
from .pair_matching import Match
from .perspective import View, camera_transforms, plane_transforms
from .placement import MODELS, VISIBLE_PX, Placement, Residual, large_canvas

__all__ = [
    "MODELS",
    "VISIBLE_PX",
    "Aligned",
    "Match",
    "PlaceOptions",
    "Placement",
    "Residual",
    "View",
    "adjust_cameras",
    "adjust_plane",
    "among",
    "applied",
    "camera_transforms",
    "correlations",
    "evidence_of",
    "find_features",
    "found_places",
    "large_canvas",
    "left_over",
    "plane_transforms",
    "without_contradictions",
]
