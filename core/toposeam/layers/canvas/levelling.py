"""Turn a canvas so that a line of one of its pictures lies level or upright, or text and edges do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from toposeam.arrays import Floats, Image
from toposeam.checks import check_numbers, check_whole, kind_error
from toposeam.errors import OptionError
from toposeam.images import as_planes, full_scale
from toposeam.layers.canvas.transforms import (
    CameraTransform,
    MeshTransform,
    PlaneTransform,
    Transform,
    similarity,
    unbent,
)

#: Steps of a fixed point, and the largest angle, rad, that it may leave: a canvas bends lines.
_STEPS, _LEVEL = 20, 1e-4
#: Longer side, px, of the reduced pictures whose edges are looked at; the least gradient of an edge, of full
#: scale per px; edges of a picture at most.
_SIDE, _EDGE, _MOST_EDGES = 1000, 0.04, 60_000
#: Width of the rim of a picture whose edges count less, as a share of its shorter side.
_RIM = 0.15
#: Degrees: the farthest turn that is looked for, and the steps in which it is, first and then; the blur of
#: what is found then, steps.
_FARTHEST, _COARSE, _FINE, _SMOOTH = 15.0, 0.25, 0.02, 4.0
#: How much more uneven profiles must be across the best direction than they are in the median.
_CLEARLY = 4.0


def as_horizon(value: Any, count: int) -> tuple[int, Floats]:
    """Return the number of one of `count` pictures, and the (2, 2) ends of a line of it, px.

    Raises
    ------
    OptionError
        For anything else.
    """
    wanted = "the number of a picture, and two points x, y of it"
    try:
        number, line = value
    except (TypeError, ValueError) as error:
        raise kind_error("horizon", value, wanted) from error
    ends = check_numbers("horizon", line)
    if ends.shape != (2, 2) or not (np.abs(ends) < 1e9).all():
        raise kind_error("horizon", value, wanted)
    return check_whole("horizon", number, 0, count - 1), ends


def levelled(transforms: Sequence[Transform], picture: int, line: Floats) -> tuple[Transform, ...]:
    """Turn a canvas about the middle of a line, until its ends are level, or upright if they were nearer to
    that.

    Cameras turn about the direction of that middle, which stays where it is. Homographies turn on the canvas.

    Parameters
    ----------
    transforms : sequence of Transform
        All of them homographies, or all of them cameras of one canvas; meshes may displace them.
    picture : int
        The number of the picture that has the line.
    line : (2, 2) float array
        Its ends, x and y, px from the middle of the picture's upper left pixel.

    Returns
    -------
    tuple of Transform

    Raises
    ------
    OptionError
        If the canvas does not show the ends, if they are less than a px apart there, or if cameras and
        homographies are mixed.

    Examples
    --------
    >>> (turned,) = levelled([similarity((0, 0))], 0, np.array([[0.0, 0.0], [100.0, 10.0]]))
    >>> turned.to_canvas(np.array([[0.0, 0.0], [100.0, 10.0]])).round(1).tolist()
    [[-0.2, 5.0], [100.2, 5.0]]
    """
    ends = np.asarray(transforms[picture].to_canvas(line))
    if not np.isfinite(ends).all() or math.dist(*ends) < 1:
        raise OptionError(
            "horizon is {line}, whose ends the canvas does not show apart; take two points of the picture "
            "that lie farther apart",
            kind="value",
            line=np.round(line, 1).tolist(),
        )
    cameras = [one for one in map(unbent, transforms) if isinstance(one, CameraTransform)]
    planes = [one for one in map(unbent, transforms) if isinstance(one, PlaneTransform)]
    turn = _to_quarter(ends)
    if len(cameras) == len(transforms):
        own, forward = cameras[picture], cameras[picture].rays_at(ends).sum(axis=0)
        for _ in range(_STEPS):
            turns = _turned_about(forward / np.linalg.norm(forward), turn)
            left = _to_quarter(replace(own, rotation=turns @ own.rotation).to_canvas(line))
            if not abs(left) > _LEVEL:
                break
            turn += left
        else:
            raise OptionError(
                "horizon lies straight above or below the camera, where nothing is level; take another line",
                kind="value",
            )
        bases: list[Transform] = [replace(one, rotation=turns @ one.rotation) for one in cameras]
    elif len(planes) == len(transforms):
        middle = ends.mean(axis=0)
        there = similarity((0, 0), math.degrees(turn)).matrix
        there[:2, 2] = middle - there[:2, :2] @ middle
        bases = [PlaneTransform(there @ one.matrix) for one in planes]
    else:
        raise OptionError(
            "some pictures have cameras and others homographies, which no horizon turns together; leave it "
            "out",
            kind="conflict",
        )
    cosine, sine = math.cos(turn), math.sin(turn)
    on_canvas = np.array([[cosine, sine], [-sine, cosine]])
    return tuple(
        replace(one, base=base, coefficients=one.coefficients @ on_canvas)
        if isinstance(one, MeshTransform)
        else base
        for one, base in zip(transforms, bases, strict=True)
    )


def straightening(pictures: Sequence[Image], transforms: Sequence[Transform]) -> tuple[int, Floats] | None:
    """Find a line that :func:`levelled` has to lay level for text and edges to lie level and upright.

    Edges of pictures are counted by their distance along a direction and across it. Where these profiles are
    most uneven, lines of text, rules and edges of paper lie along it (after Postl 1986, US patent 4723297).

    Parameters
    ----------
    pictures : sequence of (H, W) or (H, W, C) arrays
    transforms : sequence of Transform
        From their pixels to the canvas.

    Returns
    -------
    (int, (2, 2) float array) or None
        The number of a picture, and two points x, y of it; None where no direction within 15° stands out.

    Examples
    --------
    >>> page = np.full((240, 320), 255, np.uint8)
    >>> for line in range(20, 220, 20):
    ...     page[line : line + 6, 30:290:2] = 0
    >>> turned = similarity((0, 0), 4.0)
    >>> number, line = straightening([page], [turned])
    >>> (straight,) = levelled([turned], number, line)
    >>> bool(abs(straight.matrix[1, 0]) < 0.002)
    True
    """
    edges, scale = [np.zeros((0, 3))], 1.0
    for picture, transform in zip(pictures, transforms, strict=True):
        step = max(1, -(-max(picture.shape[:2]) // _SIDE))
        scale = max(scale, step)
        own = _edges(np.asarray(picture[::step, ::step]))
        edges.append(np.column_stack([transform.to_canvas(step * own[:, :2]), own[:, 2]]))
    found = np.concatenate(edges)
    found = found[np.isfinite(found).all(axis=1)]
    if not len(found):
        return None
    at, weight = found[:, :2], found[:, 2]
    middle = at.mean(axis=0)
    at = (at - middle) / scale

    def unevenness(degrees: float) -> float:
        cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        return max(
            _unevenness(one - one.min(), weight) for one in (at @ [cosine, sine], at @ [-sine, cosine])
        )

    angles = np.arange(-_FARTHEST, _FARTHEST + _COARSE / 2, _COARSE)
    coarse = np.array([unevenness(angle) for angle in angles])
    best = float(angles[int(np.argmax(coarse))])
    if not coarse.max() > _CLEARLY * np.median(coarse) or abs(best) >= _FARTHEST:
        return None
    angles = best + np.arange(-_COARSE, _COARSE + _FINE / 2, _FINE)
    fine = scipy.ndimage.gaussian_filter1d([unevenness(angle) for angle in angles], _SMOOTH)
    best = float(angles[int(np.argmax(fine))])
    along = np.array([math.cos(math.radians(best)), math.sin(math.radians(best))])
    for number, transform in enumerate(transforms):
        line = transform.to_picture(middle + scale * np.outer([-100, 100], along))
        if np.isfinite(line).all():
            return number, np.asarray(line)
    return None


def _unevenness(places: Floats, weight: Floats) -> float:
    """Return the sum of squares of the steps of a profile: of the weights of places, px.

    Each is shared between the two nearest pixels; the profile is blurred, as pixels would stand out at 0°.
    """
    low = places.astype(np.intp)
    share = places - low
    profile = np.bincount(low, (1 - share) * weight, low.max() + 2)
    profile += np.bincount(low + 1, share * weight, low.max() + 2)
    return float(np.square(np.diff(scipy.ndimage.gaussian_filter1d(profile, 1.0))).sum())


def _edges(picture: Image) -> Floats:
    """(N, 3) x, y and weight of the pixels of a picture that lie on edges, evenly chosen if they are many.

    Weights fall to 0 at the picture's frame, which would stand out itself.
    """
    gray = as_planes(picture, data_range=full_scale(picture.dtype)).mean(axis=0, dtype=np.float32)
    down, right = np.gradient(gray)
    y, x = np.nonzero(np.hypot(down, right) > _EDGE)
    every = max(1, -(-len(x) // _MOST_EDGES))
    at = np.stack([x[::every], y[::every]], axis=1).astype(float)
    sides = np.array(gray.shape[::-1])
    inward = np.minimum(at + 0.5, sides - 0.5 - at) / (_RIM * sides.min())
    return np.column_stack([at, np.clip(inward, 0, 1).prod(axis=1)])


def _turned_about(axis: Floats, angle: float) -> Floats:
    """Return the (3, 3) turn by an angle, rad clockwise, about a unit ray (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)


def _to_quarter(ends: Floats) -> float:
    """Return the smallest turn, rad, that brings (2, 2) ends of a line level or upright."""
    across, down = ends[1] - ends[0]
    angle, quarter = math.atan2(down, across), math.pi / 2
    return float(np.round(angle / quarter) * quarter - angle)
