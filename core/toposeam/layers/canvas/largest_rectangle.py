"""Find the largest rectangle of a composite that has no hole."""

from __future__ import annotations

import numpy as np

from toposeam.arrays import Mask
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import any_of, dense

#: Largest number of blocks a side in which the rectangle is searched, before it grows pixel by pixel.
_MOST_BLOCKS = 400


def largest_full(mask: Mask) -> Box | None:
    """Find the largest rectangle in which a mask is True everywhere; None if it is True nowhere.

    On a large mask this is the largest rectangle of whole blocks, grown on each side as far as it goes.

    Parameters
    ----------
    mask : (H, W) bool array

    Examples
    --------
    >>> mask = np.ones((5, 7), bool); mask[0, 0] = mask[4] = False
    >>> largest_full(mask)
    Box(top=0, left=1, bottom=4, right=7)
    """
    height, width = mask.shape
    block = max(1, -(-max(height, width) // _MOST_BLOCKS))
    rows, columns = height // block, width // block
    full = np.zeros((rows, columns), bool)
    for row in range(rows):
        strip = mask[row * block : (row + 1) * block, : columns * block]
        full[row] = strip.reshape(block, columns, block).all(axis=(0, 2))
    box = _largest(full)
    if box is None:
        return None if block == 1 or not any_of(mask) else _around_a_pixel(dense(mask))
    return _grown(mask, Box(*(block * edge for edge in box)))


def _largest(full: Mask) -> Box | None:
    """Find the largest full rectangle, by the heights of columns above each row and a stack of them.

    Of columns that are as high as the one before nothing is new.
    """
    best, area = None, 0
    heights = np.zeros(full.shape[1] + 1, int)
    for row, line in enumerate(full):
        heights[:-1] = np.where(line, heights[:-1] + 1, 0)
        columns = np.concatenate([[0], np.flatnonzero(np.diff(heights)) + 1])
        stack: list[tuple[int, int]] = []
        for column, height in zip(columns.tolist(), heights[columns].tolist(), strict=True):
            start = column
            while stack and stack[-1][1] >= height:
                start, tall = stack.pop()
                if tall * (column - start) > area:
                    area, best = tall * (column - start), Box(row + 1 - tall, start, row + 1, column)
            stack.append((start, height))
    return best


def _around_a_pixel(mask: Mask) -> Box:
    row, column = np.argwhere(mask)[0]
    return _grown(mask, Box(int(row), int(column), int(row) + 1, int(column) + 1))


def _grown(mask: Mask, box: Box) -> Box:
    height, width = mask.shape
    top, left, bottom, right = box
    while top > 0 and mask[top - 1 : top, left:right].all():
        top -= 1
    while bottom < height and mask[bottom : bottom + 1, left:right].all():
        bottom += 1
    while left > 0 and mask[top:bottom, left - 1 : left].all():
        left -= 1
    while right < width and mask[top:bottom, right : right + 1].all():
        right += 1
    return Box(top, left, bottom, right)
