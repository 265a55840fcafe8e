"""From a map of sources to pixels, smoothed along the seams only.

Where every pixel near shows the same copy, the texture is that copy. At a seam each pixel becomes the mean of
what the copies showing round it have *there*: copy i, seen k pixels away, contributes its own pixel at this
very place, with the weight of k in a binomial kernel. So the smoothing mixes neighbouring copies and never
blurs one of them, and the map of sources is all it needs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Ints32, Mask
from toposeam.images import full_scale, in_dtype
from toposeam.texture.canvas.copy_borders import ROWS, joints

#: Largest distance from a seam, px, within which copies can be mixed.
MAX_SMOOTH = 8
#: Least length of a mixed normal that has a direction; shorter ones are sums of opposite normals.
_LEAST_NORMAL = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lift:
    """Light given to one channel of the copies: each pixel's value becomes gain × value + offset, within the
    range of values.
    """

    gain: npt.NDArray[np.float32]  #: (H, W, 1) or broadcast to it
    offset: npt.NDArray[np.float32]  #: (H, W, 1)
    low: float
    high: float


def render(
    index: Ints32,
    plane: npt.NDArray[Any],
    usable: Mask,
    wrap: tuple[bool, bool],
    smooth: int,
    lift: Lift | None = None,
    near: Sequence[Ints32] | None = None,
) -> npt.NDArray[Any]:
    """Render the picture that a map of sources shows.

    Parameters
    ----------
    index : (H, W) int32 array
        Flat index into the atlas, or -1.
    plane : (AH, AW, C) array
        Any map, on the atlas.
    usable : (AH, AW) bool array
    wrap : (bool, bool)
        Whether rows and columns continue at the opposite border.
    smooth : int
        Width, px, to either side of a seam within which copies are mixed; 0 for none.
    lift : Lift, optional
        The light of the copy that shows at each pixel of a plane of one channel; where copies are mixed, each
        has its own.
    near : sequence of int32 arrays, optional
        Result of :func:`near_seams`, where the same map is drawn several times.

    Returns
    -------
    (H, W, C) array of the plane's dtype, 0 where there is no source
    """
    flat = plane.reshape(-1, plane.shape[2])
    result = np.empty((*index.shape, plane.shape[2]), plane.dtype)
    for first in range(0, len(index), ROWS):
        rows = slice(first, first + ROWS)
        flat.take(index[rows], axis=0, out=result[rows], mode="clip")
        if lift is not None:
            gain = np.broadcast_to(lift.gain, result.shape)[rows]
            result[rows] = _stored(gain * result[rows] + lift.offset[rows], plane.dtype, lift)
    if index.min(initial=0) < 0:
        result[index < 0] = 0
    if smooth:
        for at in near_seams(index, plane.shape[1], wrap, smooth) if near is None else near:
            mixed = _mixed(index, flat, usable.ravel(), plane.shape[1], wrap, smooth, at, lift)
            result.reshape(-1, result.shape[2])[at] = _stored(mixed, plane.dtype, lift)
    return result


def render_seen(
    index: Ints32,
    plane: npt.NDArray[Any],
    opacity: npt.NDArray[Any],
    usable: Mask,
    wrap: tuple[bool, bool],
    smooth: int,
) -> npt.NDArray[Any]:
    """Render as :func:`render`, but where copies are mixed count each by its opacity, an (AH, AW, 1) array,
    so that colours that cannot be seen do not show at seams.
    """
    picture = render(index, plane, usable, wrap, 0)
    share = (opacity / full_scale(opacity.dtype)).astype(np.float32)
    weighted = np.concatenate([plane * share, share], axis=2).astype(np.float32)
    mixed, hard = (render(index, weighted, usable, wrap, reach) for reach in (smooth, 0))
    near = (mixed != hard).any(axis=2) & (mixed[..., -1] > 0)
    picture[near] = _stored(mixed[near, :-1] / mixed[near, -1:], plane.dtype, None)
    return picture


def render_normals(
    index: Ints32, plane: npt.NDArray[Any], usable: Mask, wrap: tuple[bool, bool], smooth: int
) -> npt.NDArray[Any]:
    """Render a map of unit vectors as :func:`render`, and give those that were mixed length 1 again.

    Integers and floats of 0 or more hold (v + 1) / 2 as a share of white, other floats v itself. Where
    vectors cancel out, that of the pixel's own copy shows.
    """
    picture = render(index, plane, usable, wrap, 0)
    for at in near_seams(index, plane.shape[1], wrap, smooth) if smooth else ():
        mixed = _mixed(index, plane.reshape(-1, 3), usable.ravel(), plane.shape[1], wrap, smooth, at, None)
        half = 0.0 if picture.dtype.kind == "f" and plane.min() < 0 else 0.5 * full_scale(picture.dtype)
        vectors = mixed - half
        length = np.linalg.norm(vectors, axis=1, keepdims=True)
        own = picture.reshape(-1, 3)[at]
        kept = (length[:, 0] < _LEAST_NORMAL * (half or 1.0)) | (mixed == own).all(axis=1)
        unit = _stored(vectors / np.maximum(length, 1e-12) * (half or 1.0) + half, picture.dtype, None)
        picture.reshape(-1, 3)[at] = np.where(kept[:, np.newaxis], own, unit)
    return picture


def _stored(
    values: npt.NDArray[np.floating[Any]], dtype: np.dtype[Any], lift: Lift | None
) -> npt.NDArray[Any]:
    """Convert values to the picture's dtype."""
    if lift is not None:
        values = np.clip(values, lift.low, lift.high)
    return in_dtype(values, dtype)


def near_seams(index: Ints32, stride: int, wrap: tuple[bool, bool], smooth: int) -> list[Ints32]:
    """Find the flat places of the pixels within reach of a seam, those of some rows of the canvas in one
    array.

    Parameters
    ----------
    index, stride, wrap
        As for :func:`toposeam.texture.canvas.copy_borders.joints`.
    smooth : int
        Width, px, to either side of a seam within which copies are mixed.
    """
    near = np.zeros(index.shape, bool)
    for first, second, _ in joints(index, stride, wrap):
        near.reshape(-1)[first] = True
        near.reshape(-1)[second] = True
    for axis in (0, 1):
        for _ in range(smooth - 1):
            grown = near | np.roll(near, 1, axis) | np.roll(near, -1, axis)
            near = grown
    near &= index >= 0
    width, tops = index.shape[1], range(0, index.shape[0], ROWS)
    return [(np.flatnonzero(near[top : top + ROWS]) + top * width).astype(np.int32) for top in tops]


def _mixed(
    index: Ints32,
    flat: npt.NDArray[Any],
    usable: Mask,
    stride: int,
    wrap: tuple[bool, bool],
    smooth: int,
    at: Ints32,
    lift: Lift | None,
) -> npt.NDArray[np.floating[Any]]:
    kernel = np.array([1.0])
    for _ in range(smooth):
        kernel = np.convolve(kernel, [0.25, 0.5, 0.25])
    total = np.zeros((len(at), flat.shape[1]), np.float32 if flat.dtype.itemsize < 4 else np.float64)
    mass = np.zeros((len(at), 1), total.dtype)
    height, width = index.shape
    y, x = np.divmod(at, np.int32(width))
    shown = index.ravel()
    light: list[npt.NDArray[np.float32]] = []
    if lift is not None:
        light = [np.broadcast_to(lift.gain, lift.offset.shape).ravel(), lift.offset.ravel()]
    for dy in range(-smooth, smooth + 1):
        for dx in range(-smooth, smooth + 1):
            ny, nx = y + dy, x + dx
            on = np.ones(len(at), bool)
            for line, limit, wraps in ((ny, height, wrap[0]), (nx, width, wrap[1])):
                if wraps:
                    line %= limit
                else:
                    on &= (line >= 0) & (line < limit)
                    np.clip(line, 0, limit - 1, out=line)
            place = ny * np.int32(width) + nx
            found = shown.take(place)
            here = np.clip(found - (dy * stride + dx), 0, len(flat) - 1)
            on &= (found >= 0) & usable.take(here)
            weight = (on * (kernel[dy + smooth] * kernel[dx + smooth])).astype(total.dtype)[:, np.newaxis]
            values = flat.take(here, axis=0)
            if light:
                gain, offset = (one.take(place)[:, np.newaxis] for one in light)
                values = gain * values + offset
            total += weight * values
            mass += weight
    total /= mass
    return total
