"""What it costs to cut one cell: more than any mismatch, but no wall, which would block dense tissue.

A surface in a stack is not looked at, but cells are counted. Without a segmentation cells are taken to be
what is bright among its surroundings: with S the brighter of both stacks, blurred, and L and H its least and
greatest value within a window about as wide as a cell, smoothed, an interface costs ::

    10⁴ f²,   f = (S - L) / max(H - L, 0.1)       the lesser of its two voxels

so that the surface follows the valleys between cells, however bright these are. With a segmentation of
either stack an interface within one cell costs more than any in the brightest place.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Bytes, Floats32
from toposeam.heat.bricks import HIGH, LOW, along

#: Cost of an interface in the brightest place, and in a cell that is known.
_BRIGHT, _KNOWN = np.float32(1e4), np.float32(1e5)
#: Side of the window, in voxels that are cubes, and its bounds.
_WINDOW, _SIDES = 23, (3, 31)
#: Standard deviation of the blur, in voxels; reach of its tail.
_BLUR, _TAIL = 1.0, 4
#: Least contrast, as a share of white, that counts as that of cells.
_LEAST_CONTRAST = np.float32(0.1)
#: Voxels, about, of slabs that are processed together.
_SLAB_VOXELS = 1 << 22


def window_sides(spacing: Sequence[float]) -> tuple[int, ...]:
    """Return the odd sides of the window, in voxels, for the depth, height and width of a voxel.

    Examples
    --------
    >>> window_sides((1, 1, 1)), window_sides((4, 1, 1))
    ((23, 23, 23), (9, 31, 31))
    """
    mean = float(np.prod(spacing)) ** (1 / 3)
    return tuple(2 * (int(np.clip(_WINDOW * mean / length, *_SIDES)) // 2) + 1 for length in spacing)


def reach_of(sides: Sequence[int]) -> tuple[int, ...]:
    """Return how far from a voxel others count for its brightness, along each axis."""
    return tuple(_TAIL + 2 * (side // 2) for side in sides)


def brightness(shown: Floats32, sides: Sequence[int]) -> Bytes:
    """Compute f², 255 for 1, of the brighter of both stacks, (D, H, W), as shares of white."""
    bright = ndimage.gaussian_filter(shown, _BLUR, truncate=_TAIL)
    low, high = (
        ndimage.uniform_filter(extreme(bright, size=sides), sides)
        for extreme in (ndimage.minimum_filter, ndimage.maximum_filter)
    )
    share = np.clip((bright - low) / np.maximum(high - low, _LEAST_CONTRAST), 0, 1)
    with np.errstate(invalid="ignore"):  # NaN is refused where the stacks are compared
        result: Bytes = np.rint(255 * np.square(share)).astype(np.uint8)
    return result


def brightness_by_slabs(a: Floats32, b: Floats32, sides: Sequence[int]) -> Bytes:
    """Compute :func:`brightness` of two (D, H, W, C) arrays slab by slab, to bound memory."""
    reach = reach_of(sides)[0]
    step = max(reach, _SLAB_VOXELS // int(np.prod(a.shape[1:3])))
    result = np.empty(a.shape[:3], np.uint8)
    for start in range(0, len(a), step):
        low, stop = max(0, start - reach), start + step
        part = slice(low, stop + reach)
        result[start:stop] = brightness(np.maximum(a[part], b[part]).max(axis=3), sides)[start - low :][:step]
    return result


def add_prices(costs: Sequence[Floats32], cells: npt.NDArray[Any]) -> None:
    """Add, in place, the prices of cells to the costs of interfaces.

    Parameters
    ----------
    costs : sequence of three float32 arrays
        Where a cost is 0 there is no interface.
    cells : (D, H, W, 1) or (D, H, W, 3) array of integers
        Brightness, 0 to 255, and in each stack the number of the cell, 0 where there is none.
    """
    for axis, cost in enumerate(costs):
        one, other = cells[along(axis, LOW)], cells[along(axis, HIGH)]
        price = np.minimum(one[..., 0], other[..., 0]) * (_BRIGHT / np.float32(255))
        if cells.shape[3] > 1:
            inside = np.zeros(price.shape, bool)
            for here in (1, 2):
                for there in (1, 2):
                    inside |= (one[..., here] == other[..., there]) & (one[..., here] > 0)
            price[inside] = _KNOWN
        cost += np.where(cost > 0, price, np.float32(0))
