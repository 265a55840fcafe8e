"""Places of turned exemplars that show, in another position, what shows beside them already.

A mirrored patch fits its own original along the mirror's line as nothing else does, and a turned one round
its centre: textures would be full of butterflies and rosettes. So a patch must not show what is near its
window in another position.
"""

from __future__ import annotations

import numpy as np

from toposeam.images import Mask
from toposeam.texture.atlas import Atlas, Ints32
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.search import box_sum
from toposeam.texture.turning import Turns, count_of, turned

#: Share of a patch from which on it shows too much of that.
_MUCH = 0.02


class Twins:
    """Tells which places show what is near in another position.

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
        #: Per pixel of the atlas, which pixel of the originals it is, and in which position.
        self._original: Ints32 = np.zeros(atlas.usable.shape, np.int32)
        self._position = np.zeros(atlas.usable.shape, np.int8)
        #: Per position and pixel of the originals, its place on the atlas.
        self._where = np.zeros((self._count, int(first[-1])), np.intp)
        flat = np.arange(atlas.usable.size).reshape(atlas.usable.shape)
        for number, (place, found) in enumerate(zip(atlas.places, numbers, strict=True)):
            self._original[place], self._position[place] = found, number % self._count
            self._where[number % self._count, found] = flat[place]

    def blocked(
        self, at: tuple[int, int], shape: tuple[int, int], margin: int, factor: int, size: tuple[int, ...]
    ) -> Mask:
        """Which places on the search's grid a patch must not be taken from, (n, m) bool.

        Parameters
        ----------
        at, shape : (int, int)
            The window on the canvas.
        margin, factor : int
            Of the grid.
        size : (int, int)
            n and m.
        """
        (top, left), (h, w) = at, shape
        seen = self._canvas.read(top - h // 2, left - w // 2, 2 * h, 2 * w)
        seen = np.unique(seen[seen >= 0])
        original, position = self._original.ravel()[seen], self._position.ravel()[seen]
        shown = np.zeros((-(-self._atlas.usable.shape[0] // factor), -(-self._atlas.width // factor)), bool)
        for other in range(self._count):
            row, column = np.divmod(self._where[other, original[position != other]], self._atlas.width)
            shown[row // factor, column // factor] = True
        box = max(h // factor, 1), max(w // factor, 1)
        share = box_sum(shown, box)[margin // factor :, margin // factor :][: size[0], : size[1]]
        much: Mask = np.zeros(size, bool)
        much[: share.shape[0], : share.shape[1]] = share > _MUCH * box[0] * box[1]
        return much
