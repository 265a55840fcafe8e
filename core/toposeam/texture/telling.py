"""Report progress and previews while a texture grows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.texture.atlas import Atlas
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.sources import Sources

#: Longer side of previews at most, px, and about how many there are.
_SIDE, _COUNT = 512, 12


class Previews:
    """Shows what has been laid, now and then."""

    def __init__(
        self,
        show: Callable[[npt.NDArray[Any]], None],
        sources: Sources,
        atlas: Atlas,
        canvas: IndexCanvas,
    ) -> None:
        self._show, self._canvas, self._gray = show, canvas, sources.gray[0]
        self._flat = atlas.spread(sources.planes[0]).reshape(-1, sources.planes[0][0].shape[2])
        self._step, self._next = max(1, -(-max(canvas.shape) // _SIDE)), 0.0

    def __call__(self, share: float) -> None:
        """Show a preview when due, given the share of the patches laid."""
        if share < self._next:
            return
        self._next += 1 / _COUNT
        index = self._canvas.index[:: self._step, :: self._step]
        picture = self._flat.take(np.maximum(index, 0), axis=0)
        picture[index < 0] = 0
        self._show(picture[..., 0] if self._gray else picture)


class Stages:
    """Progress through several stages."""

    def __init__(self, progress: Callable[[float], None] | None) -> None:
        self._progress = progress

    def stage(
        self, first: float, last: float, also: Callable[[float], None] | None = None
    ) -> Callable[[float], None] | None:
        """Make what reports the share done of a stage that takes from one share of the whole to another."""

        def report(share: float) -> None:
            if also is not None:
                also(share)
            if self._progress is not None:
                self._progress(first + (last - first) * share)

        return report

    def finish(self) -> None:
        """Report that all is done."""
        if self._progress is not None:
            self._progress(1.0)
