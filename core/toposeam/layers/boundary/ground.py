"""What lies beside the border of a picture: what a pixel is worth, and how deep a fill beside it goes unseen.

Plain ground, as a clear sky, may be continued far; even texture, as gravel, less; structure not at all, nor
the end of a line that runs out of the picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats, Floats32, Mask
from toposeam.layers.boundary.reduced import Overview
from toposeam.layers.mesh.lines import find_lines

#: How deep a fill may go beside plain ground and beside even texture, as shares of the shorter side.
_PLAIN_DEPTH, _TEXTURE_DEPTH = 0.22, 0.08
#: Greatest mean gradient, per px, and spread of plain ground; of full scale.
_PLAIN_GRADIENT, _PLAIN_SPREAD = 0.01, 0.055
#: Gradients, per px, from which on a pixel counts as textured, and as wholly so.
_BUSY = 0.006, 0.022
#: Even texture: how far the means of a small and a large neighbourhood differ, in spreads and in full scale;
#: least ratio of the small one's spread; and greatest coherence of directions.
_MEANS, _SPREADS, _COHERENCE = (0.5, 0.016), 0.55, 0.6
#: Length of the shortest line, as a share of the longer side; reach of its end, as one of the shorter side.
_LINE, _END = 0.04, 0.03
#: Value of a pixel that shows where it is plain, and more by as much where it is textured.
_VALUE = 0.5
#: Price of a pixel that is filled, of one that a warp may reach, and of any other one that does not show.
_FILLED, _REACHED, HOLE = 0.9, 0.25, 12.0

_Value = TypeVar("_Value", bound=np.generic)


@dataclass(frozen=True, slots=True, eq=False)
class BorderGround:
    """What a picture is like near each pixel."""

    #: (H, W) share of full texture, in [0, 1].
    texture: Floats32
    #: (H, W) depth of a fill beside a pixel, px.
    depth: Floats32
    #: (K, 4) x and y of both ends of straight lines, px.
    lines: Floats


def ground_of(seen: Overview) -> BorderGround:
    """Tell plain ground and even texture from structure."""
    gray, cover = seen.gray, seen.cover
    short = min(gray.shape)
    inner = scipy.ndimage.binary_erosion(cover, iterations=2, border_value=1).astype(np.float32)
    near, far = max(4, short // 50), max(12, short // 14)
    shares = {radius: np.maximum(_mean(inner, radius), 1e-3) for radius in (near, far)}

    def mean(values: Floats32, radius: int) -> Floats32:
        return np.asarray(_mean(values * inner, radius) / shares[radius], np.float32)

    down, right = (scipy.ndimage.sobel(gray, axis) / 8 for axis in (0, 1))
    gradient = mean(np.hypot(down, right), near)
    xx, yy, xy = (mean(each, near) for each in (right * right, down * down, right * down))
    coherence = np.hypot(xx - yy, 2 * xy) / (xx + yy + 6e-5)
    means = [mean(gray, radius) for radius in (near, far)]
    spreads = [
        np.sqrt(np.maximum(mean(gray * gray, radius) - own * own, 0))
        for radius, own in zip((near, far), means, strict=True)
    ]
    plain = (gradient < _PLAIN_GRADIENT) & (spreads[0] < _PLAIN_SPREAD)
    even = np.abs(means[0] - means[1]) < _MEANS[0] * spreads[1] + _MEANS[1]
    even &= (spreads[0] > _SPREADS * spreads[1]) & (coherence < _COHERENCE)
    depth = np.where(plain, _PLAIN_DEPTH, np.where(even, _TEXTURE_DEPTH, 0)).astype(np.float32) * short
    lines = _lines(seen)
    depth[_line_ends(lines, cover)] = 0
    depth = scipy.ndimage.minimum_filter(depth, 2 * near + 1)
    texture = np.clip((gradient - _BUSY[0]) / (_BUSY[1] - _BUSY[0]), 0, 1)
    return BorderGround(texture.astype(np.float32), depth, lines)


def _lines(seen: Overview) -> Floats:
    """Find the straight lines that are no border, of all or of a picture."""
    lines = find_lines(seen.gray, _LINE * max(seen.gray.shape))
    lines = lines[~_at(seen.edges, (lines[:, :2] + lines[:, 2:]) / 2)]
    away = scipy.ndimage.distance_transform_edt(seen.cover)
    points = np.stack([lines[:, :2], (lines[:, :2] + lines[:, 2:]) / 2, lines[:, 2:]], axis=1)
    off = _at(away, points)
    return np.asarray(lines[(off.min(axis=1) > 0) & (off[:, 1] > 3)])


def _line_ends(lines: Floats, cover: Mask) -> Mask:
    """Mark where lines run out of the picture."""
    short, marked = min(cover.shape), np.zeros(cover.shape, bool)
    ends = lines.reshape(-1, 2)
    away = _at(scipy.ndimage.distance_transform_edt(cover), ends)
    reach = max(1, int(_END * short))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = np.stack([x, y], axis=-1)[np.hypot(x, y) <= reach]
    ends = ends[(away > 0) & (away < 0.8 * _END * short)]
    at = np.rint(ends)[:, None].astype(np.intp) + disc
    at = at[((at >= 0) & (at < np.array(cover.shape[::-1]))).all(axis=-1)]
    marked[at[:, 1], at[:, 0]] = True
    return marked


def prices_of(
    cover: Mask, ground: BorderGround, reach: float, thin: float = 1.5
) -> tuple[Floats32, Floats32]:
    """Return what it is worth to have each pixel in the picture: shown, and warped to or filled.

    Parameters
    ----------
    cover : (H, W) bool array
    ground : BorderGround
    reach : float
        How far a warp may move the border, px.
    thin : float
        Depth of a fill that goes unseen anywhere, px.

    Returns
    -------
    shown, hole : (H, W) float32 arrays
        The second one is negative.
    """
    far, nearest = scipy.ndimage.distance_transform_edt(~cover, return_indices=True)
    depth, texture = (each[tuple(nearest)] for each in (ground.depth, ground.texture))
    hole = np.where(far <= np.maximum(depth, thin), -_FILLED * (0.3 + 0.7 * texture), -HOLE)
    hole = np.where(far <= reach, np.maximum(hole, -_REACHED), hole)
    return (_VALUE * (1 + ground.texture)).astype(np.float32), hole.astype(np.float32)


def _mean(values: Floats32, radius: int) -> Floats32:
    return np.asarray(scipy.ndimage.uniform_filter(values, 2 * radius + 1, mode="constant"), np.float32)


def _at(values: npt.NDArray[_Value], points: Floats) -> npt.NDArray[_Value]:
    """Return the values at the pixels nearest to (..., 2) points."""
    most = np.array(values.shape[::-1]) - 1
    x, y = np.moveaxis(np.clip(np.rint(points).astype(np.intp), 0, most), -1, 0)
    return np.asarray(values[y, x])
