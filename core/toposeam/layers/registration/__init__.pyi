from .align import Aligned, correlations
from .alignments import cheapest
from .bundle_adjustment import adjust_cameras, adjust_plane, left_over
from .consensus import evidence_of, without_contradictions
from .features import describe_picture, find_features
from .find_places import PlaceOptions, Places, among, found_places
from .given_points import matches_of
from .homography import applied
from .pair_matching import Match, find_patches
from .perspective import Lens, View, camera_transforms, fit_models, plane_transforms
from .placement import MODELS, VISIBLE_PX, Placement, Residual, large_canvas, moved_camera, weakly_held
from .planes import find_planes, together_verified

__all__ = [
    "MODELS",
    "VISIBLE_PX",
    "Aligned",
    "Lens",
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
    "describe_picture",
    "evidence_of",
    "find_features",
    "find_patches",
    "find_planes",
    "fit_models",
    "found_places",
    "large_canvas",
    "left_over",
    "matches_of",
    "moved_camera",
    "plane_transforms",
    "together_verified",
    "weakly_held",
    "without_contradictions",
]
