"""The whole thing that differs at a point: a walker who stands in one picture and not in the other."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy

import toposeam as ts
from toposeam.arrays import Labels, Mask
from toposeam.layers.canvas.layer import Box
from toposeam.seam.result.verdict import HALF_COST
from toposeam_cli.edit.strokes import discs_of

#: The box round a tap in which a thing is looked for: its half side, and how far from the tap it may begin,
#: px of the preview.
_AROUND_TAP, _NEAR_TAP = 300, 24
#: A thing is taken with so many px round it, and is at most this share of the box.
_RIM_PX, _LARGEST_THING = 4, 0.3


def strokes_of_thing(
    labelling: ts.layers.Labelling, labels: Labels, at: tuple[float, float], layer: int
) -> list[dict[str, Any]]:
    """Return strokes that take all of what differs at a point from a picture that does not show there.

    Parameters
    ----------
    labelling : Labelling
    labels : (H, W) int array
        What shows.
    at : (float, float)
        x and y on the canvas, px.
    layer : int
        The picture to take it from.

    Returns
    -------
    list of dict
        Discs that cover it; none if both pictures show the same there.
    """
    row, column = int(at[1]), int(at[0])
    box = Box(row, column, row + 1, column + 1).grown(_AROUND_TAP).shared(labelling.canvas)
    shows = int(labels[row, column])
    cost = labelling.costs.get((min(shows, layer), max(shows, layer)))
    if shows < 0 or shows == layer or cost is None:
        return []
    right, down = cost.on(box)
    differs = np.zeros(box.shape, np.float32)
    differs[:, :-1] += right
    differs[:, 1:] += right
    differs[:-1] += down
    differs[1:] += down
    differs = scipy.ndimage.gaussian_filter(differs / 4, 2.0)
    differs[~cost.shared(box)] = 0
    thing = _blob(differs, (row - box.top, column - box.left))
    if thing is None:
        return []
    return [
        {
            "kind": "show",
            "layer": layer,
            "radius": radius + _RIM_PX / 2,
            "points": [[x + box.left, y + box.top]],
        }
        for x, y, radius in discs_of(thing)
    ]


def _blob(differs: np.ndarray, at: tuple[int, int]) -> Mask | None:
    """Find what differs at a point, or the nearest such thing; None if nothing does nearby."""
    rows, columns = np.ogrid[: differs.shape[0], : differs.shape[1]]
    near = (rows - at[0]) ** 2 + (columns - at[1]) ** 2 <= _NEAR_TAP**2
    least = HALF_COST
    while True:
        mask = differs > least
        closed = scipy.ndimage.binary_closing(np.pad(mask, 8), iterations=4)[8:-8, 8:-8]
        piece: np.ndarray = np.asarray(scipy.ndimage.label(closed)[0])
        there = near & (piece > 0)
        if not there.any():
            return None
        ys, xs = np.nonzero(there)
        first = int(np.argmin((ys - at[0]) ** 2 + (xs - at[1]) ** 2))
        thing = piece == piece[ys[first], xs[first]]
        if np.count_nonzero(thing) <= _LARGEST_THING * thing.size:
            break
        least *= 1.6
    grown = scipy.ndimage.binary_dilation(scipy.ndimage.binary_fill_holes(thing), iterations=_RIM_PX)
    return np.asarray(grown)
