"""Patterns of a cell by its rule of repetition."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeVar

import numpy as np
import numpy.typing as npt

Scalar = TypeVar("Scalar", bound=np.generic)


def shift_of(repeat: str) -> tuple[int, Fraction] | None:
    """Return the shift between neighbouring rows (``brick``) or columns (``drop``) of a rule.

    The result is the axis of the shift, 1 or 0, and its share of the cell; None for other rules.

    Examples
    --------
    >>> shift_of("brick"), shift_of("drop 1/3"), shift_of("p4")
    ((1, Fraction(1, 2)), (0, Fraction(1, 3)), None)
    """
    name, _, text = repeat.partition(" ")
    if name not in ("brick", "drop"):
        return None
    match = re.fullmatch(r"(\d{1,2})/(\d{1,2})", text or "1/2")
    if match is None or not 0 < int(match[1]) < int(match[2]):
        return None
    return (1 if name == "brick" else 0), Fraction(int(match[1]), int(match[2]))


def period(repeat: str) -> tuple[int, int]:
    """Return the numbers of rows and columns of cells after which a pattern repeats by translation."""
    if repeat in ("reflect", "rotate"):
        return 2, 2
    shift = shift_of(repeat)
    if shift is None:
        return 1, 1
    axis, share = shift
    return (share.denominator, 1) if axis == 1 else (1, share.denominator)


def copy_at(cell: npt.NDArray[Scalar], repeat: str, row: int, column: int) -> npt.NDArray[Scalar]:
    """Return the copy of a cell, (..., h, w), that lies in the given row and column of its pattern."""
    if repeat == "reflect":
        return cell[..., :: -1 if row % 2 else 1, :: -1 if column % 2 else 1]
    if repeat == "rotate" and (row + column) % 2:
        return cell[..., ::-1, ::-1]
    shift = shift_of(repeat)
    if shift is not None:
        axis, share = shift
        along = cell.shape[axis - 2]
        return np.roll(cell, round((row if axis == 1 else column) * share * along) % along, axis=axis - 2)
    return cell


@dataclass(frozen=True, slots=True)
class Placed:
    """A copy of a cell: its points (x, y), in cells, lie at (`flip_x` x + `x`, `flip_y` y + `y`)."""

    x: float = 0.0
    y: float = 0.0
    flip_x: int = 1
    flip_y: int = 1

    def after(self, first: Placed) -> Placed:
        """Return the copy of a copy."""
        return Placed(
            self.flip_x * first.x + self.x,
            self.flip_y * first.y + self.y,
            self.flip_x * first.flip_x,
            self.flip_y * first.flip_y,
        )


def lines_of_copies(repeat: str, counts: tuple[float, float]) -> tuple[list[Placed], list[Placed]]:
    """Return the copies of a cell that make up a line of a pattern, and the copies of that line.

    Lines are rows, or columns for ``drop``. The first copy and the first line are the cell itself, unchanged.

    Parameters
    ----------
    repeat : str
    counts : (rows, columns)
        Size of the pattern, in cells; copies cover it, and may go on beyond it.

    Examples
    --------
    >>> lines_of_copies("rotate", (1, 2))[0]
    [Placed(x=0.0, y=0.0, flip_x=1, flip_y=1), Placed(x=2.0, y=1.0, flip_x=-1, flip_y=-1)]
    """
    rows, columns = (math.ceil(count) for count in counts)
    shift = shift_of(repeat)
    if shift is not None:
        axis, share = shift
        lines, along = (rows, columns) if axis == 1 else (columns, rows)
        copies = [(float(place), 0.0) for place in range(along + (lines > 1))]
        moved = [(float(line * share % 1) - (line * share % 1 > 0), float(line)) for line in range(lines)]
        if axis == 1:
            return [Placed(x, y) for x, y in copies], [Placed(x, y) for x, y in moved]
        return [Placed(y, x) for x, y in copies], [Placed(y, x) for x, y in moved]
    if repeat == "reflect":
        return (
            [Placed(float(x + x % 2), 0.0, -1 if x % 2 else 1, 1) for x in range(columns)],
            [Placed(0.0, float(y + y % 2), 1, -1 if y % 2 else 1) for y in range(rows)],
        )
    if repeat == "rotate":  # every second row begins with the second copy of the first
        turned = [
            Placed(x + 1.0, 1.0, -1, -1) if x % 2 else Placed(float(x)) for x in range(columns + (rows > 1))
        ]
        return turned, [Placed(-float(y % 2), float(y)) for y in range(rows)]
    return [Placed(float(x)) for x in range(columns)], [Placed(0.0, float(y)) for y in range(rows)]


def tile(cell: npt.NDArray[Scalar], repeat: str, counts: tuple[int, int]) -> npt.NDArray[Scalar]:
    """Lay out a pattern of rows × columns cells, (..., rows * h, columns * w)."""
    rows, columns = counts
    h, w = cell.shape[-2:]
    result = np.empty((*cell.shape[:-2], rows * h, columns * w), cell.dtype)
    for row in range(rows):
        for column in range(columns):
            result[..., row * h : (row + 1) * h, column * w : (column + 1) * w] = copy_at(
                cell, repeat, row, column
            )
    return result


def extend(cell: npt.NDArray[Scalar], repeat: str, margin: int) -> npt.NDArray[Scalar]:
    """Extend a cell, (..., h, w), by a margin of its neighbours in the pattern.

    For the rule "none" the neighbours are mirror images.
    """
    h, w = cell.shape[-2:]
    rule = "reflect" if repeat == "none" else repeat
    up, left = -(-margin // h), -(-margin // w)
    result = np.empty((*cell.shape[:-2], (2 * up + 1) * h, (2 * left + 1) * w), cell.dtype)
    for row in range(2 * up + 1):
        for column in range(2 * left + 1):
            result[..., row * h : (row + 1) * h, column * w : (column + 1) * w] = copy_at(
                cell, rule, row - up, column - left
            )
    y, x = up * h - margin, left * w - margin
    return result[..., y : y + h + 2 * margin, x : x + w + 2 * margin]
