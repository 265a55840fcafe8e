"""The rectangle of a picture with the largest sum of values (Kadane's method for each pair of rows)."""

from __future__ import annotations

import numpy as np

from toposeam.arrays import Floats, Floats32
from toposeam.layers.canvas.layer import Box

#: Blocks along the longer side in which the rectangle is searched, before its edges are moved by pixels.
_BLOCKS = 160


def best_box(values: Floats32, *, goes_round: bool = False) -> Box:
    """Find the rectangle of the largest sum.

    Parameters
    ----------
    values : (H, W) float array
        Of which some are positive.
    goes_round : bool
        Whether the rectangle has to be as wide as the array.

    Examples
    --------
    >>> values = np.full((5, 7), 1.0); values[0] = -1; values[2, 6] = -9
    >>> best_box(values)
    Box(top=1, left=0, bottom=5, right=6)
    """
    if goes_round:
        rows = values.mean(axis=1, keepdims=True)
        box = best_box(rows)
        return Box(box.top, 0, box.bottom, values.shape[1])
    height, width = values.shape
    block = max(1, -(-max(height, width) // _BLOCKS))
    padded = np.pad(values, [(0, -height % block), (0, -width % block)])
    small = padded.reshape(-(-height // block), block, -(-width // block), block).sum(axis=(1, 3))
    top, left, bottom, right = _largest(small)
    box = Box(top * block, left * block, min(bottom * block, height), min(right * block, width))
    return _moved(values, box, 2 * block)


def _largest(values: Floats) -> Box:
    """Find the rectangle of the largest sum among all."""
    rows, columns = values.shape
    total = np.vstack([np.zeros((1, columns)), values.cumsum(axis=0)])
    best, box = -np.inf, Box(0, 0, rows, columns)
    for top in range(rows):
        sums = np.zeros((rows - top, columns + 1))
        np.cumsum(total[top + 1 :] - total[top], axis=1, out=sums[:, 1:])
        score = sums[:, 1:] - np.minimum.accumulate(sums[:, :-1], axis=1)
        bottom, right = np.unravel_index(int(score.argmax()), score.shape)
        if score[bottom, right] > best:
            best = float(score[bottom, right])
            left = int(sums[bottom, : right + 1].argmin())
            box = Box(top, left, top + int(bottom) + 1, int(right) + 1)
    return box


def _moved(values: Floats32, box: Box, steps: int) -> Box:
    """Move each edge by single pixels where that gains."""
    top, left, bottom, right = box
    height, width = values.shape
    for _ in range(steps):
        top -= int(top > 0 and values[top - 1, left:right].sum() > 0)
        bottom += int(bottom < height and values[bottom, left:right].sum() > 0)
        left -= int(left > 0 and values[top:bottom, left - 1].sum() > 0)
        right += int(right < width and values[top:bottom, right].sum() > 0)
    for _ in range(steps):
        top += int(bottom - top > 1 and values[top, left:right].sum() < 0)
        bottom -= int(bottom - top > 1 and values[bottom - 1, left:right].sum() < 0)
        left += int(right - left > 1 and values[top:bottom, left].sum() < 0)
        right -= int(right - left > 1 and values[top:bottom, right - 1].sum() < 0)
    return Box(top, left, bottom, right)
