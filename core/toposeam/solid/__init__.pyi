from .generate import Solid, generate_solid

__all__ = [
    "Solid",
    "generate_solid",
]
