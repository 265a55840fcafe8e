"""The atlas: all exemplars on one plane, from which patches are copied.

Exemplars lie below one another with a margin round each, so that a pixel is one flat index, its neighbour in
the exemplar is that index plus a constant, and a window that reaches beyond an exemplar meets pixels that are
not *usable* instead of another exemplar's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Ints32, Mask

#: Largest number of pixels that are searched at full size; larger exemplars are searched at reduced size
#: first.
SEARCH_PIXELS = 300 * 300
#: Number of pixels that are located at a time, which bounds the memory.
_LOCATED_AT_ONCE = 1 << 18


@dataclass(frozen=True, slots=True, eq=False)
class Atlas:
    """The position of each exemplar on a plane of AH × AW pixels.

    Parameters
    ----------
    usable : (AH, AW) bool array
        The pixels that have a value.
    copied : (AH, AW) bool array
        Those of them that patches may consist of.
    corners : (E, 2) int array
        Row and column of each exemplar's first pixel.
    shapes : (E, 2) int array
        Height and width of each exemplar.
    margin : int
        Least distance in px between an exemplar and anything else, a multiple of the factor.
    factor : int
        By how much the plane is reduced for the first search, a power of two.
    """

    usable: Mask
    copied: Mask
    corners: npt.NDArray[np.intp]
    shapes: npt.NDArray[np.intp]
    margin: int
    factor: int

    @classmethod
    def of(cls, usable: Sequence[Mask], context: int, copied: Sequence[Mask] | None = None) -> Atlas:
        """Put exemplars on one plane.

        Parameters
        ----------
        usable : sequence of (H, W) bool arrays
            One per exemplar: where it has pixels.
        context : int
            Distance, px, by which windows will reach beyond their patches.
        copied : sequence of (H, W) bool arrays, optional
            Where patches may be copied from, if not everywhere.
        """
        factor = 1
        while sum(mask.size for mask in usable) / factor**2 > SEARCH_PIXELS:
            factor *= 2
        margin = factor * -(-max(context, 2) // factor)
        shapes = np.array([mask.shape for mask in usable], np.intp)
        rows = margin + np.concatenate([[0], np.cumsum(shapes[:-1, 0] + margin)])
        corners = np.column_stack([rows, np.full(len(rows), margin)]).astype(np.intp)
        size = int(rows[-1] + shapes[-1, 0]) + margin, int(shapes[:, 1].max()) + 2 * margin
        atlas = cls(np.zeros(size, bool), np.zeros(size, bool), corners, shapes, margin, factor)
        for place, mask, allowed in zip(atlas.places, usable, copied or usable, strict=True):
            atlas.usable[place] = mask
            atlas.copied[place] = mask & allowed
        return atlas

    @property
    def width(self) -> int:
        """AW, the step from one row to the next in flat indices."""
        return int(self.usable.shape[1])

    @property
    def owner_of_rows(self) -> npt.NDArray[np.intp]:
        """(AH,) the exemplar that lies at each row of the plane, or above it."""
        rows = np.arange(self.usable.shape[0])
        return np.maximum(np.searchsorted(self.corners[:, 0], rows, side="right") - 1, 0)

    @property
    def places(self) -> list[tuple[slice, slice]]:
        """Rows and columns of each exemplar."""
        return [
            (slice(row, row + h), slice(column, column + w))
            for (row, column), (h, w) in zip(self.corners.tolist(), self.shapes.tolist(), strict=True)
        ]

    def spread(self, images: Sequence[npt.NDArray[Any]]) -> npt.NDArray[Any]:
        """Put one (H, W, C) array per exemplar, of one dtype, on the plane; 0 elsewhere."""
        plane = np.zeros((*self.usable.shape, images[0].shape[2]), images[0].dtype)
        for place, image in zip(self.places, images, strict=True):
            plane[place] = image
        return plane

    def locate(self, index: Ints32) -> tuple[npt.NDArray[np.int16], Ints32]:
        """Find the exemplar, and row and column in it, of pixels given by flat index.

        Returns
        -------
        exemplar : int16 array of the shape of `index`
        place : int32 array, (…, 2)
            -1 for pixels without source.
        """
        place, exemplar = np.empty((*index.shape, 2), np.int32), np.zeros(index.shape, np.int16)
        flat, places, numbers = index.reshape(-1), place.reshape(-1, 2), exemplar.reshape(-1)
        rows, columns = self.corners.T.astype(np.int32)
        top, left = rows[0], columns[0]
        owner = self.owner_of_rows.astype(np.int16)
        for first in range(0, len(flat), _LOCATED_AT_ONCE):
            part = slice(first, first + _LOCATED_AT_ONCE)
            row, column = np.divmod(flat[part], np.int32(self.width))
            if len(rows) > 1:
                owner.take(row, out=numbers[part], mode="clip")
                top, left = rows.take(numbers[part]), columns.take(numbers[part])
            np.subtract(row, top, out=places[part, 0])
            np.subtract(column, left, out=places[part, 1])
            if flat[part].min(initial=0) < 0:
                places[part][flat[part] < 0] = -1
        return exemplar, place

    def index_of(self, exemplar: npt.NDArray[np.int16], place: Ints32) -> Ints32:
        """Compute flat indices: the inverse of :meth:`locate`."""
        row = place[..., 0] + self.corners[:, 0].astype(np.int32)[exemplar]
        column = place[..., 1] + self.corners[:, 1].astype(np.int32)[exemplar]
        return np.where(place[..., 0] < 0, np.int32(-1), row * np.int32(self.width) + column)


def values_at(plane: Floats32, index: Ints32) -> Floats32:
    """Gather the values of an (AH, AW, F) plane at flat indices: (…, F), 0 for index -1."""
    flat = plane.reshape(-1, plane.shape[2])
    unset = index < 0
    if not unset.any():
        return flat.take(index, axis=0)
    found: Floats32 = flat.take(np.maximum(index, 0), axis=0)
    found[unset] = 0
    return found
