"""Find the pixels beside seams on a label map, and the places where seams meet."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Labels, Mask
from toposeam.layers.canvas.layer import Box
from toposeam.layers.canvas.tile_map import dense, doubled, several

_Bits = TypeVar("_Bits", np.bool_, np.uint8, np.uint64)


def junctions(label_map: Labels, reach: int) -> list[Box]:
    """Find disjoint boxes that reach `reach` px beyond the places where three or more layers meet.

    Examples
    --------
    >>> junctions(np.array([[0, 0, 1, 1], [0, 0, 1, 1], [2, 2, 2, 2]], np.int16), 1)
    [Box(top=0, left=0, bottom=4, right=4)]
    """
    found: list[tuple[int, int]] = []
    for block in several(label_map, Box(0, 0, *label_map.shape)):
        labels = label_map[block.slices]
        edge = (labels[:-1, :-1] != labels[1:, :-1]) | (labels[:-1, 1:] != labels[1:, 1:])
        edge &= (labels[:-1, :-1] != labels[:-1, 1:]) | (labels[1:, :-1] != labels[1:, 1:])
        rows, columns = np.divmod(np.flatnonzero(edge), edge.shape[1])
        around = np.stack([labels[rows + y, columns + x] for y in (0, 1) for x in (0, 1)], axis=1)
        kinds = (np.diff(np.sort(around, axis=1), axis=1) != 0).sum(axis=1) + 1
        third = kinds - (around.min(axis=1) < 0) >= 3
        at = np.stack([rows[third] + block.top, columns[third] + block.left], axis=1)
        found += [(row, column) for row, column in at.tolist()]
    boxes: list[Box] = []
    for row, column in sorted(found):
        box = Box(row, column, row + 2, column + 2).grown(reach)
        for other in [other for other in boxes if all(other.shared(box).shape)]:
            boxes.remove(other)
            box = box.around(other)
        boxes.append(box)
    return boxes


def beside_steps(values: np.ndarray) -> Mask:
    """Mark the pixels of which some neighbour has a different value."""
    result = np.zeros(values.shape, bool)
    for s, t in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        differs = values[s] != values[t]
        result[s] |= differs
        result[t] |= differs
    return result


def square_dilation(mask: npt.NDArray[_Bits], reach: int) -> npt.NDArray[_Bits]:
    """Dilate a mask by a square of 2 reach + 1 px a side.

    In an array of integers each bit is a mask of its own.
    """
    result = mask.copy()
    for turned in (result, result.T):
        done = 0
        while done < reach:
            step = min(done + 1, reach - done)  # a pixel spans 2 done + 1 px so far
            before = turned.copy()
            turned[step:] |= before[:-step]
            turned[:-step] |= before[step:]
            done += step
    return result


def reached(label_map: Labels, count: int, reach: int) -> list[Mask]:
    """Mark, for each of `count` layers, the pixels at most `reach` px from where it shows, along each axis.

    Examples
    --------
    >>> for mask in reached(np.array([[0, 0, 0, 1, -1, 2]], np.int16), 3, 1):
    ...     print(mask.astype(int))
    [[1 1 1 1 0 0]]
    [[0 0 1 1 1 0]]
    [[0 0 0 0 1 1]]
    """
    found: list[Mask] = []
    kind: Any = np.uint8 if count <= 8 else np.uint64
    for first in range(0, count, 64):  # 64 layers at once, one bit each
        bit: npt.NDArray[Any] = np.zeros(count + 1, kind)  # index -1, no layer, is the last
        own = np.left_shift(kind(1), np.arange(min(64, count - first), dtype=kind))
        bit[first : first + len(own)] = own
        near = square_dilation(bit[label_map], reach)
        found += [(near & one) != 0 for one in own]
    return found


def doubled_around(pixels: tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]], shape: tuple[int, int]) -> Mask:
    """(H, W) bool mask of a canvas, True at pixels given on the canvas of half the size, and next to them.

    Examples
    --------
    >>> doubled_around((np.array([0]), np.array([0])), (2, 7)).astype(int)
    array([[1, 1, 1, 1, 0, 0, 0],
           [1, 1, 1, 1, 0, 0, 0]])
    """
    height, width = shape
    chosen = np.zeros((-(-height // 2), -(-width // 2)), bool)
    chosen[pixels] = True
    wide: Mask = dense(doubled(square_dilation(chosen, 1), shape))
    return wide
