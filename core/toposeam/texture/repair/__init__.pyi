from .object_assignment import MOST, Exchange

__all__ = [
    "MOST",
    "Exchange",
]
