"""Upright lines of photographs say which way is down."""

import math

import numpy as np
import pytest

from toposeam.layers import mesh
from toposeam.layers.canvas import similarity
from toposeam.layers.registration import View, camera_transforms
from toposeam.layers.registration.bundle_adjustment import Bundle
from toposeam.layers.registration.perspective import level_down, rays_at

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


def down_of(pictures, bundle, guess):
    lines = list(map(mesh.lines_of, pictures))
    return mesh.down_of(lines, lambda *at: rays_at(bundle, *at), np.array([0.0, 0, 1]), guess)


def camera():
    """Return the bundle of one camera, in whose frame the scene leans."""
    return Bundle(
        family="rotation",
        sizes=np.array([SIZE, SIZE], float),
        matrices=np.stack([np.diag([1 / FOCAL, 1 / FOCAL, 1])] * 2),
        focals=np.full(2, FOCAL),
        distortion=0.0,
        middle=0,
    )


@pytest.mark.parametrize(("roll", "pitch"), [(0, 0), (3, 0), (-2, 4), (1, -4)])
def test_columns_of_a_facade_say_which_way_is_down(roll, pitch):
    lean = turned(roll, pitch)
    down = down_of([facade(lean)] * 2, camera(), GUESS)
    assert math.degrees(math.acos(min(1.0, down @ (lean.T @ GUESS)))) < 0.4


def test_what_leans_much_or_has_no_lines_says_nothing():
    assert down_of([facade(turned(25, 0))] * 2, camera(), GUESS) is None
    noise = np.random.default_rng(0).integers(0, 255, SIZE[::-1], np.uint8)
    assert down_of([noise] * 2, camera(), GUESS) is None
    assert down_of([np.full(SIZE[::-1], 90, np.uint8)] * 2, camera(), GUESS) is None


def test_columns_stand_upright_on_a_flat_canvas():
    bundle, lean = camera(), turned(3, -4)
    down = down_of([facade(lean)] * 2, bundle, level_down(bundle))
    for view, leans in ((View(down=down, projection="flat"), False), (View(projection="flat"), True)):
        (transform, _), _ = camera_transforms(bundle, view)
        scene = np.array([[math.sin(yaw), y, math.cos(yaw)] for yaw in (-0.3, 0.3) for y in (-0.2, 0.2)])
        seen = scene @ lean
        pixels = seen[:, :2] / seen[:, 2:] * FOCAL + (np.array(SIZE) - 1) / 2
        x = transform.to_canvas(pixels)[:, 0].reshape(2, 2)
        assert (np.abs(x[:, 1] - x[:, 0]).max() > 3) == leans


def test_upright_lines_may_not_cost_much_of_a_rectangle():
    sizes = np.array([[200, 150], [200, 150]])
    level = [similarity((0, 0)), similarity((150, 0))]
    turned = [similarity((0, 0), 3.0), similarity((150, 8), 3.0)]
    assert mesh.costs_too_much(sizes, turned, level, 3.0)
    assert not mesh.costs_too_much(sizes, level, turned, 3.0)
    assert not mesh.costs_too_much(sizes, level, level, 0.5)
