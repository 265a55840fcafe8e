"""Seams drawn over a picture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Indices, Mask
from toposeam.checks import check_items
from toposeam.display import to_rgba8
from toposeam.vector.polyline import Polyline

#: Colours of the seam and of its halo.
_LINE_RGB = np.array([230, 30, 40], np.uint8)
_HALO_RGB = np.array([255, 255, 255], np.uint8)


@runtime_checkable
class HasPaths(Protocol):
    """A seam, or anything else that consists of lines."""

    @property
    def paths(self) -> Sequence[Polyline]:
        """Its lines, px of the picture."""


def draw_seams(image: npt.NDArray[Any], seams: Iterable[HasPaths]) -> npt.NDArray[np.uint8]:
    """Draw seams over a picture, in red on a white halo, thick enough to be seen at the picture's size.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array
    seams : iterable of Seam
        On the same canvas.

    Returns
    -------
    (H, W, 3) uint8 array

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> seam = ts.find_seam(np.zeros((6, 8)), np.ones((6, 8)))
    >>> ts.seam.draw_seams(np.zeros((6, 8)), [seam]).shape
    (6, 8, 3)
    """
    drawn = to_rgba8(image)[..., :3]
    visited = np.zeros(drawn.shape[:2], bool)
    for seam in check_items("seams", seams, HasPaths, "a sequence of Seams"):
        for path in seam.paths:
            _visit(visited, path)
    radius = max(0, round(min(drawn.shape[:2]) / 500))
    row, column = np.nonzero(visited)
    _stamp(drawn, row, column, radius + max(1, radius), _HALO_RGB)
    _stamp(drawn, row, column, radius, _LINE_RGB)
    return drawn


def _visit(visited: Mask, path: Polyline) -> None:
    """Mark the pixels whose upper left corners a line visits; on the lower and right border the last ones."""
    from skimage.draw import line

    corners = np.minimum(np.floor(path.outline), np.array(visited.shape[::-1]) - 1).astype(int)
    for (x, y), (to_x, to_y) in zip(corners[:-1].tolist(), corners[1:].tolist(), strict=True):
        visited[line(y, x, to_y, to_x)] = True


def _stamp(
    drawn: npt.NDArray[np.uint8], row: Indices, column: Indices, radius: int, colour: npt.NDArray[np.uint8]
) -> None:
    """Colour every pixel within a radius of the given ones; seams are few pixels of a large picture."""
    from skimage.morphology import disk

    height, width = drawn.shape[:2]
    for down, right in np.argwhere(disk(radius)) - radius:
        drawn[np.clip(row + down, 0, height - 1), np.clip(column + right, 0, width - 1)] = colour
