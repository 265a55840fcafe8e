from .ground_structure import corner_network, pixel_network
from .method import thesis_path
from .options import ThesisOptions

__all__ = [
    "ThesisOptions",
    "corner_network",
    "pixel_network",
    "thesis_path",
]
