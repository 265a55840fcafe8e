"""Directions of cameras as yaw, pitch and roll."""

from __future__ import annotations

import math

import numpy as np

from toposeam.arrays import Floats


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
