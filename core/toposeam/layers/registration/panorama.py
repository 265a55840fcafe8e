"""Lay adjusted pictures on a canvas: the horizon level, the middle in the middle, in a projection that suits
the field of view.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from toposeam.arrays import Floats
from toposeam.layers.canvas.transforms import CameraTransform, PlaneTransform, Projection, wrapped
from toposeam.layers.registration.bundle_adjustment import Bundle
from toposeam.layers.registration.homography import applied, least_squares_homography

#: Largest field of view of a flat canvas, degrees across and down, and of a cylinder, down.
_LARGEST_FLAT, _LARGEST_CYLINDER = (95.0, 80.0), 100.0
#: Weight of the mean of the cameras' own verticals beside the horizon that their turns share.
_VERTICAL_WEIGHT = 0.002
#: Share of the pictures' corners that a camera must see less than 55° off its middle to show a plane.
_LEAST_AHEAD = 0.8
#: Steps of a circle in which the directions that pictures show are counted.
_CIRCLE_STEPS = 1440


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """The view of a canvas on what a camera saw."""

    #: None for the one that suits the field of view.
    projection: Projection | None = None
    #: Whether the horizon is to be level.
    level: bool = True
    #: The picture that lies in the middle; by default the middle of all.
    centre: int | None = None
    #: Degrees across that it shows at most; None for all.
    fov: float | None = None


def plane_transforms(
    bundle: Bundle, camera: Bundle | None = None, view: View | None = None
) -> tuple[PlaneTransform, ...]:
    """Lay all pictures on one plane, in a perspective that suits all of them.

    Where a camera explains the pictures nearly as well, and sees most of them ahead, the plane is viewed as
    that camera shows it, with the horizon level. Otherwise the view is taken in which the scale differs least
    from place to place; on average it leaves the middles of the pictures unchanged.

    Parameters
    ----------
    bundle : Bundle
        Of a plane.
    camera : Bundle, optional
        A camera that explains the pictures nearly as well.
    view : View, optional
    """
    centres = np.tile(np.eye(3), (len(bundle.sizes), 1, 1))
    centres[:, :2, 2] = (bundle.sizes - 1) / 2
    frame = centres[bundle.middle] @ np.linalg.inv(bundle.matrices[bundle.middle])
    matrices = frame @ bundle.matrices @ np.linalg.inv(centres)
    side = float(bundle.sizes.max())
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0.5]])
    spots = np.concatenate([(bundle.sizes - 1)[:, np.newaxis] * corners, np.ones((len(centres), 5, 1))], 2)

    if camera is not None:
        cameras, _ = camera_transforms(camera, replace(view or View(), projection="flat"))
        wanted = np.concatenate([one.to_canvas(own[:, :2]) for one, own in zip(cameras, spots, strict=True)])
        plain = np.concatenate([applied(one, own[:, :2]) for one, own in zip(matrices, spots, strict=True)])
        ahead = np.isfinite(wanted).all(axis=1)
        if ahead.mean() > _LEAST_AHEAD:
            upright = least_squares_homography(wanted[ahead], plain[ahead]) @ matrices
            depths = np.einsum("kj,kj->k", upright[:, 2], spots[:, 4])
            if depths.min() > 0:
                return tuple(
                    PlaneTransform(matrix / depth) for matrix, depth in zip(upright, depths, strict=True)
                )

    def tilted(tilt: Floats) -> Floats:
        """View the plane with another line at infinity."""
        perspective = np.eye(3)
        perspective[2, :2] = tilt / side
        return np.asarray(perspective @ matrices)

    def unevenness(tilt: Floats) -> float:
        views = tilted(tilt)
        depths = np.einsum("kj,kpj->kp", views[:, 2], spots)
        if depths.min() <= 0:
            return math.inf
        return float(np.var(np.log(np.abs(np.linalg.det(views)))[:, np.newaxis] - 3 * np.log(depths)))

    start = np.zeros(2)
    if math.isfinite(unevenness(start)) and unevenness(start) > 1e-12:
        matrices = tilted(scipy.optimize.minimize(unevenness, start, method="Nelder-Mead").x)
    step = np.array([[0, 1, 0], [0, 0, 1], [0, 0, 0]])
    there = applied(matrices, np.swapaxes(spots[:, 4, :2, np.newaxis] + step[:2], 1, 2))
    mean = np.mean(np.swapaxes(there[:, 1:] - there[:, :1], 1, 2), axis=0)
    back = np.eye(3)
    back[:2, :2] = np.linalg.inv(mean)
    matrices = back @ matrices
    # Corners may lie beyond the horizon, the middle does not.
    return tuple(
        PlaneTransform(matrix / abs(matrix[2] @ middle))
        for matrix, middle in zip(matrices, spots[:, 4], strict=True)
    )


def camera_transforms(bundle: Bundle, view: View) -> tuple[tuple[CameraTransform, ...], int | None]:
    """Lay all pictures of a turning camera on a canvas.

    Parameters
    ----------
    bundle : Bundle
        Of a camera.
    view : View

    Returns
    -------
    transforms : tuple of CameraTransform
    width : int or None
        Of the canvas, px, where it goes all the way round.
    """
    turns = _upright(bundle, view)
    rays = [_rays(bundle, turns, index) for index in range(len(turns))]
    yaws, whole = _directions(rays)
    if view.centre is None and not whole:
        middle = (yaws[0] + yaws[1]) / 2
    else:
        forward = turns[bundle.middle if view.centre is None else view.centre][:, 2]
        middle = math.atan2(forward[0], forward[2])
    turns = _turn_down(middle) @ turns
    across = min(math.degrees(yaws[1] - yaws[0]), 360.0 if view.fov is None else view.fov)
    pitches = np.concatenate([np.arcsin(np.clip(ray[:, 1], -1, 1)) for ray in rays])
    low, high = float(pitches.min()), float(pitches.max())
    projection = view.projection or _suitable(across, math.degrees(high - low), math.degrees(max(-low, high)))
    if projection == "flat":
        turns = _pitched((low + high) / 2 if view.centre is None else _pitch(turns[view.centre])) @ turns
    round_way = whole and projection in ("cylinder", "sphere") and across >= 360
    width = round(2 * math.pi * bundle.focal) if round_way else None
    radius = bundle.focal if width is None else width / (2 * math.pi)
    return (
        tuple(
            CameraTransform(
                size=bundle.size(index),
                rotation=turn,
                focal=float(bundle.focals[index]),
                projection=projection,
                radius=radius,
                lens=bundle.lens,
                fov=None if view.fov is None or view.fov >= 360 else view.fov,
            )
            for index, turn in enumerate(turns)
        ),
        width,
    )


def _suitable(across: float, down: float, steepest: float) -> Projection:
    """Choose the projection that suits a field of view and its steepest direction, degrees."""
    if across <= _LARGEST_FLAT[0] and down <= _LARGEST_FLAT[1]:
        return "flat"
    return "cylinder" if 2 * steepest <= _LARGEST_CYLINDER else "sphere"


def _upright(bundle: Bundle, view: View) -> Floats:
    """Return the (N, 3, 3) turns of the cameras in a frame whose y axis points down.

    People turn a camera about the vertical and hold it level across: the horizontal axes of all pictures lie
    in the plane of the horizon (Brown and Lowe 2007, section 5). Where these determine no plane, as of a
    tower from its foot to its top, the pictures' own verticals do.
    """
    turns = bundle.rotations
    if not view.level:
        return np.asarray(turns[bundle.middle if view.centre is None else view.centre].T @ turns)
    across, own = turns[:, :, 0], turns[:, :, 1].mean(axis=0)
    own /= np.linalg.norm(own)
    spread = across.T @ across / len(across) - _VERTICAL_WEIGHT * np.outer(own, own)
    down = np.linalg.eigh(spread)[1][:, 0]
    down *= 1 if down @ own >= 0 else -1
    forward = turns[bundle.middle][:, 2]
    forward = forward - down * (down @ forward)
    if np.linalg.norm(forward) < 1e-3:  # straight up or down: nothing is level
        return np.asarray(turns[bundle.middle].T @ turns)
    forward /= np.linalg.norm(forward)
    return np.asarray(np.stack([np.cross(down, forward), down, forward]) @ turns)


def _rays(bundle: Bundle, turns: Floats, index: int) -> Floats:
    """Compute (M, 3) directions that a picture shows."""
    width, height = bundle.sizes[index]
    x, y = np.linspace(0, width - 1, 33), np.linspace(0, height - 1, 33)
    points = bundle.ideal(index, np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)) / bundle.focals[index]
    rays = np.append(points, np.ones((len(points), 1)), axis=1) @ turns[index].T
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _directions(rays: Sequence[Floats]) -> tuple[tuple[float, float], bool]:
    """Find the angles about the vertical, rad, between which pictures show something, and whether they go all
    the way round.
    """
    shown = np.zeros(_CIRCLE_STEPS, bool)
    for ray in rays:
        yaw = np.arctan2(ray[:, 0], ray[:, 2])
        centre = math.atan2(ray[:, 0].mean(), ray[:, 2].mean())
        angles = wrapped(yaw - centre)
        low, high = (
            (centre + angle) / (2 * math.pi) * _CIRCLE_STEPS for angle in (angles.min(), angles.max())
        )
        shown[np.arange(math.floor(low), math.ceil(high)) % _CIRCLE_STEPS] = True
    if shown.all():
        return (-math.pi, math.pi), True
    # The largest gap is behind.
    hidden = np.flatnonzero(~shown)
    runs = np.split(hidden, np.flatnonzero(np.diff(hidden) > 1) + 1)
    if len(runs) > 1 and runs[0][0] == 0 and runs[-1][-1] == _CIRCLE_STEPS - 1:
        runs = [np.concatenate([runs[-1] - _CIRCLE_STEPS, runs[0]]), *runs[1:-1]]
    gap = max(runs, key=len)
    first, last = gap[-1] + 1, gap[0] + _CIRCLE_STEPS
    low, high = (value / _CIRCLE_STEPS * 2 * math.pi for value in (first, last))
    return (low, high), False


def _turn_down(yaw: float) -> Floats:
    """Return the (3, 3) turn that brings a direction about the vertical, rad, to the front."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]])


def _pitched(pitch: float) -> Floats:
    """Return the (3, 3) turn that brings a direction below the horizon, rad, to the front."""
    cosine, sine = math.cos(pitch), math.sin(pitch)
    return np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])


def _pitch(turn: Floats) -> float:
    return math.asin(max(-1.0, min(1.0, float(turn[1, 2]))))
