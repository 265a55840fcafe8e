"""Roll a texture that repeats so that its border does not show.

On a cylinder or a torus no line is its border, and the one at which the picture happens to begin may be one
of its strongest: the edge of a row of cells, a vein. So a texture whose border shows more than most of its
lines do begins at another one, the nearest that shows no more than half of them.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.texture.canvas.copy_borders import ROWS
from toposeam.texture.canvas.synthesis import Synthesis

#: Largest share of the lines that show less than the border does where it is left as it is.
_MOST_QUIETER = 0.75


def begun(made: Synthesis) -> Synthesis:
    """Roll a texture along the axes on which it repeats, where its borders show.

    Parameters
    ----------
    made : Synthesis

    Returns
    -------
    Synthesis
        The same on an axis on which it ends.
    """
    if not any(made.wraps):
        return made
    shift = tuple(
        _first(steps) if wraps else 0 for steps, wraps in zip(line_steps(made.image), made.wraps, strict=True)
    )
    if not any(shift):
        return made

    def moved(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        return np.roll(values, (-shift[0], -shift[1]), (0, 1))

    return dataclasses.replace(
        made,
        image=moved(made.image),
        alpha=None if made.alpha is None else moved(made.alpha),
        maps=tuple(map(moved, made.maps)),
        normal=None if made.normal is None else moved(made.normal),
        labels=moved(made.labels),
        index=moved(made.index),
        verdict=made.verdict.rolled((shift[0], shift[1]), made.labels.shape),
    )


def line_steps(image: npt.NDArray[Any]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Compute how much each line of an image (H, W[, C]) differs from the one before it, in the mean of the
    channels: (H,) for rows and (W,) for columns; the first one from the last.

    Examples
    --------
    >>> rows, columns = line_steps(np.array([[1, 2, 3], [5, 6, 7]]))
    >>> rows.tolist(), columns.tolist()
    ([4.0, 4.0], [2.0, 1.0, 1.0])
    """
    height, width = image.shape[:2]
    down, across = np.zeros(height), np.zeros(width)
    for top in range(0, height, ROWS):
        part = image[np.arange(top - 1, min(top + ROWS, height))]  # and the row before
        part = part.astype(np.float32) if part.ndim == 2 else part.mean(axis=2, dtype=np.float32)
        down[top : top + ROWS] = np.abs(np.diff(part, axis=0)).mean(axis=1, dtype=np.float64)
        across[1:] += np.abs(np.diff(part[1:], axis=1)).sum(axis=0, dtype=np.float64)
        across[0] += np.abs(part[1:, 0] - part[1:, -1]).sum(dtype=np.float64)
    return down, across / height


def _first(steps: npt.NDArray[np.float64]) -> int:
    """Find the line to begin with: 0, or the nearest quiet one where that shows."""
    if not steps[0] > np.quantile(steps, _MOST_QUIETER):  # NaN shows nowhere
        return 0
    quiet = np.flatnonzero(steps <= np.median(steps))
    return int(quiet[np.minimum(quiet, len(steps) - quiet).argmin()])
