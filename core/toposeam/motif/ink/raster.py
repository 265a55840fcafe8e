"""Pixels of a whole pattern on which distances are taken, and densities made of distances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats, Floats32, Mask
from toposeam.motif.symmetry.rules import HEXAGONAL, symmetry
from toposeam.motif.symmetry.tiling import Scalar, copy_at, period, tile

#: Pixels of an element along each side.
_FINE = 2


@dataclass(frozen=True, slots=True)
class Raster:
    """The cells after which a pattern repeats by translation, in pixels.

    On a hexagonal lattice these are the pixels of :func:`to_tile`, of which every second one is a node.
    """

    repeat: str
    #: Elements, or nodes, along the sides of the cell.
    elements: tuple[int, int]

    @property
    def spacing(self) -> tuple[float, float]:
        """Height and width of a pixel, in elements."""
        return (np.sqrt(3.0) / 2, 0.5) if self.repeat in HEXAGONAL else (1 / _FINE, 1 / _FINE)

    def of(self, cell: Floats32) -> Floats32:
        """Lay out the pattern of a cell at `size`."""
        return cell if self.repeat in HEXAGONAL else tile(cell, self.repeat, period(self.repeat))

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of pixels of one cell."""
        return _FINE * self.elements[0], _FINE * self.elements[1]

    def densities(self, field: Floats) -> Floats:
        """Return the largest value of a field on every element's orbit: what any copy has, all have."""
        rows, columns = self.elements
        if self.repeat in HEXAGONAL:
            v, u = np.ogrid[:rows, :columns]
            found: Floats = field[v, (2 * u - v) % (2 * columns)]
            return symmetry(self.repeat, self.elements).largest(found)
        height, width = self.size
        down, across = period(self.repeat)
        most = np.full(self.size, -np.inf)
        for row in range(down):
            for column in range(across):
                part = field[row * height : (row + 1) * height, column * width : (column + 1) * width]
                np.maximum(most, copy_at(part, self.repeat, -row, -column), out=most)
        mean: Floats = most.reshape(rows, _FINE, columns, _FINE).mean(axis=(1, 3))
        return symmetry(self.repeat, self.elements).largest(mean)

    @property
    def is_closed(self) -> bool:
        """True where the pattern continues with its opposite side beyond each border."""
        return self.repeat != "none"

    def padded(self, mask: Mask) -> tuple[Mask, tuple[int, int]]:
        """Return a mask with half of the pattern round it, and the rows and columns before it."""
        if not self.is_closed:
            return mask, (0, 0)
        before = mask.shape[0] // 2, mask.shape[1] // 2
        return np.pad(mask, [(side, side) for side in before], mode="wrap"), before

    @staticmethod
    def inner(padded: npt.NDArray[Scalar], before: tuple[int, int]) -> npt.NDArray[Scalar]:
        """Return a padded field without its margin."""
        (top, left), (rows, columns) = before, padded.shape
        return padded[top : rows - top, left : columns - left]

    def distance(self, mask: Mask) -> Floats:
        """Compute the distance from a mask, in elements: 0 on it. Infinite where it is empty."""
        if not mask.any():
            return np.full(mask.shape, np.inf)
        wide, before = self.padded(mask)
        away: Floats = ndimage.distance_transform_edt(~wide, sampling=self.spacing)
        return self.inner(away, before)

    def signed_distance(self, mask: Mask) -> Floats:
        """Compute the distance from a mask's border, in elements; below 0 inside."""
        found: Floats = np.where(mask, -self.distance(~mask), self.distance(mask))
        return found
