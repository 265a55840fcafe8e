"""The boundary of a joined picture: how it is bent, and which rectangle of it is kept."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
import scipy

from toposeam.arrays import Floats, Floats32, Mask
from toposeam.layers.boundary.box_search import best_box
from toposeam.layers.boundary.ground import BorderGround, ground_of, prices_of
from toposeam.layers.boundary.rectangling import Rectangling
from toposeam.layers.boundary.reduced import Overview, overview
from toposeam.layers.canvas.canvas import common_canvas
from toposeam.layers.canvas.layer import Box, Layer
from toposeam.layers.canvas.transforms import (
    MeshTransform,
    Transform,
    fitted_transforms,
    is_move,
    similarity,
)
from toposeam.layers.canvas.warping import coordinates, on_canvas, warped_box

#: How far a warp moves the border about, as a share of the shorter side.
_REACH = 0.035
#: Local steps towards the first rectangle, and on from there towards the one that is best then.
_ROUNDS, _MORE_ROUNDS = 16, 28
#: Least displacement that is worth it, px.
_LEAST = 0.5
#: Megapixels of a canvas: as many as there are.
_LARGEST = 1e12


def fitted_boundary(
    layers: Sequence[Layer], transforms: Sequence[Transform], wrap: int | None = None
) -> MeshTransform | None:
    """Bend a canvas a little, so that the border of what shows comes nearer to a rectangle.

    Parameters
    ----------
    layers : sequence of Layer
        The pictures; where they lie is ignored.
    transforms : sequence of Transform
        From their pixels to the canvas.
    wrap : int, optional
        Width of a round canvas, px. Its columns stay where they are.

    Returns
    -------
    MeshTransform or None
        From the canvas to the bent one; None where that would move nothing by half a pixel.
    """
    boxes = [_box_of(*item) for item in zip(layers, transforms, strict=True)]
    blanks = [Layer(np.broadcast_to(np.uint8(0), box.shape), at=(box.left, box.top)) for box in boxes]
    canvas = common_canvas(blanks, max_megapixels=_LARGEST, wrap=wrap)
    seen = overview(layers, transforms, canvas.frame, wrap)
    if seen.cover.all() or not seen.cover.any():
        return None
    goes_round = wrap is not None
    ground = ground_of(seen)
    grid = Rectangling(seen.cover, ground, goes_round=goes_round)
    real, hole = prices_of(seen.cover, ground, _REACH * min(seen.cover.shape))
    box = best_box(np.where(seen.cover, real, hole), goes_round=goes_round)
    coefficients = grid.solve(box, _ROUNDS)
    mesh = MeshTransform(_STILL, seen.cover.shape[::-1], grid.cell, coefficients)
    cover, moved = _moved(mesh, seen.cover, ground)
    real, hole = prices_of(cover, moved, 0.0)
    box = best_box(np.where(cover, real, hole), goes_round=goes_round)
    coefficients = grid.solve(box, _MORE_ROUNDS, coefficients)
    boundary = _enlarged(coefficients, grid.cell, seen)
    return boundary if np.abs(boundary.coefficients).max() > _LEAST else None


def laid_in_memory(layers: Sequence[Layer], transforms: Sequence[Transform], wrap: int | None) -> list[Layer]:
    """Lay pictures on a canvas, whose boundary is bent if one of them is more than moved."""
    if not all(map(is_move, transforms)):
        transforms = fitted_transforms(transforms, fitted_boundary(layers, transforms, wrap), wrap)
    return [on_canvas(*item) for item in zip(layers, transforms, strict=True)]


def fitted_box(seen: Overview, prices: tuple[Floats32, Floats32], *, goes_round: bool) -> Box:
    """Choose what is kept of an overview.

    Parameters
    ----------
    seen : Overview
    prices : two of (H, W) float32 arrays
        Of :func:`toposeam.layers.boundary.prices_of`.
    goes_round : bool
        Whether the full width is kept.
    """
    values = np.where(seen.cover, *prices)
    if not goes_round:
        return best_box(values)
    clean = np.asarray((values > -1).all(axis=1))  # rows that need no fill that would be seen
    only = np.where(clean[:, None], values, -1e3)
    return best_box(only if clean.any() else values, goes_round=True)


_STILL = similarity((0, 0))


def _box_of(layer: Layer, transform: Transform) -> Box:
    if not is_move(transform):
        return warped_box(layer, transform)
    x, y = transform.to_canvas(np.zeros((1, 2)))[0].round().astype(int).tolist()
    return Box(0, 0, *layer.image.shape[:2]).moved(y, x)


def _moved(mesh: MeshTransform, cover: Mask, ground: BorderGround) -> tuple[Mask, BorderGround]:
    """Return where a bent overview shows something, and its ground there."""
    at = coordinates(mesh, Box(0, 0, *cover.shape))
    where = np.moveaxis(at[..., ::-1], -1, 0)

    def bent(values: Floats32, mode: str) -> Floats32:
        return np.asarray(scipy.ndimage.map_coordinates(values, where, order=1, mode=mode))

    texture, depth = bent(ground.texture, "nearest"), bent(ground.depth, "nearest")
    moved = dataclasses.replace(ground, texture=texture, depth=depth)
    return np.asarray(bent(cover.astype(np.float32), "constant") > 0.98), moved


def _enlarged(coefficients: Floats, cell: float, seen: Overview) -> MeshTransform:
    """Return the displacement of an overview as one of the canvas."""
    height, width = (round(side * seen.scale) for side in seen.cover.shape)
    left, top = (round(edge * seen.scale) for edge in seen.at)
    cell = round(cell * seen.scale, 6)
    rows, columns = math.ceil(height / cell) + 3, math.ceil(width / cell) + 3
    more = [(0, max(0, rows - coefficients.shape[0])), (0, max(0, columns - coefficients.shape[1])), (0, 0)]
    own = np.pad(coefficients, more, mode="edge")[:rows, :columns] * seen.scale
    return MeshTransform(similarity((left, top)), (width, height), cell, own.round(4) + 0.0)
