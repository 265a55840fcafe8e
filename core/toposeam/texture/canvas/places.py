"""The window of the canvas on which a patch is laid, the places it may come from, and penalties on them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from toposeam.arrays import Floats32, Indices, Ints32, Mask

#: Mean square, as a share of the guide's variance, by which what a patch stands for is off at most where the
#: patch follows the guide.
_OFF = 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class Guide:
    """The desired appearance of a texture, patch by patch."""

    #: (AH, AW, G) float32, the guide's values that each pixel of the atlas stands for.
    source: Floats32
    #: (H, W, G) float32, the values wanted on the canvas.
    target: Floats32
    #: Its share in the choice, in [0, 1]; the rest is the overlap's.
    weight: float

    @cached_property
    def variance(self) -> float:
        """Variance of what is wanted."""
        return float(self.target.var(axis=(0, 1)).sum())

    def followed(self, rows: Indices, columns: Indices, source: Ints32) -> bool:
        """Test whether a patch, (h, w) flat indices of the atlas, is what is wanted on some rows (h, 1) and
        columns (1, w).
        """
        off = self.source.reshape(-1, self.source.shape[2])[source] - self.target[rows, columns]
        return float(np.square(off).sum(axis=2).mean()) <= _OFF * self.variance


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Site:
    """A window of the canvas before a patch is laid there."""

    #: First row and column on the canvas, height and width.
    at: tuple[int, int]
    shape: tuple[int, int]
    #: Flat indices that the canvas shows there and in the margin round it; -1 where empty.
    known: Ints32
    #: Weight of each of these pixels, float32.
    weight: Floats32
    #: (h, w) bool: where the patch may show.
    covers: Mask

    @classmethod
    def of(
        cls,
        at: tuple[int, int],
        shape: tuple[int, int],
        known: Ints32,
        counts: Mask,
        covers: Mask,
        context: float,
    ) -> Site:
        """Make a window in which some (h, w) pixels count, and those of the margin that are known
        count less.
        """
        m, (h, w) = (known.shape[0] - shape[0]) // 2, shape
        weight = np.where(known >= 0, np.float32(context), np.float32(0))
        weight[m : m + h, m : m + w] = counts
        return cls(at=at, shape=shape, known=known, weight=weight, covers=covers)


@dataclass(frozen=True, slots=True)
class PlaceGrid:
    """The grid of places on the atlas from which a patch may be taken, and the window that it is for."""

    #: First row and column of the window on the canvas, its height and width.
    at: tuple[int, int]
    shape: tuple[int, int]
    #: First row, and column, of the places; px between neighbours; how many rows and columns there are.
    first: int
    step: int
    size: tuple[int, int]
    #: Rows and columns of the box round the window's empty pixels.
    empty: tuple[tuple[int, int], tuple[int, int]]

    @property
    def axes(self) -> tuple[Indices, Indices]:
        """Rows (n,) and columns (m,) of the places."""
        n, m = self.size
        return self.first + self.step * np.arange(n), self.first + self.step * np.arange(m)

    def from_blocks(self, values: Floats32, block: int, offset: tuple[int, int] = (0, 0)) -> Floats32:
        """Sample an array with one value per block × block pixels of the atlas at every place: (n, m).

        Parameters
        ----------
        values : (BH, BW) float32 array
        block : int
            Side of a block, px.
        offset : (int, int)
            Rows and columns, px, from each place to where it is sampled.
        """
        rows, columns = (
            np.minimum((line + shift) // block, limit - 1)
            for line, shift, limit in zip(self.axes, offset, values.shape, strict=True)
        )
        found: Floats32 = values.take(rows, axis=0).take(columns, axis=1)
        return found


class Penalty(Protocol):
    """A reason to avoid some of the places."""

    def factor(self, places: PlaceGrid) -> Floats32:
        """Compute the factor on the error of each place: (n, m) or (n, 1) float32, inf for places that are
        excluded.
        """


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Offers:
    """The best places for a patch in a window, as the canvas was when they were looked for."""

    #: (n,) atlas row and column of the patch's first pixel, and how badly it fits there; none where any place
    #: is as good.
    rows: Indices
    columns: Indices
    errors: Floats32
    #: Number of empty pixels of the window.
    new: int
    #: The place at which a patch would continue each copy that the window shows, and that copy's first patch.
    continued: list[tuple[int, int, int]]
