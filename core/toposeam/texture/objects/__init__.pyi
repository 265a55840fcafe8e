from .object_exchange import make_objects_whole

__all__ = [
    "make_objects_whole",
]
