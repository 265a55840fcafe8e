from .polyline import Polyline
from .smooth import SmoothPath, smooth_path
from .svg import SvgSeam, read_svg

__all__ = [
    "Polyline",
    "SmoothPath",
    "SvgSeam",
    "read_svg",
    "smooth_path",
]
