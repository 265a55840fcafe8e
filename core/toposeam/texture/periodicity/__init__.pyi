from .period import STRETCH, Order, find_order, given_order, likely_order
from .phase import Phase, closing_size

__all__ = [
    "STRETCH",
    "Order",
    "Phase",
    "closing_size",
    "find_order",
    "given_order",
    "likely_order",
]
