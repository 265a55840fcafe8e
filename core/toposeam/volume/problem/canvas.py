"""Boxes of two stacks on one canvas, and their common box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from toposeam.checks import check_whole, kind_error
from toposeam.errors import OverlapError, Term

#: Largest offset between two stacks along an axis, in voxels.
_MAX_OFFSET = 10**8


@dataclass(frozen=True, slots=True)
class Places:
    """Two boxes on their common canvas, (z, y, x)."""

    size_a: tuple[int, ...]
    size_b: tuple[int, ...]
    #: Index, on the canvas, of each stack's first voxel.
    a: tuple[int, ...]
    b: tuple[int, ...]

    @property
    def canvas(self) -> tuple[int, ...]:
        """Size of the smallest box that contains both stacks."""
        return tuple(
            max(a + size_a, b + size_b)
            for a, size_a, b, size_b in zip(self.a, self.size_a, self.b, self.size_b, strict=True)
        )

    @property
    def overlap(self) -> tuple[slice, ...]:
        """Box that both stacks cover."""
        return tuple(
            slice(max(a, b), min(a + size_a, b + size_b))
            for a, size_a, b, size_b in zip(self.a, self.size_a, self.b, self.size_b, strict=True)
        )

    def inside(self, box: Sequence[slice], which: str) -> tuple[slice, ...]:
        """Return a box of the canvas in the coordinates of stack "a" or "b"."""
        start = self.a if which == "a" else self.b
        return tuple(
            slice(part.start - first, part.stop - first) for part, first in zip(box, start, strict=True)
        )

    def box(self, which: str) -> tuple[slice, ...]:
        """Return the box of a stack on the canvas."""
        start, size = (self.a, self.size_a) if which == "a" else (self.b, self.size_b)
        return tuple(slice(first, first + length) for first, length in zip(start, size, strict=True))


def place_stacks(size_a: Sequence[int], size_b: Sequence[int], offset: Any) -> Places:
    """Place two stacks, the second one at an offset from the first.

    Parameters
    ----------
    size_a, size_b : three int
    offset : three int
        Position of b's first voxel in a, (z, y, x); may be negative.

    Raises
    ------
    OptionError
        When `offset` is not three whole numbers.
    OverlapError
        When the stacks do not overlap.

    Examples
    --------
    >>> places = place_stacks((4, 5, 6), (4, 5, 6), (0, -1, 4))
    >>> places.canvas, places.overlap
    ((4, 6, 10), (slice(0, 4, None), slice(1, 5, None), slice(4, 6, None)))
    """
    try:
        steps = [check_whole("offset", step, -_MAX_OFFSET, _MAX_OFFSET) for step in offset]
    except TypeError as error:
        raise kind_error("offset", offset, "three whole numbers: z, y, x") from error
    if len(steps) != 3:
        raise kind_error("offset", offset, "three whole numbers: z, y, x")
    a = tuple(max(0, -step) for step in steps)
    b = tuple(max(0, step) for step in steps)
    places = Places(tuple(size_a), tuple(size_b), a, b)
    for axis, part in zip("zyx", places.overlap, strict=True):
        if part.stop <= part.start:
            raise OverlapError(
                "at offset {value} the stacks of {size_a} and {size_b} voxels do not overlap "
                "along {axis}; check the offset (z,y,x, in voxels)",
                kind="apart",
                parameter=Term("offset"),
                value=",".join(map(str, steps)),
                size_a=_shown(size_a),
                size_b=_shown(size_b),
                axis=axis,
            )
    return places


def _shown(size: Sequence[int]) -> str:
    return "×".join(map(str, size))
