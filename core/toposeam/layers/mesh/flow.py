"""Where what one picture shows near a seam lies in the other: a dense flow, checked both ways."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats, Floats32, Mask
from toposeam.images import blurred
from toposeam.layers.canvas.layer import Layer

#: Blur of the windows of the flow, px, refinements of each size, and sizes, each half of the one before.
_WINDOW, _REFINEMENTS, _SIZES = 3.5, 4, 3
#: What keeps the flow of plain ground small, in squares of full scale per px.
_FLAT = 1e-6
#: Farthest that flows there and back may differ, and the longest one, px.
_OPEN, _LONGEST = 0.7, 12.0
#: Distance of points, px, and the blur in which their structure is measured.
_STEP, _STRUCTURE = 4, 3.0
#: Share of the pixels that show too little, and the weight of a point.
_PLAIN, _WEIGHT = 0.4, 0.3


def flow_near(layers: Sequence[Layer], labels: Mask, reach: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Find points of two warped pictures that show the same near their seam.

    Parameters
    ----------
    layers : two of Layer
        Of :func:`toposeam.layers.mesh.trial.trial_seam`: both fill one box.
    labels : (H, W) bool array
        True where the second one shows.
    reach : float
        Largest distance of the seam, px.

    Returns
    -------
    first, second : (M, 2) arrays
        x and y on the canvas of the layers.
    normal : (M, 2) array
        The direction in which they are known to meet; along an edge they are not.
    weight : (M,) array
    """
    shown = layers[0].covered & layers[1].covered
    border = scipy.ndimage.binary_dilation(labels) & scipy.ndimage.binary_dilation(~labels) & shown
    near = scipy.ndimage.distance_transform_edt(~border) < reach
    nothing = np.zeros((0, 2))
    if not border.any():
        return nothing, nothing, nothing, np.zeros(0)
    part = tuple(slice(max(0, int(own.min()) - 8), int(own.max()) + 9) for own in np.nonzero(near & shown))
    shown, near = shown[part], near[part]
    a, b = (_levelled(np.asarray(layer.image)[part].mean(axis=2), shown) for layer in layers)
    there, back = _flow(a, b), _flow(b, a)
    y, x = np.indices(a.shape, dtype=np.float32)
    landed = np.stack([y, x]) + there
    returned = np.stack([scipy.ndimage.map_coordinates(one, landed, order=1, mode="nearest") for one in back])
    good = shown & (np.hypot(*(there + returned)) < _OPEN) & (np.hypot(*there) < _LONGEST)
    at = np.clip(np.rint(landed).astype(int), 0, np.array(a.shape)[:, None, None] - 1)
    good &= shown[at[0], at[1]]
    good &= near
    down, right = np.gradient(blurred(a, 1.0)[0])
    xx, xy, yy = blurred(np.stack([right * right, right * down, down * down]), _STRUCTURE)[0]
    spread = np.hypot(xx - yy, 2 * xy)
    most, least = (xx + yy + spread) / 2, (xx + yy - spread) / 2
    if not good.any():
        return nothing, nothing, nothing, np.zeros(0)
    good &= most > np.quantile(most[shown], _PLAIN)
    grid = np.zeros_like(good)
    grid[::_STEP, ::_STEP] = True
    rows, columns = np.nonzero(good & grid)
    turn = 0.5 * np.arctan2(2 * xy, xx - yy)[rows, columns]
    across = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    along = np.stack([-across[:, 1], across[:, 0]], axis=1)
    corner = np.clip(3 * least / np.maximum(most, 1e-12), 0, 1)[rows, columns]
    corner_at = np.array([part[1].start, part[0].start]) + np.array(layers[0].at, float)
    first = np.stack([columns, rows], axis=1) + corner_at
    second = first + there[::-1, rows, columns].T
    weight = np.full(len(first), _WEIGHT)
    return (
        np.concatenate([first, first]),
        np.concatenate([second, second]),
        np.concatenate([across, along]),
        np.concatenate([weight, weight * corner]),
    )


def _flow(a: Floats32, b: Floats32) -> Floats32:
    """Find the (2, H, W) displacements, y and x, at which `b` shows what `a` does (Lucas and Kanade 1981),
    from coarse to fine.
    """
    sizes = [(a, b)]
    while len(sizes) < _SIZES and min(sizes[-1][0].shape) > 32:
        sizes.append(
            tuple(scipy.ndimage.zoom(one, 0.5, order=1, grid_mode=True, mode="nearest") for one in sizes[-1])
        )
    found = np.zeros((2, *sizes[-1][0].shape), np.float32)
    for one, other in reversed(sizes):
        if found.shape[1:] != one.shape:
            zoom = [after / before for after, before in zip(one.shape, found.shape[1:], strict=True)]
            found = np.stack(
                [
                    2 * scipy.ndimage.zoom(part, zoom, order=1, grid_mode=True, mode="nearest")
                    for part in found
                ]
            )
        down, right = np.gradient(blurred(one, 0.7)[0])
        yy, xy, xx = blurred(np.stack([down * down, down * right, right * right]), _WINDOW)[0]
        yy, xx = yy + _FLAT, xx + _FLAT
        scale = 1 / (yy * xx - xy * xy)
        place = np.indices(one.shape, np.float32)
        for _ in range(_REFINEMENTS):
            left = one - scipy.ndimage.map_coordinates(other, place + found, order=1, mode="nearest")
            own, beside = blurred(np.stack([down * left, right * left]), _WINDOW)[0]
            step = np.stack([xx * own - xy * beside, yy * beside - xy * own]) * scale
            found = found + np.clip(step, -1, 1)
    return np.asarray(found, np.float32)


def _levelled(gray: Floats32, shown: npt.NDArray[np.bool_]) -> Floats32:
    """Fill what is not shown by the mean."""
    return np.where(shown, gray, gray[shown].mean()).astype(np.float32)
