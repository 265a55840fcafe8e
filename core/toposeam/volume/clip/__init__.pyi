from .period import Jump
from .result import Loop
from .steady import moved, steadied
from .verdict import LoopVerdict
from .walk import closed_walk

__all__ = [
    "Jump",
    "Loop",
    "LoopVerdict",
    "closed_walk",
    "moved",
    "steadied",
]
