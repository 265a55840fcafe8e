"""Upright lines of photographs say which way is down."""

import math

import numpy as np
import pytest

from toposeam.layers import mesh

FOCAL, SIZE = 400.0, (480, 360)
GUESS = np.array([0.0, 1.0, 0.0])


def turned(roll, pitch):
    """Return the turn of a camera that leans by angles, degrees."""
    roll, pitch = math.radians(roll), math.radians(pitch)
    about_z = [[math.cos(roll), -math.sin(roll), 0], [math.sin(roll), math.cos(roll), 0], [0, 0, 1]]
    about_x = [
        [1, 0, 0],
        [0, math.cos(pitch), math.sin(pitch)],
        [0, -math.sin(pitch), math.cos(pitch)],
    ]
    return np.array(about_x) @ about_z


def facade(lean):
    """Draw columns that stand upright in a scene, as a camera that leans sees them."""
    width, height = SIZE
    x, y = np.meshgrid(np.arange(width) - (width - 1) / 2, np.arange(height) - (height - 1) / 2)
    rays = np.stack([x, y, np.full(x.shape, FOCAL)], axis=-1) @ lean.T
    return ((np.floor(np.degrees(np.arctan2(rays[..., 0], rays[..., 2])) / 4) % 2) * 120 + 60).astype(
        np.uint8
    )


def down_of(pictures):
    def rays_of(number, points):
        middle = (np.array(SIZE) - 1) / 2
        return np.append((points - middle) / FOCAL, np.ones((len(points), 1)), axis=1)

    return mesh.down_of(pictures, rays_of, np.array([0.0, 0, 1]), GUESS)


@pytest.mark.parametrize(("roll", "pitch"), [(0, 0), (3, 0), (-2, 4), (1, -4)])
def test_columns_of_a_facade_say_which_way_is_down(roll, pitch):
    lean = turned(roll, pitch)
    down = down_of([facade(lean)] * 2)
    assert math.degrees(math.acos(min(1.0, down @ (lean.T @ GUESS)))) < 0.4


def test_what_leans_much_or_has_no_lines_says_nothing():
    assert down_of([facade(turned(25, 0))] * 2) is None
    noise = np.random.default_rng(0).integers(0, 255, SIZE[::-1], np.uint8)
    assert down_of([noise] * 2) is None
    assert down_of([np.full(SIZE[::-1], 90, np.uint8)] * 2) is None
