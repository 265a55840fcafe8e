"""A penalty that excludes places that show, turned or mirrored, what shows near the window already.

A mirrored patch fits its own original along the mirror's line as nothing else does, and a turned one round
its centre: textures would be full of butterflies and rosettes. So a patch must not show what is near its
window in another position.
"""

from __future__ import annotations

import numpy as np

from toposeam.arrays import Floats32, Ints32
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.canvas.places import PlaceGrid
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.patch_search import box_sum
from toposeam.texture.exemplar.turns import Turns, count_of, turned

#: Largest share of a patch that may show near its window in another position.
_MOST_SHARE = 0.02


class MirrorCopyPenalty:
    """Exclude places that show what is near the window in another position.

    Parameters
    ----------
    atlas : Atlas
        Of exemplars in all positions.
    canvas : IndexCanvas
    turns : str
    """

    def __init__(self, atlas: Atlas, canvas: IndexCanvas, turns: Turns) -> None:
        self._atlas, self._canvas, self._count = atlas, canvas, count_of(turns)
        originals = atlas.places[:: self._count]
        sizes = [(place[0].stop - place[0].start, place[1].stop - place[1].start) for place in originals]
        first = np.cumsum([0, *(h * w for h, w in sizes)])
        numbers = turned(
            [
                start + np.arange(h * w, dtype=np.int32).reshape(h, w)
                for start, (h, w) in zip(first, sizes, strict=False)
            ],
            turns,
        )
        #: For each pixel of the atlas, its number among the originals' pixels, and its position.
        self._original: Ints32 = np.zeros(atlas.usable.shape, np.int32)
        self._position = np.zeros(atlas.usable.shape, np.int8)
        #: For each position and pixel of the originals, its flat index into the atlas.
        self._where = np.zeros((self._count, int(first[-1])), np.intp)
        flat = np.arange(atlas.usable.size).reshape(atlas.usable.shape)
        for number, (place, found) in enumerate(zip(atlas.places, numbers, strict=True)):
            self._original[place], self._position[place] = found, number % self._count
            self._where[number % self._count, found] = flat[place]

    def factor(self, places: PlaceGrid) -> Floats32:
        """Compute the factor on the error of places: (n, m) float32, inf where a patch must not be taken."""
        step, size = places.step, places.size
        (top, left), (h, w) = places.at, places.shape
        seen = self._canvas.read(top - h // 2, left - w // 2, 2 * h, 2 * w)
        seen = np.unique(seen[seen >= 0])
        original, position = self._original.ravel()[seen], self._position.ravel()[seen]
        shown = np.zeros((-(-self._atlas.usable.shape[0] // step), -(-self._atlas.width // step)), bool)
        for other in range(self._count):
            row, column = np.divmod(self._where[other, original[position != other]], self._atlas.width)
            shown[row // step, column // step] = True
        first = places.first // step
        box = max(h // step, 1), max(w // step, 1)
        share = box_sum(shown, box)[first:, first:][: size[0], : size[1]]
        found: Floats32 = np.ones(size, np.float32)
        found[: share.shape[0], : share.shape[1]][share > _MOST_SHARE * box[0] * box[1]] = np.inf
        return found
