"""A stack, whose voxels are read when they are needed, and the size of a voxel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toposeam.errors import ImageError

#: Relative tolerance within which voxel sizes are equal.
_SAME = 1e-3
#: Files of stacks, by their last extensions.
SUFFIXES = (".tif", ".tiff", ".npy", ".zarr")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stack:
    """Voxels in a file, and their size."""

    #: (D, H, W) or (D, H, W, C) array that is read part by part, or a dask array.
    voxels: Any
    #: Depth, height and width of a voxel; None if unknown.
    spacing: tuple[float, float, float] | None = None
    #: Unit of `spacing`.
    unit: str = "µm"
    source: Path

    @property
    def size(self) -> tuple[int, int, int]:
        """Depth, height and width in voxels."""
        depth, height, width = self.voxels.shape[:3]
        return int(depth), int(height), int(width)


def common_spacing(
    a: Stack, b: Stack, given: tuple[float, float, float] | None
) -> tuple[tuple[float, float, float] | None, str]:
    """Return the size of both stacks' voxels, and its unit.

    Raises
    ------
    ImageError
        When they differ.
    """
    if given is not None:
        return given, a.unit
    if a.spacing is None or b.spacing is None:
        known = a if a.spacing is not None else b
        return known.spacing, known.unit
    same = all(
        math.isclose(one, other, rel_tol=_SAME) for one, other in zip(a.spacing, b.spacing, strict=True)
    )
    if not same or a.unit != b.unit:
        raise ImageError(
            f"the voxels of {a.source.name} are {_shown(a)}, those of {b.source.name} {_shown(b)} (z×y×x); "
            "resample one of them, or say with --spacing what both are"
        )
    return a.spacing, a.unit


def _shown(stack: Stack) -> str:
    return "×".join(f"{side:.6g}" for side in stack.spacing or ()) + f" {stack.unit}"
