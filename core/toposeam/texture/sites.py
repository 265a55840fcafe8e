"""What a patch is laid by: the window of the canvas, the best places for it, and what is wanted there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toposeam.images import Mask
from toposeam.texture.atlas import Floats32, Ints32
from toposeam.texture.search import Ints


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Guide:
    """What a texture should look like, patch by patch."""

    #: (AH, AW, G) float32, what each pixel of the atlas stands for.
    source: Floats32
    #: (H, W, G) float32, what is wanted on the canvas.
    target: Floats32
    #: Its share in the choice, in [0, 1]; the rest is the overlap's.
    weight: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Site:
    """A window of the canvas before a patch is laid there."""

    #: First row and column on the canvas, height and width.
    at: tuple[int, int]
    shape: tuple[int, int]
    #: What the canvas shows there and in the margin round it, flat indices; -1 where empty.
    known: Ints32
    #: How much each of these pixels counts, float32.
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
        """A window in which some (h, w) pixels count, and those of the margin that are known count less."""
        m, (h, w) = (known.shape[0] - shape[0]) // 2, shape
        weight = np.where(known >= 0, np.float32(context), np.float32(0))
        weight[m : m + h, m : m + w] = counts
        return cls(at=at, shape=shape, known=known, weight=weight, covers=covers)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Offers:
    """The best places for a patch in a window, as the canvas was when they were looked for."""

    #: (n,) atlas row and column of the patch's first pixel, and how badly it fits there; none where any place
    #: is as good.
    rows: Ints
    columns: Ints
    errors: Floats32
    #: How many pixels of the window are empty.
    new: int
    #: The place at which a patch would continue each copy that the window shows, and that copy's first patch.
    continued: list[tuple[int, int, int]]
