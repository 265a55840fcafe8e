"""Report progress and previews while a texture grows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.sources import Sources

#: Takes the share of the work done, in [0, 1].
Report = Callable[[float], None]

#: Largest side of previews, px, and their number, about.
_MOST_SIDE, _COUNT = 512, 12


class Previews:
    """Shows the texture so far at intervals of the work."""

    def __init__(
        self,
        show: Callable[[npt.NDArray[Any]], None],
        sources: Sources,
        atlas: Atlas,
        canvas: IndexCanvas,
    ) -> None:
        self._show, self._canvas, self._gray = show, canvas, sources.gray[0]
        self._flat = atlas.spread(sources.planes[0]).reshape(-1, sources.planes[0][0].shape[2])
        self._step, self._next = max(1, -(-max(canvas.shape) // _MOST_SIDE)), 0.0

    def __call__(self, share: float) -> None:
        """Show a preview when due, given the share of the patches laid."""
        if share < self._next:
            return
        self._next += 1 / _COUNT
        index = self._canvas.index[:: self._step, :: self._step]
        picture = self._flat.take(np.maximum(index, 0), axis=0)
        picture[index < 0] = 0
        self._show(picture[..., 0] if self._gray else picture)


def stage(progress: Report | None, start: float, share: float) -> Report | None:
    """Make a report for a stage that begins at some share of the whole and takes some share of it; None where
    there is nothing to report to.
    """
    return None if progress is None else lambda part: progress(min(start + share * part, 1.0))


def together(*reports: Report | None) -> Report | None:
    """Make a report that calls several ones in order; None where there is none."""
    some = [report for report in reports if report is not None]

    def report(share: float) -> None:
        for one in some:
            one(share)

    return report if some else None
