"""Which way is down: the direction on which the upright lines of photographs agree.

A camera of known turn sees the points of a line in a plane through its centre, with the normal n; a line that
is upright in the scene has n · d = 0, for the direction d that points down. Straight edges that are nearly
upright vote for d, each with its length and a width of 0.7°; the direction with the most votes is adjusted to
those that agree with it by least squares. A canvas that is turned so far that much less of it is a rectangle
stays as it was.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from toposeam.arrays import Floats, Image
from toposeam.images import as_planes, full_scale
from toposeam.layers.canvas.largest_rectangle import largest_full
from toposeam.layers.canvas.transforms import Transform
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
#: Share of what shows that a degree of leaning is worth, at most.
_WORTH = 0.012
#: Longer side, px, of the reduced canvas on which what is kept is measured; points along a picture's side.
_OUTLINES, _POINTS = 240, 24
#: Deviation, degrees, of the first guess, as far as votes leave the answer open.
_PRIOR = 6.0


def lines_of(picture: Image) -> Floats:
    """Find the straight edges of an (H, W) or (H, W, C) picture, on a reduced copy: (K, 4), x and y of both
    ends, px of the picture.
    """
    step = max(1, -(-max(picture.shape[:2]) // _SIDE))
    height, width = (side // step for side in picture.shape[:2])
    part = np.asarray(picture[: height * step : step, : width * step : step])
    gray = as_planes(part, data_range=full_scale(part.dtype)).mean(axis=0, dtype=np.float32)
    return np.asarray(step * find_lines(gray, _LEAST * max(height, width)))


def down_of(
    lines: Sequence[Floats], rays_of: Callable[[int, Floats], Floats], forward: Floats, guess: Floats
) -> Floats | None:
    """Find the direction on which upright lines agree.

    Parameters
    ----------
    lines : sequence of (K, 4) arrays
        Of each picture, by :func:`lines_of`.
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
    normals, lengths = _normals(lines, rays_of)
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


def costs_too_much(
    sizes: Floats, upright: Sequence[Transform], leaning: Sequence[Transform], degrees: float
) -> bool:
    """Test whether a rectangle of a canvas keeps so much less where it is turned upright that it should lean.

    Parameters
    ----------
    sizes : (N, 2) array
        Width and height of pictures, px.
    upright, leaning : sequence of Transform
        From them to either canvas.
    degrees : float
        By how much it would lean.
    """
    return _share_kept(sizes, leaning) - _share_kept(sizes, upright) > _WORTH * degrees


def _share_kept(sizes: Floats, transforms: Sequence[Transform]) -> float:
    """Return the share of what pictures fill of a canvas that the largest rectangle in it has."""
    from skimage.draw import polygon

    outlines = []
    along = np.linspace(0, 1, _POINTS)
    ring = np.stack(
        [[along, 0 * along], [0 * along + 1, along], [1 - along, 0 * along + 1], [0 * along, 1 - along]]
    )
    for size, transform in zip(sizes, transforms, strict=True):
        points = transform.to_canvas(ring.transpose(0, 2, 1).reshape(-1, 2) * (size - 1))
        outlines.append(points[np.isfinite(points).all(axis=1)])
    everything = np.concatenate(outlines)
    low, extent = everything.min(axis=0), np.ptp(everything, axis=0)
    scale = _OUTLINES / float(extent.max())
    shown = np.zeros((np.ceil(extent[::-1] * scale) + 1).astype(int), bool)
    for outline in outlines:
        x, y = ((outline - low) * scale).T
        shown[polygon(y, x, shown.shape)] = True  # type: ignore[no-untyped-call]
    box = largest_full(shown)
    return 0.0 if box is None else math.prod(box.shape) / int(shown.sum())


def _normals(lines: Sequence[Floats], rays_of: Callable[[int, Floats], Floats]) -> tuple[Floats, Floats]:
    """Return the (K, 3) normals of lines, and their lengths, rad."""
    normals, lengths = [np.zeros((0, 3))], [np.zeros(0)]
    for index, own in enumerate(lines):
        if not len(own):
            continue
        rays = rays_of(index, own.reshape(-1, 2))
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        across = np.cross(rays[::2], rays[1::2])
        length = np.linalg.norm(across, axis=1)
        normals.append(across / np.maximum(length, 1e-12)[:, np.newaxis])
        lengths.append(length)
    return np.concatenate(normals), np.concatenate(lengths)
