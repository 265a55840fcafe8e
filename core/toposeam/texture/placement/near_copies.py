"""A penalty on pixels that show near a window already, so that landmarks do not repeat within sight."""

from __future__ import annotations

import numpy as np

from toposeam.arrays import Floats32
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.canvas.places import PlaceGrid
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.patch_search import box_sum

#: Distance within which two copies are near each other, as a share of an exemplar's shorter side.
NEAR = 0.5
#: Approximate number of pixels of the canvas sampled along each axis.
_SAMPLED = 64


def near_reach(atlas: Atlas) -> int:
    """Compute within how many px two copies are near each other."""
    return round(NEAR * int(atlas.shapes.min(axis=1).max()))


class Nearby:
    """Penalise places whose pixels show within reach of the window but not in it.

    The factor is 1 + strength × variety × share.

    Parameters
    ----------
    atlas : Atlas
    canvas : IndexCanvas
    variety : float
    """

    #: Per unit of variety.
    STRENGTH = 1.0

    def __init__(self, atlas: Atlas, canvas: IndexCanvas, variety: float) -> None:
        self._atlas, self._canvas, self._reach = atlas, canvas, near_reach(atlas)
        self.strength = self.STRENGTH * variety

    def factor(self, places: PlaceGrid) -> Floats32:
        """Compute the factor on the error of places, (n, m) float32."""
        factor = self.share(places)
        factor *= np.float32(self.strength)
        factor += np.float32(1)
        return factor

    def share(self, places: PlaceGrid) -> Floats32:
        """Compute the share of each place's pixels that show near by, (n, m) float32."""
        canvas, (top, left), (height, width) = self._canvas, places.at, places.shape
        step = max(1, (2 * self._reach + max(height, width)) // _SAMPLED)
        y, x = canvas.around(places.at, places.shape, self._reach, step)
        index = canvas.index.take(
            (y % canvas.shape[0])[:, np.newaxis] * canvas.shape[1] + x % canvas.shape[1]
        )
        shown = index >= 0
        shown[np.ix_((y >= top) & (y < top + height), (x >= left) & (x < left + width))] = False
        row, column = np.divmod(index[shown], np.int32(self._atlas.width))
        cells = np.zeros([-(-length // step) for length in self._atlas.usable.shape], bool)
        cells[row // step, column // step] = True
        box = max(1, height // step), max(1, width // step)
        return places.from_blocks(box_sum(cells, box).astype(np.float32) / np.float32(box[0] * box[1]), step)
