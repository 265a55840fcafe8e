"""Straight edges of a picture, as segments.

Edge pixels, where the gradient is greatest along its own direction, that touch each other and have about
the same direction belong together; a piece as thin as a line is one. Directions count modulo 180°, so an
edge goes on where light and dark change sides, as on a chessboard. Pieces on one line are joined.
"""

from __future__ import annotations

import numpy as np
import scipy

from toposeam import _kernels
from toposeam.arrays import Floats, Floats32
from toposeam.images import blurred

#: Blur of the picture, px, and the least gradient of an edge, of full scale per px.
_BLUR, _LEAST_GRADIENT = 1.0, 0.015
#: Directions in which pieces are looked for; each piece's lie within the tolerance, degrees.
_DIRECTIONS, _TOLERANCE = 12, 12.0
#: Least length of a piece and largest standard deviation across it, px.
_LEAST_PIECE, _THICKNESS = 7.0, 0.55
#: Distance, px, and angle, degrees, of pieces on one line, with so many more ÷ its length; and the largest
#: gap: px, or a share of the length.
_ASIDE, _APART, _APART_SHORT, _GAP, _GAP_SHARE = 1.2, 2.0, 30.0, 8.0, 0.15
#: Pieces at most, the longest ones.
_MOST = 800


def find_lines(gray: Floats32, least: float) -> Floats:
    """Find straight edges.

    Parameters
    ----------
    gray : (H, W) float32 array
        Usually from 0 to 1.
    least : float
        Least length, px.

    Returns
    -------
    (K, 4) float array
        x and y of both ends, px, the longest first.
    """
    smooth = blurred(gray, _BLUR)[0]
    down, right = np.gradient(smooth)
    strength = np.hypot(right, down)
    y, x = np.nonzero(strength > _LEAST_GRADIENT)
    across = np.stack([down[y, x], right[y, x]]) / strength[y, x]
    own = strength[y, x]
    for sign in (-1, 1):
        beside = scipy.ndimage.map_coordinates(strength, np.stack([y, x]) + sign * across, order=1)
        kept = own >= beside
        y, x, own, across = y[kept], x[kept], own[kept], across[:, kept]
    angle = np.degrees(np.arctan2(across[0], across[1]))
    pieces = [
        _pieces(y[near], x[near], gray.shape)
        for direction in np.arange(_DIRECTIONS) * 180 / _DIRECTIONS
        for near in [np.abs((angle - direction + 90) % 180 - 90) < _TOLERANCE]
    ]
    found = np.concatenate(pieces)
    found = found[np.argsort(-_lengths(found), kind="stable")[:_MOST]]
    joined = _joined(found)
    joined = joined[_lengths(joined) >= least]
    return joined[np.argsort(-_lengths(joined), kind="stable")]


def _lengths(lines: Floats) -> Floats:
    return np.asarray(np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1]))


def _pieces(y: Floats, x: Floats, shape: tuple[int, ...]) -> Floats:
    """Fit segments to the connected pixels at y and x: (K, 4)."""
    edge = np.zeros(shape, bool)
    edge[y, x] = True
    number, count = scipy.ndimage.label(edge, np.ones((3, 3)))
    label = number[y, x]
    size = np.bincount(label, minlength=count + 1)
    kept = size[label] >= _LEAST_PIECE * 0.8
    _, label = np.unique(label[kept], return_inverse=True)
    points = np.stack([x[kept], y[kept]], axis=1).astype(float)
    if not len(points):
        return np.zeros((0, 4))
    size = np.bincount(label)
    middle = np.stack([np.bincount(label, one) / size for one in points.T], axis=1)
    off = points - middle[label]
    xx, xy, yy = (np.bincount(label, off[:, i] * off[:, j]) / size for i, j in ((0, 0), (0, 1), (1, 1)))
    turn = 0.5 * np.arctan2(2 * xy, xx - yy)
    along = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    thin = (xx + yy - np.hypot(xx - yy, 2 * xy)) / 2 < _THICKNESS**2
    far = (off * along[label]).sum(axis=1)
    low, high = np.zeros(len(size)), np.zeros(len(size))
    np.minimum.at(low, label, far)
    np.maximum.at(high, label, far)
    ends = np.concatenate([middle + low[:, None] * along, middle + high[:, None] * along], axis=1)
    return ends[thin & (high - low >= _LEAST_PIECE)]


def _joined(pieces: Floats) -> Floats:
    """Join pieces that lie on one line, from the longest on."""
    if _kernels.library is not None:
        pieces = np.ascontiguousarray(pieces)
        lines = np.empty_like(pieces)
        bounds = np.array([_ASIDE, np.radians(_APART), np.radians(_APART_SHORT), _GAP, _GAP_SHARE])
        count = _kernels.library.join_pieces(len(pieces), pieces, bounds, lines)
        if count >= 0:
            return lines[:count]
    free, found = np.ones(len(pieces), bool), []
    steps = pieces[:, 2:] - pieces[:, :2]
    steps = steps / np.maximum(_lengths(pieces), 1e-9)[:, None]
    while free.any():
        first = int(np.argmax(free))
        free[first] = False
        line = pieces[first]
        while True:
            step = line[2:] - line[:2]
            length = float(np.hypot(*step))
            step = step / length
            normal = np.array([-step[1], step[0]])
            start, end = pieces[:, :2] - line[:2], pieces[:, 2:] - line[:2]
            far = np.sort(np.stack([start @ step, end @ step]), axis=0)
            near = free & (np.maximum(np.abs(start @ normal), np.abs(end @ normal)) < _ASIDE)
            near &= np.abs(steps @ step) > np.cos(np.radians(_APART + _APART_SHORT / length))
            near &= np.maximum(far[0] - length, -far[1]) < max(_GAP, _GAP_SHARE * length)
            if not near.any():
                break
            free[near] = False
            low, high = min(0.0, float(far[0][near].min())), max(length, float(far[1][near].max()))
            points = np.concatenate([line.reshape(2, 2), pieces[near].reshape(-1, 2)])
            middle = points.mean(axis=0)
            (xx, xy), (_, yy) = (points - middle).T @ (points - middle)
            turn = 0.5 * np.arctan2(2 * xy, xx - yy)
            along = np.array([np.cos(turn), np.sin(turn)])
            along = along * np.sign(along @ step)
            offset = float((line[:2] - middle) @ along)
            line = np.concatenate([middle + (offset + low) * along, middle + (offset + high) * along])
        found.append(line)
    return np.array(found).reshape(-1, 4)
