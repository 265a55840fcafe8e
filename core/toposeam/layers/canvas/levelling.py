"""Turn a canvas so that a line of one of its pictures lies level, or upright."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from toposeam.arrays import Floats
from toposeam.checks import check_numbers, check_whole, kind_error
from toposeam.errors import OptionError
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
