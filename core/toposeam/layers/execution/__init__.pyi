from .tasks import Executor, Progressed, check_executor, on_boxes, results

__all__ = [
    "Executor",
    "Progressed",
    "check_executor",
    "on_boxes",
    "results",
]
