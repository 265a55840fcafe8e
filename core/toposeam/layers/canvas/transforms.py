"""Map the pixels of a picture to the canvas and back.

A plane transform is a homography. A camera looks at a sphere round it: a turn, a focal length and a radial
distortion say which ray each pixel sees, and a projection where that ray meets the canvas.

Pixels are counted from the centre of the upper left one, x to the right and y down; rays are unit vectors
(right, down, forward). Radial distortion is Hugin's: with r the distance from the picture's centre ÷ half
of its smaller side, a ray that would meet the picture at r meets it at r (a r³ + b r² + c r + 1 − a − b − c).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Protocol

import numpy as np
import scipy

from toposeam.arrays import Floats
from toposeam.typing import PROJECTIONS as PROJECTIONS
from toposeam.typing import Projection as Projection

#: Largest enlargement of a picture; where a transform enlarges it more, the picture is cut off.
LARGEST_ENLARGEMENT = 3.0
#: Coordinates of canvas pixels that a picture does not show.
NOWHERE = -1e6
#: Steps of Newton's method at most, to undo a distortion.
_NEWTON_STEPS = 8
#: Steps of a fixed point at most, to invert a mesh.
_FIXED_POINT_STEPS = 30


class Transform(Protocol):
    """A map from the pixels of a picture to the canvas and back."""

    def to_canvas(self, points: Floats) -> Floats:
        """Map (..., 2) points of the picture; NaN where the canvas does not show them."""

    def to_picture(self, points: Floats) -> Floats:
        """Map (..., 2) points of the canvas; `NOWHERE` where the picture does not show them."""


@dataclass(frozen=True, slots=True, eq=False)
class PlaneTransform:
    """A homography.

    Examples
    --------
    >>> move = PlaneTransform(np.array([[1, 0, 5], [0, 1, -2], [0, 0, 1.0]]))
    >>> move.to_canvas(np.array([[1.0, 1.0]])).tolist()
    [[6.0, -1.0]]
    """

    #: (3, 3): from the picture to the canvas, in homogeneous coordinates.
    matrix: Floats

    def to_canvas(self, points: Floats) -> Floats:
        """Map (..., 2) points of the picture; NaN where the canvas does not show them."""
        x, y, w = _homogeneous(self.matrix, points)
        # The area of the picture grows by det / w³.
        w = np.where(w > self._least_denominator, w, np.nan)
        return np.stack([x / w, y / w], axis=-1)

    def to_picture(self, points: Floats) -> Floats:
        """Map (..., 2) points of the canvas; `NOWHERE` where the picture does not show them."""
        x, y, w = _homogeneous(np.asarray(np.linalg.inv(self.matrix), float), points)
        shown = (w > 0) & (w * self._least_denominator < 1)
        w = np.where(shown, w, 1.0)
        return np.where(shown[..., np.newaxis], np.stack([x / w, y / w], axis=-1), NOWHERE)

    @property
    def _least_denominator(self) -> float:
        if not self.matrix[2, :2].any():
            return 0.0  # the same everywhere
        return float(np.cbrt(abs(np.linalg.det(self.matrix)) / LARGEST_ENLARGEMENT**2))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CameraTransform:
    """A picture that a camera took, and the projection of the canvas.

    Examples
    --------
    >>> camera = CameraTransform(
    ...     size=(301, 201), rotation=np.eye(3), focal=400.0, projection="sphere", radius=400.0
    ... )
    >>> camera.to_canvas(np.array([[150.0, 100.0]])).tolist()
    [[0.0, 0.0]]
    """

    #: Width and height of the picture, px.
    size: tuple[int, int]
    #: (3, 3), from rays of the camera's frame to rays of the canvas's.
    rotation: Floats
    #: Focal length, px.
    focal: float
    projection: Projection
    #: px per radian in the middle of the canvas.
    radius: float
    #: a, b, c of the radial distortion, and the shift of the optical axis from the picture's centre, px.
    lens: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shift: tuple[float, float] = (0.0, 0.0)
    #: Degrees across that the canvas shows, half of them to either side of its middle; None for all. Points
    #: beyond are mapped like all others.
    fov: float | None = None
    _yaw: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        forward = self.rotation[:, 2]
        object.__setattr__(self, "_yaw", math.atan2(forward[0], forward[2]))

    def to_canvas(self, points: Floats) -> Floats:
        """Map (..., 2) points of the picture; NaN where the canvas does not show them."""
        ideal = undistorted(points, self.size, self.lens, self.shift) / self.focal
        rays = np.concatenate([ideal, np.ones((*ideal.shape[:-1], 1))], axis=-1)
        rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        return self._project(np.asarray(rays @ self.rotation.T))

    @property
    def edge(self) -> float:
        """The reach of the canvas to either side of its middle, px."""
        half = math.inf if self.fov is None else math.radians(self.fov) / 2
        if self.projection == "flat":
            return self.radius * math.tan(half) if half < math.pi / 2 else math.inf
        if self.projection == "panini":
            return 2 * self.radius * math.tan(half / 2) if half < math.pi else math.inf
        return self.radius * half

    def to_picture(self, points: Floats) -> Floats:
        """Map (..., 2) points of the canvas; `NOWHERE` where the picture does not show them."""
        rays = self.rays_at(points) @ self.rotation
        shown = rays[..., 2:] > 1e-3
        ideal = np.where(shown, rays[..., :2] / np.where(shown, rays[..., 2:], 1.0), 0.0) * self.focal
        at = distorted(ideal, self.size, self.lens, self.shift)
        return np.where(shown & np.isfinite(at), at, NOWHERE)

    def _project(self, rays: Floats) -> Floats:
        """Map (..., 3) rays to the canvas."""
        x, y, z = (rays[..., axis] for axis in range(3))
        if self.projection == "flat":
            # At an angle θ off the middle a length grows by 1 / cos² θ along the radius.
            seen = np.where(z > 1 / math.sqrt(LARGEST_ENLARGEMENT), z, np.nan)
            return np.asarray(self.radius * np.stack([x / seen, y / seen], axis=-1))
        yaw = self._yaw + wrapped(np.arctan2(x, z) - self._yaw)
        flat = np.hypot(x, z)
        if self.projection == "sphere":
            return np.asarray(self.radius * np.stack([yaw, np.arctan2(y, flat)], axis=-1))
        flat = np.where(flat > 1 / LARGEST_ENLARGEMENT, flat, np.nan)
        yaw = np.where(np.isfinite(flat), yaw, np.nan)
        if self.projection == "cylinder":
            return np.asarray(self.radius * np.stack([yaw, y / flat], axis=-1))
        half = np.where(np.abs(yaw) < 0.9 * math.pi, yaw / 2, np.nan)
        down = (y / flat) / np.cos(half) ** 2
        return np.asarray(self.radius * np.stack([2 * np.tan(half), down], axis=-1))

    def rays_at(self, points: Floats) -> Floats:
        """Map (..., 2) points of the canvas to rays of its frame."""
        across, down = points[..., 0] / self.radius, points[..., 1] / self.radius
        if self.projection == "flat":
            rays = np.stack([across, down, np.ones_like(across)], axis=-1)
        elif self.projection == "sphere":
            level = np.cos(down)
            rays = np.stack([np.sin(across) * level, np.sin(down), np.cos(across) * level], axis=-1)
        else:
            if self.projection == "panini":
                half = np.arctan(across / 2)
                across, down = 2 * half, down * np.cos(half) ** 2
            rays = np.stack([np.sin(across), down, np.cos(across)], axis=-1)
        return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def distorted(
    ideal: Floats,
    size: tuple[int, int],
    lens: tuple[float, float, float],
    shift: tuple[float, float] = (0.0, 0.0),
) -> Floats:
    """Distort points on the plane of a picture, px from the optical axis, as the lens does.

    Parameters
    ----------
    ideal : (..., 2) float array
    size : (int, int)
        Width and height of the picture, px.
    lens : (float, float, float)
        a, b and c.
    shift : (float, float)
        Of the optical axis from the picture's centre, px.

    Returns
    -------
    (..., 2) float array
        x and y in the picture, px; NaN beyond the radius where the distortion turns back.
    """
    centre = (np.array(size) - 1) / 2 + np.array(shift)
    if not any(lens):
        return np.asarray(ideal + centre)
    half = min(size) / 2
    radius = np.linalg.norm(ideal, axis=-1, keepdims=True) / half
    factor = np.where(radius < _turning_radius(lens), _factor(radius, lens), np.nan)
    return np.asarray(ideal * factor + centre)


def undistorted(
    points: Floats,
    size: tuple[int, int] | Floats,
    lens: tuple[float, float, float],
    shift: tuple[float, float] = (0.0, 0.0),
) -> Floats:
    """Invert :func:`distorted` by Newton's method.

    Parameters
    ----------
    points : (..., 2) float array
        x and y in the picture, px.
    size : (int, int) or (..., 2) float array
        Width and height of the picture, px, or of each point's own picture.
    lens : (float, float, float)
        a, b and c.
    shift : (float, float)
        Of the optical axis from the picture's centre, px.

    Returns
    -------
    (..., 2) float array
        px from the optical axis.
    """
    sides = np.asarray(size, float)
    drawn = points - ((sides - 1) / 2 + np.array(shift))
    if not any(lens):
        return np.asarray(drawn)
    a, b, c = lens
    half, farthest = sides.min(axis=-1, keepdims=True) / 2, _turning_radius(lens)
    wanted = np.linalg.norm(drawn, axis=-1, keepdims=True) / half
    radius = np.minimum(wanted, 0.95 * farthest)
    for _ in range(_NEWTON_STEPS):
        slope = ((4 * a * radius + 3 * b) * radius + 2 * c) * radius + 1 - a - b - c
        before = radius
        radius = radius - (radius * _factor(radius, lens) - wanted) / np.maximum(slope, 0.05)
        radius = np.clip(radius, 0, 0.999 * farthest)
        if np.abs(radius - before).max(initial=0.0) < 1e-14:
            break
    return np.asarray(drawn * np.where(wanted > 0, radius / np.where(wanted > 0, wanted, 1), 1.0))


def _factor(radius: Floats, lens: tuple[float, float, float]) -> Floats:
    """Compute the distorted radius ÷ the radius."""
    a, b, c = lens
    return np.asarray(((a * radius + b) * radius + c) * radius + 1 - a - b - c)


@lru_cache(maxsize=64)
def _turning_radius(lens: tuple[float, float, float]) -> float:
    """Return the radius from which on the distorted radius no longer grows; at most 10."""
    a, b, c = lens
    roots = np.roots([4 * a, 3 * b, 2 * c, 1 - a - b - c])
    real = roots[np.abs(roots.imag) < 1e-9].real
    return float(min(real[real > 0], default=10.0))


def wrapped(angles: Floats) -> Floats:
    """Wrap angles to [−π, π)."""
    return np.asarray((angles + math.pi) % (2 * math.pi) - math.pi)


def _homogeneous(matrix: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
    """Map (..., 2) points by a (3, 3) homography: x, y and w."""
    x, y = points[..., 0], points[..., 1]
    across, down, w = (row[0] * x + row[1] * y + row[2] for row in matrix)
    return across, down, w


@dataclass(frozen=True, slots=True, eq=False)
class MeshTransform:
    """Another transform, and a smooth displacement on the canvas that varies over the picture.

    The displacement is a uniform cubic B-spline on square cells. It is inverted by a fixed point: where a
    point of the canvas, less the displacement of what it shows, lies by the other transform.

    Examples
    --------
    >>> bent = MeshTransform(similarity((10, 0)), (64, 32), 32.0, np.full((4, 5, 2), 1.5))
    >>> bent.to_canvas(np.array([[3.0, 4.0]])).tolist(), bent.to_picture(np.array([[14.5, 5.5]])).tolist()
    ([[14.5, 5.5]], [[3.0, 4.0]])
    """

    base: Transform
    #: Width and height of the picture, px.
    size: tuple[int, int]
    #: Side of a cell, px.
    cell: float
    #: (rows, columns, 2) coefficients of the displacement, px of the canvas; the middle one, or the middle
    #: between the middle ones, belongs to the middle of the picture.
    coefficients: Floats

    def at(self, points: Floats) -> Floats:
        """Return the column and the row of the coefficients, (..., 2), at points of the picture."""
        size, shape = np.array(self.size), np.array(self.coefficients.shape[1::-1])
        return np.asarray((np.clip(points, 0, size - 1.0) - (size - 1) / 2) / self.cell + (shape - 1) / 2)

    def shift(self, points: Floats) -> Floats:
        """Compute the displacement, px of the canvas, at (..., 2) points of the picture."""
        where = np.moveaxis(self.at(points)[..., ::-1], -1, 0)
        planes = np.moveaxis(self.coefficients, -1, 0)
        found = [scipy.ndimage.map_coordinates(one, where, order=3, prefilter=False) for one in planes]
        return np.stack(found, axis=-1)

    def to_canvas(self, points: Floats) -> Floats:
        """Map (..., 2) points of the picture; NaN where the canvas does not show them."""
        return np.asarray(self.base.to_canvas(points) + self.shift(points))

    def to_picture(self, points: Floats) -> Floats:
        """Map (..., 2) points of the canvas; `NOWHERE` where the picture does not show them."""
        found = self.base.to_picture(points)
        for _ in range(_FIXED_POINT_STEPS):
            before, found = found, self.base.to_picture(points - self.shift(found))
            if np.abs(found - before).max(initial=0.0) < 1e-3:
                break
        return found


@dataclass(frozen=True, slots=True, eq=False)
class FittedTransform:
    """Another transform onto a canvas whose boundary is bent (:mod:`toposeam.layers.boundary`).

    Examples
    --------
    >>> boundary = MeshTransform(similarity((0, 0)), (64, 32), 32.0, np.full((4, 5, 2), 1.5))
    >>> FittedTransform(similarity((10, 0)), boundary).to_canvas(np.array([[3.0, 4.0]])).tolist()
    [[14.5, 5.5]]
    """

    base: Transform
    #: From the canvas to the bent one.
    boundary: MeshTransform
    #: Width, px, of a round canvas, whose columns stay where they are; else None.
    wrap: int | None = None

    def to_canvas(self, points: Floats) -> Floats:
        """Map (..., 2) points of the picture; NaN where the canvas does not show them."""
        flat = self.base.to_canvas(points)
        known = np.isfinite(flat).all(axis=-1, keepdims=True)
        flat = np.where(known, flat, 0.0)
        turn = self._turn(flat)
        found = self.boundary.to_canvas(self.boundary.base.to_picture(flat - turn)) + turn
        return np.where(known, found, np.nan)

    def to_picture(self, points: Floats) -> Floats:
        """Map (..., 2) points of the canvas; `NOWHERE` where the picture does not show them."""
        turn = self._turn(points)
        flat = self.boundary.base.to_canvas(self.boundary.to_picture(points - turn)) + turn
        return self.base.to_picture(flat)

    def _turn(self, points: Floats) -> Floats:
        """Return what moves points into the first turn of a round canvas, with the other sign."""
        turn = np.zeros_like(points)
        if self.wrap is not None:
            left = self.boundary.base.to_canvas(np.zeros(2))[0]
            turn[..., 0] = np.floor((points[..., 0] - left) / self.wrap) * self.wrap
        return turn


def fitted_transforms(
    transforms: Sequence[Transform], boundary: MeshTransform | None, wrap: int | None
) -> tuple[Transform, ...]:
    """Return transforms onto a canvas whose boundary may be bent."""
    if boundary is None:
        return tuple(transforms)
    return tuple(FittedTransform(one, boundary, wrap) for one in transforms)


def unbent(transform: Transform) -> Transform:
    """Return the transform that meshes displace, or the transform itself."""
    while isinstance(transform, MeshTransform | FittedTransform):
        transform = transform.base
    return transform


@dataclass(frozen=True, slots=True)
class ReducedTransform:
    """A transform between a reduced picture and a reduced canvas, or another reduced picture.

    Examples
    --------
    >>> half = ReducedTransform(similarity((10, 20)), 2, 2)
    >>> half.to_canvas(np.array([[0.0, 0.0]])).tolist()
    [[5.0, 10.0]]
    """

    transform: Transform
    #: px of the canvas per px of its reduced copy, and of the picture per px of its own; of a picture perhaps
    #: across and down.
    canvas_scale: float
    picture_scale: float | tuple[float, float]

    def to_canvas(self, points: Floats) -> Floats:
        """Map (..., 2) points of the reduced picture."""
        return reduced_points(
            self.transform.to_canvas(enlarged(points, self.picture_scale)), self.canvas_scale
        )

    def to_picture(self, points: Floats) -> Floats:
        """Map (..., 2) points of the reduced canvas."""
        return reduced_points(
            self.transform.to_picture(enlarged(points, self.canvas_scale)), self.picture_scale
        )


def enlarged(points: Floats, scale: float | tuple[float, float]) -> Floats:
    """Return points of a picture that was reduced by a factor, perhaps across and down, as points of it."""
    return points if scale == 1 else (points + 0.5) * scale - 0.5


def reduced_points(points: Floats, scale: float | tuple[float, float]) -> Floats:
    """Invert :func:`enlarged`."""
    return points if scale == 1 else (points + 0.5) / scale - 0.5


def is_move(transform: Transform) -> bool:
    """Test whether a transform only moves."""
    if not isinstance(transform, PlaneTransform):
        return False
    matrix = transform.matrix
    return bool(np.array_equal(matrix[:2, :2], matrix[2, 2] * np.eye(2)) and not matrix[2, :2].any())


def similarity(at: tuple[float, float], turn: float = 0.0, scale: float = 1.0) -> PlaneTransform:
    """Return the transform that turns by degrees clockwise round the upper left pixel, scales, and moves by
    `at` px.
    """
    a, b = scale * math.cos(math.radians(turn)), scale * math.sin(math.radians(turn))
    if turn == 0 and scale == 1:
        a, b = 1.0, 0.0
    return PlaneTransform(np.array([[a, -b, at[0]], [b, a, at[1]], [0.0, 0.0, 1.0]]))


def turned_camera(yaw: float, pitch: float, roll: float) -> Floats:
    """Return the (3, 3) rotation of a camera turned by degrees to the right, then up, then clockwise."""
    (cy, cp, cr), (sy, sp, sr) = (
        [turned(math.radians(angle)) for angle in (yaw, pitch, roll)] for turned in (math.cos, math.sin)
    )
    turn = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    tilt = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
    spin = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])
    return np.asarray(turn @ tilt @ spin)


def angles_of(rotation: Floats) -> tuple[float, float, float]:
    """Invert :func:`turned_camera`; straight up or down, the roll is 0."""
    level = math.hypot(rotation[0, 2], rotation[2, 2])
    pitch = math.atan2(-rotation[1, 2], level)
    if level < 1e-9:
        yaw, roll = math.atan2(-rotation[2, 0], rotation[0, 0]), 0.0
    else:
        yaw = math.atan2(rotation[0, 2], rotation[2, 2])
        roll = math.atan2(rotation[1, 0], rotation[1, 1])
    return math.degrees(yaw), math.degrees(pitch), math.degrees(roll)


def as_similarity(transform: Transform) -> tuple[float, float, float, float] | None:
    """Return x, y, degrees clockwise and scale of what only turns, scales and moves; else None."""
    if not isinstance(transform, PlaneTransform):
        return None
    matrix = transform.matrix
    if matrix[2, :2].any() or matrix[0, 0] != matrix[1, 1] or matrix[0, 1] != -matrix[1, 0]:
        return None
    (a, b), (x, y) = matrix[:2, 0] / matrix[2, 2], matrix[:2, 2] / matrix[2, 2]
    return float(x), float(y), math.degrees(math.atan2(b, a)), math.hypot(a, b)


def settled(transform: Transform) -> Transform:
    """Round a transform so that its numbers in a text give it back exactly: by less than 1e-6 px, the
    displacements of a mesh by less than 1e-4 px.

    Examples
    --------
    >>> turned = settled(similarity((0.1, 0.2), 1 / 3))
    >>> np.array_equal(turned.matrix, settled(turned).matrix)
    True
    """
    if isinstance(transform, CameraTransform):
        angles = (round(angle, 10) + 0.0 for angle in angles_of(transform.rotation))
        return replace(transform, rotation=turned_camera(*angles))
    if isinstance(transform, MeshTransform):
        base = transform.base if isinstance(transform.base, PlaneTransform) else settled(transform.base)
        return replace(transform, base=base, coefficients=transform.coefficients.round(4) + 0.0)
    if isinstance(transform, FittedTransform):
        return replace(transform, base=settled(transform.base))
    found = None if is_move(transform) else as_similarity(transform)
    if found is None:
        return transform
    x, y, turn, scale = found
    return similarity((round(x, 6) + 0.0, round(y, 6) + 0.0), round(turn, 10) + 0.0, round(scale, 12))


def reach(transform: Transform, size: tuple[int, int]) -> tuple[Floats, Floats] | None:
    """Find the part of the canvas that a picture of that width and height fills.

    Returns
    -------
    (least, greatest) or None
        x and y, px, whole where the field of view ends; None where the canvas shows nothing of it.
    """
    width, height = size
    camera = unbent(transform)
    edge = camera.edge if isinstance(camera, CameraTransform) else math.inf
    x, y = np.linspace(0, width - 1, 65), np.linspace(0, height - 1, 65)
    points = transform.to_canvas(np.stack(np.meshgrid(x, y), axis=-1))
    finite = np.isfinite(points).all(axis=-1)
    within = finite & (np.abs(np.where(finite, points[..., 0], math.inf)) <= edge)
    # One more point all round, as the edge of the canvas lies between two.
    points = points[finite & scipy.ndimage.binary_dilation(within, np.ones((3, 3)))]
    if not len(points):
        return None
    limit = np.array([np.floor(edge), math.inf])
    return np.maximum(points.min(axis=0), -limit), np.minimum(points.max(axis=0), limit)
