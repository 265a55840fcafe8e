from .seam_mending import mend

__all__ = [
    "mend",
]
