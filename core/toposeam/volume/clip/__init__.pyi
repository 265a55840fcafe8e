from .coherence import strangeness
from .period import Jump
from .permanence import missing
from .result import Loop
from .steady import moved, steadied
from .verdict import LoopVerdict
from .walk import closed_walk

__all__ = [
    "Jump",
    "Loop",
    "LoopVerdict",
    "closed_walk",
    "missing",
    "moved",
    "steadied",
    "strangeness",
]
