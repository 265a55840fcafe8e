from .history import Frame, Iteration, Termination

__all__ = [
    "Frame",
    "Iteration",
    "Termination",
]
