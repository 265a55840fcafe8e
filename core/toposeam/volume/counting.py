"""Cells of two stacks: which are the same one, and what is handed to the search for a surface."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Ints
from toposeam.errors import ImageError, Term
from toposeam.volume.problem.canvas import Places
from toposeam.volume.problem.cells import brightness_by_slabs, window_sides

#: Slices that are compared at a time.
_SLICES = 16
#: Share of the smaller one of two cells, within the common box, that both have where they are the same.
_SAME = 0.5
#: Largest number of a cell, of both stacks together.
_LARGEST_NUMBER = 2**31 - 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """Segmentations of two stacks, in one numbering."""

    #: (D, H, W) arrays, or dask arrays: number of the cell at each voxel of a stack, 0 where there is none.
    a: Any
    b: Any


def cells_of(given: Sequence[Any], places: Places) -> Cells:
    """Number the cells of two stacks so that the same cell has the same number.

    Parameters
    ----------
    given : (D, H, W) array of integers or bool, or None, for each stack
    places : Places

    Raises
    ------
    ImageError
        Unless each has the shape of its stack and holds numbers of cells.
    """
    pairs = ((given[0], places.size_a, "a"), (given[1], places.size_b, "b"))
    for numbers, size, which in pairs:
        if numbers is not None:
            _check(numbers, size, which)
    if given[0] is None or given[1] is None:
        first, second = (
            np.broadcast_to(np.uint8(0), size) if numbers is None else numbers for numbers, size, _ in pairs
        )
        return Cells(a=first, b=second)
    most = [int(_computed(numbers.max())) for numbers in given]
    if sum(most) > _LARGEST_NUMBER:
        raise ImageError(
            "{array} have numbers up to {most}; number their cells from 1 on",
            kind="number",
            array=Term("cells"),
            most=max(most),
        )
    if max(most) <= 1:  # masks
        return Cells(a=given[0], b=given[1])
    same = _same_cells(given, places)
    renumber = _Renumber(
        known=np.array(list(same), np.int64), numbers=np.array(list(same.values()), np.int64), beyond=most[0]
    )
    second = (
        given[1].map_blocks(renumber, dtype=np.int32) if hasattr(given[1], "dask") else renumber(given[1])
    )
    return Cells(a=given[0], b=second)


def prices(one: Any, other: Any, spacing: Sequence[float], numbers: tuple[Any, Any] | None) -> Any:
    """Return what :func:`toposeam.volume.problem.cells.add_prices` takes, for two stacks on a box.

    Parameters
    ----------
    one, other : (D, H, W, C) float32 arrays
        Shares of white.
    spacing : three floats
    numbers : two (D, H, W) arrays of integers, optional
    """
    bright = brightness_by_slabs(one, other, window_sides(spacing))
    if numbers is None:
        return bright[..., np.newaxis]
    return np.stack([bright, *numbers], axis=3, dtype=np.int32, casting="unsafe")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Renumber:
    """Gives cells of the second stack the numbers of the same ones of the first, and others new ones."""

    known: Ints
    numbers: Ints
    beyond: int

    def __call__(self, cells: npt.NDArray[Any]) -> npt.NDArray[np.int32]:
        result = np.where(cells > 0, cells.astype(np.int64) + self.beyond, 0)
        if len(self.known):
            order = np.argsort(self.known)
            known, numbers = self.known[order], self.numbers[order]
            at = np.minimum(np.searchsorted(known, cells), len(known) - 1)
            result = np.where(known[at] == cells, numbers[at], result)
        return result.astype(np.int32)


def _same_cells(given: Sequence[Any], places: Places) -> dict[int, int]:
    """Find the number in the first stack of each cell of the second that is the same."""
    pairs: dict[tuple[int, int], int] = {}
    sizes: tuple[dict[int, int], dict[int, int]] = {}, {}
    for one, other in _slabs(given, places):
        for size, numbers in zip(sizes, (one, other), strict=True):
            for number, count in zip(*np.unique(numbers, return_counts=True), strict=True):
                size[int(number)] = size.get(int(number), 0) + int(count)
        both = (one > 0) & (other > 0)
        found = np.unique(np.stack([one[both], other[both]]).astype(np.int64), axis=1, return_counts=True)
        for first, second, count in zip(*found[0], found[1], strict=True):
            pairs[int(first), int(second)] = pairs.get((int(first), int(second)), 0) + int(count)
    best: tuple[dict[int, tuple[int, int]], dict[int, tuple[int, int]]] = {}, {}
    for (first, second), count in pairs.items():
        best[0][first] = max(best[0].get(first, (0, 0)), (count, second))
        best[1][second] = max(best[1].get(second, (0, 0)), (count, first))
    return {
        second: first
        for second, (count, first) in best[1].items()
        if best[0][first][1] == second and count >= _SAME * min(sizes[0][first], sizes[1][second])
    }


def _slabs(given: Sequence[Any], places: Places) -> Iterator[tuple[Any, Any]]:
    box = places.overlap
    for start in range(box[0].start, box[0].stop, _SLICES):
        part = (slice(start, min(start + _SLICES, box[0].stop)), *box[1:])
        yield _computed(given[0][places.inside(part, "a")]), _computed(given[1][places.inside(part, "b")])


def _computed(values: Any) -> Any:
    return np.asarray(values)


def _check(numbers: Any, size: tuple[int, ...], which: str) -> None:
    dtype = getattr(numbers, "dtype", None)
    if dtype is None or dtype.kind not in "biu" or tuple(numbers.shape) != tuple(size):
        shown = type(numbers).__name__ if dtype is None else f"{dtype} of shape {tuple(numbers.shape)}"
        raise ImageError(
            "the cells of {array} are {shown}; pass whole numbers, one for each of its {size} voxels",
            kind="cells",
            array=Term(which),
            shown=shown,
            size="×".join(map(str, size)),
        )
