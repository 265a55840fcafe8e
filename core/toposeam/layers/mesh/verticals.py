"""Which way is down: the direction on which the upright lines of photographs agree.

A camera of known turn sees the points of a line in a plane through its centre, with the normal n; a line that
is upright in the scene has n · d = 0, for the direction d that points down. Straight edges that are nearly
upright vote for d, each with its length and a width of 0.7°; the direction with the most votes is adjusted to
those that agree with it by least squares.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from toposeam.arrays import Floats, Image
from toposeam.images import as_planes, full_scale
from toposeam.layers.mesh.lines import find_lines

#: Longer side, px, of the reduced pictures in which lines are looked for; the shortest line, its share.
_SIDE, _LEAST = 640, 0.06
#: Degrees: how far a line is off at most to be counted, how far the answer may lie from the first guess, the
#: width of a vote, and within how many a line agrees.
_NEAR, _FARTHEST, _WIDTH, _AGREES = 10.0, 6.0, 0.7, 1.5
#: Lines that must agree, at least: their number, and their length as a share of that of all that are counted.
_FEWEST, _SHARE = 8, 0.5
#: Pitch of a flat canvas, degrees, up to which upright lines stay parallel on it; farther, that would stretch
#: too much.
MOST_PITCH = 12.0
#: Deviation, degrees, of the first guess, as far as votes leave the answer open.
_PRIOR = 6.0


def down_of(
    pictures: Sequence[Image], rays_of: Callable[[int, Floats], Floats], forward: Floats, guess: Floats
) -> Floats | None:
    """Find the direction on which upright lines agree.

    Parameters
    ----------
    pictures : sequence of (H, W) or (H, W, C) arrays
    rays_of : callable
        From the number of a picture and (M, 2) points of it to (M, 3) rays that its camera sees there, all in
        one frame.
    forward, guess : (3,) float arrays
        The direction of one of the cameras, and the unit direction that points down as far as is known.

    Returns
    -------
    (3,) float array or None
        None where too few lines agree.
    """
    normals, lengths = _normals(pictures, rays_of)
    near = np.abs(normals @ guess) < math.sin(math.radians(_NEAR))
    normals, lengths = normals[near], lengths[near]
    if len(normals) < _FEWEST:
        return None
    right = np.cross(guess, forward)
    right /= np.linalg.norm(right)
    sides = np.stack([right, np.cross(guess, right)])
    steps = np.radians(np.arange(-_FARTHEST, _FARTHEST + 0.25, 0.5))
    tilts = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    tilts = tilts[np.hypot(*tilts.T) <= math.radians(_FARTHEST)]
    off = np.degrees(normals @ (guess + tilts @ sides).T)
    votes = lengths @ np.exp(-((off / _WIDTH) ** 2)) / lengths.sum()
    prior = np.exp(-((np.degrees(np.hypot(*tilts.T)) / _PRIOR) ** 2) / 2)
    tilt = tilts[int(np.argmax(votes * prior))]
    agree = np.zeros(len(normals), bool)
    for _ in range(3):
        agree = np.abs(np.degrees(normals @ (guess + tilt @ sides))) < _AGREES
        if agree.sum() < _FEWEST or lengths[agree].sum() < _SHARE * lengths.sum():
            return None
        weight = np.sqrt(lengths[agree] / lengths[agree].sum())[:, np.newaxis]
        loose = math.radians(_WIDTH) / math.radians(_PRIOR) * np.eye(2) / math.sqrt(_FEWEST)
        rows = np.concatenate([weight * (normals[agree] @ sides.T), loose])
        target = np.concatenate([-weight[:, 0] * (normals[agree] @ guess), np.zeros(2)])
        tilt = np.linalg.lstsq(rows, target, rcond=None)[0]
    down = guess + tilt @ sides
    if math.hypot(*tilt) > math.radians(_FARTHEST):
        return None
    return np.asarray(down / np.linalg.norm(down))


def _normals(pictures: Sequence[Image], rays_of: Callable[[int, Floats], Floats]) -> tuple[Floats, Floats]:
    """Return the (K, 3) normals of lines, and their lengths, rad."""
    normals, lengths = [np.zeros((0, 3))], [np.zeros(0)]
    for index, picture in enumerate(pictures):
        step = max(1, -(-max(picture.shape[:2]) // _SIDE))
        height, width = (side // step for side in picture.shape[:2])
        part = np.asarray(picture[: height * step : step, : width * step : step])
        gray = as_planes(part, data_range=full_scale(part.dtype)).mean(axis=0, dtype=np.float32)
        lines = step * find_lines(gray, _LEAST * max(height, width))
        if not len(lines):
            continue
        rays = rays_of(index, lines.reshape(-1, 2))
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        across = np.cross(rays[::2], rays[1::2])
        length = np.linalg.norm(across, axis=1)
        normals.append(across / np.maximum(length, 1e-12)[:, np.newaxis])
        lengths.append(length)
    return np.concatenate(normals), np.concatenate(lengths)
