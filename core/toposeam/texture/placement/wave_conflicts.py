"""Conflicts between patches that are picked for several windows of a wave at the same time.

The windows of a wave do not touch, so the best places for each are looked for at the same time, on the canvas
as it was before the wave. Places are then picked for one window after another. Among the best places of a
window, those are penalised that show what has just been picked near by, and those are excluded that would
exceed the limit of a pixel's use, or of a copy's size, together with what has just been picked.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np

from toposeam.arrays import Floats32, Ints32, Mask
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.canvas.places import Offers
from toposeam.texture.exemplar.atlas import Atlas


class WaveConflicts:
    """The places picked so far for the windows of a wave, and their conflicts with further ones.

    Parameters
    ----------
    canvas : IndexCanvas
    atlas : Atlas
    reach : int
        Distance on the canvas, px, within which two copies are near each other.
    near : float
        Factor on a place all of whose pixels were picked near by, less 1.
    limit : (AH, 1) or (AH, AW) int32 array, optional
        How often pixels may show, by the atlas's row.
    largest_copy : callable
        Called with a patch's height and width and the number of empty pixels that it fills; returns the
        largest area of a copy that it continues, px.
    """

    def __init__(
        self,
        canvas: IndexCanvas,
        atlas: Atlas,
        reach: int,
        near: float,
        limit: Ints32 | None,
        largest_copy: Callable[[tuple[int, int], int], int],
    ) -> None:
        self._canvas, self._reach, self._near, self._largest_copy = canvas, reach, near, largest_copy
        #: (AH, AW) bool: pixels of the atlas that may be picked only once more before the next wave.
        self._full: Mask | None = None
        if limit is not None:
            full = canvas.usage.reshape(atlas.usable.shape) + 1 >= limit
            self._full = full if full.any() else None
        self._picked: list[tuple[tuple[int, int], tuple[int, int]]] = []
        self._grown: Counter[int] = Counter()

    def add(self, at: tuple[int, int], place: tuple[int, int], offers: Offers) -> None:
        """Record that a place has been picked for the window at a row and column of the canvas."""
        self._picked.append((at, place))
        for first in {first for *where, first in offers.continued if tuple(where) == place}:
            self._grown[first] += offers.new

    def judged(self, at: tuple[int, int], shape: tuple[int, int], offers: Offers) -> Floats32:
        """Compute the errors of places, given those picked so far; inf for excluded ones, unless all are."""
        errors, (h, w) = offers.errors.copy(), shape
        limit = self._largest_copy(shape, offers.new) - offers.new
        for row, column, first in offers.continued if self._grown else ():
            if self._grown[first] and self._canvas.area_of(first) + self._grown[first] > limit:
                errors[(offers.rows == row) & (offers.columns == column)] = np.inf
        if not self._picked:
            return errors
        places = np.array([place for _, place in self._picked])
        down = np.maximum(h - np.abs(offers.rows - places[:, :1]), 0)
        right = np.maximum(w - np.abs(offers.columns - places[:, 1:]), 0)
        if self._near:
            near = [self._are_near(at, where, shape) for where, _ in self._picked]
            for factor in (1 + self._near * down[near] * right[near] / (h * w)).astype(np.float32):
                errors *= factor
        if self._full is not None:
            for number, k in np.argwhere((down > 0) & (right > 0)).tolist():
                row, column = self._picked[number][1]
                top, left = max(int(offers.rows[k]), row), max(int(offers.columns[k]), column)
                if self._full[top : top + down[number, k], left : left + right[number, k]].any():
                    errors[k] = np.inf
        return errors if np.isfinite(errors).any() else offers.errors

    def _are_near(self, first: tuple[int, int], second: tuple[int, int], shape: tuple[int, int]) -> bool:
        """Test whether one window of the canvas is within reach of another."""
        away = np.subtract(first, second)
        return all(self._canvas.distance(k, away[k]) < shape[k] + self._reach for k in (0, 1))
