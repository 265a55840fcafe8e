"""Masks that are True except near their borders: only the border bands need to be looked at."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from toposeam.arrays import Mask
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import EDGES, TileMap, blocks, new_map, uniform

#: Width of the border band in which False pixels are expected, px; a mask with others has no full box.
_WIDEST_BAND = 4


def full_within(mask: Mask) -> Box | None:
    """Find a box of True pixels that leaves out at most a few px at each border of a mask; None if there is
    none.

    The box is nearly as large as it can be.

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
    for _ in range(_WIDEST_BAND + 1):
        inner, middle = box.grown(-1), box.grown(-_WIDEST_BAND)
        if not all(middle.shape):
            return None
        lines = (  # without their ends, which belong to the other lines, too
            middle._replace(top=box.top, bottom=inner.top),
            middle._replace(left=box.left, right=inner.left),
            middle._replace(top=inner.bottom, bottom=box.bottom),
            middle._replace(left=inner.right, right=box.right),
        )
        full = [_holds_only_true(mask, line) for line in lines]
        if all(full):
            if _holds_only_true(mask, box):
                return box
            full = [False] * 4  # a corner has False pixels
        box = Box(*(now if is_full else new for now, new, is_full in zip(box, inner, full, strict=True)))
    return None


def _holds_only_true(mask: Mask, box: Box) -> bool:
    if isinstance(mask, TileMap):
        return mask.holds(box, True)
    return bool(uniform(mask, box) or mask[box.slices].all())


def rim(box: Box, full: Box | None, side: int = EDGES) -> Iterator[Box]:
    """Yield the blocks of a box outside of a full box in it, which may be None or empty."""
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
    """Make an (H, W) mask that is True in a box; elsewhere `values` computes it for blocks."""
    result: Mask = new_map(shape, True, bool)
    for box in rim(Box(0, 0, *shape), full):
        result[box.slices] = values(box)
    return result
