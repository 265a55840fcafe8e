from .clip.period import Jump
from .clip.result import Loop
from .clip.verdict import LoopVerdict
from .find import SURFACE_METHODS
from .heat.method import SurfaceOptions
from .join import JoinedVolume
from .mesh import Mesh
from .surface import Surface
from .verdict import SurfaceVerdict

__all__ = [
    "SURFACE_METHODS",
    "JoinedVolume",
    "Jump",
    "Loop",
    "LoopVerdict",
    "Mesh",
    "Surface",
    "SurfaceOptions",
    "SurfaceVerdict",
]
