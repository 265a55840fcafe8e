"""Motifs laid side by side by the rule they were made for."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

Scalar = TypeVar("Scalar", bound=np.generic)


def copy_at(cell: npt.NDArray[Scalar], repeat: str, row: int, column: int) -> npt.NDArray[Scalar]:
    """The copy of a cell, (..., h, w), that lies in the given row and column of its pattern."""
    if repeat == "reflect":
        return cell[..., :: -1 if row % 2 else 1, :: -1 if column % 2 else 1]
    if repeat == "rotate" and (row + column) % 2:
        return cell[..., ::-1, ::-1]
    if repeat == "exchange" and row % 2:
        return np.roll(cell, cell.shape[-1] // 2, axis=-1)
    return cell


def tile(cell: npt.NDArray[Scalar], repeat: str, counts: tuple[int, int]) -> npt.NDArray[Scalar]:
    """A pattern of rows × columns cells, (..., rows * h, columns * w)."""
    rows, columns = counts
    h, w = cell.shape[-2:]
    result = np.empty((*cell.shape[:-2], rows * h, columns * w), cell.dtype)
    for row in range(rows):
        for column in range(columns):
            result[..., row * h : (row + 1) * h, column * w : (column + 1) * w] = copy_at(cell, repeat, row, column)
    return result


def extend(cell: npt.NDArray[Scalar], repeat: str, margin: int) -> npt.NDArray[Scalar]:
    """A cell, (..., h, w), with a margin of its neighbours in the pattern; a motif that does not repeat has mirrored ones."""
    h, w = cell.shape[-2:]
    rule = "reflect" if repeat == "none" else repeat
    up, left = -(-margin // h), -(-margin // w)
    # Copies at negative places have the parity of those at positive ones.
    shift = (up % 2, left % 2)
    result = np.empty((*cell.shape[:-2], (2 * up + 1) * h, (2 * left + 1) * w), cell.dtype)
    for row in range(2 * up + 1):
        for column in range(2 * left + 1):
            result[..., row * h : (row + 1) * h, column * w : (column + 1) * w] = copy_at(cell, rule, row + shift[0], column + shift[1])
    y, x = up * h - margin, left * w - margin
    return result[..., y : y + h + 2 * margin, x : x + w + 2 * margin]
