"""Masks that are True everywhere but along their rims, as those of whole pictures are: only the rims are to
be looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from toposeam.arrays import Mask
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import EDGES, TileMap, blocks, new_map, uniform

#: A mask is looked into so far from its borders, px.
_DEEPEST = 4


def full_within(mask: Mask) -> Box | None:
    """A box, a few px from the borders of a mask at most, that holds nothing but True and is nearly as large
    as it can be; None where there is none.

    Examples
    --------
    >>> import numpy as np
    >>> mask = np.ones((30, 40), bool)
    >>> mask[0] = mask[:, 39] = False
    >>> full_within(mask)
    Box(top=1, left=0, bottom=30, right=39)
    >>> mask[15, 20] = False
    >>> full_within(mask) is None
    True
    """
    box = Box(0, 0, *mask.shape)
    for _ in range(_DEEPEST + 1):
        inner, middle = box.grown(-1), box.grown(-_DEEPEST)
        if not all(middle.shape):
            return None
        lines = (  # without their ends, which other lines cross
            middle._replace(top=box.top, bottom=inner.top),
            middle._replace(left=box.left, right=inner.left),
            middle._replace(top=inner.bottom, bottom=box.bottom),
            middle._replace(left=inner.right, right=box.right),
        )
        full = [_holds_only_true(mask, line) for line in lines]
        if all(full):
            if _holds_only_true(mask, box):
                return box
            full = [False] * 4  # for want of pixels in a corner
        box = Box(*(now if is_full else new for now, new, is_full in zip(box, inner, full, strict=True)))
    return None


def _holds_only_true(mask: Mask, box: Box) -> bool:
    if isinstance(mask, TileMap):
        return mask.holds(box, True)
    return bool(uniform(mask, box) or mask[box.slices].all())


def rim(box: Box, full: Box | None, side: int = EDGES) -> Iterator[Box]:
    """The blocks of a box outside of a full one inside of it, which may be empty."""
    if full is None or not all(full.shape):
        yield from blocks(box, side)
        return
    for part in (
        box._replace(bottom=full.top),
        box._replace(top=full.bottom),
        Box(full.top, box.left, full.bottom, full.left),
        Box(full.top, full.right, full.bottom, box.right),
    ):
        if all(part.shape):
            yield part


def rimmed(shape: tuple[int, int], full: Box | None, values: Callable[[Box], Any]) -> Mask:
    """An (H, W) mask that is True in a box, and elsewhere what `values` gives for boxes of it."""
    result: Mask = new_map(shape, True, bool)
    for box in rim(Box(0, 0, *shape), full):
        result[box.slices] = values(box)
    return result
