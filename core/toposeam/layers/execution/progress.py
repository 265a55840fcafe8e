"""Progress of work whose number of steps is not known in advance."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[float], None]


class Progressed:
    """Reports progress of an unknown number of steps: each step covers a tenth of what is left."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress, self._left = progress, 1.0

    def one(self) -> None:
        """Report that one more step is done."""
        self._left *= 0.9
        if self._progress is not None:
            self._progress(0.95 * (1 - self._left))
