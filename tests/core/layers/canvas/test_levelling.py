"""A canvas is turned until a line of a picture lies level or upright."""

import math

import numpy as np
import pytest

import toposeam as ts
from toposeam.layers.canvas import (
    CameraTransform,
    MeshTransform,
    PlaneTransform,
    levelled,
    similarity,
    straightening,
    turned_camera,
)

LINE = np.array([[60.0, 40.0], [220.0, 70.0]])


def camera(projection, *angles):
    return CameraTransform(
        size=(301, 201), rotation=turned_camera(*angles), focal=400.0, projection=projection, radius=400.0
    )


def slope(transform, line):
    across, down = np.diff(transform.to_canvas(line), axis=0)[0]
    return math.degrees(math.atan2(down, across))


@pytest.mark.parametrize("projection", ["flat", "cylinder", "sphere", "panini"])
def test_a_line_lies_level_in_the_middle_of_every_projection(projection):
    cameras = [camera(projection, -20, 0, 3), camera(projection, 10, 4, 5)]
    turned = levelled(cameras, 1, LINE)
    assert abs(slope(cameras[1], LINE)) > 5
    assert abs(slope(turned[1], LINE)) < 0.06
    between = cameras[0].rotation.T @ cameras[1].rotation
    np.testing.assert_allclose(turned[0].rotation.T @ turned[1].rotation, between, atol=1e-12)


def test_the_direction_of_its_middle_stays():
    (turned,) = levelled([camera("sphere", 30, 10, 8)], 0, LINE)
    rays = camera("sphere", 30, 10, 8).rays_at(camera("sphere", 30, 10, 8).to_canvas(LINE))
    again = turned.rays_at(turned.to_canvas(LINE))
    np.testing.assert_allclose(again.sum(axis=0), rays.sum(axis=0), atol=1e-9)


@pytest.mark.parametrize(("degrees", "wanted"), [(10, 0), (44, 0), (46, 90), (85, 90), (-30, 0), (-80, -90)])
def test_what_is_nearer_to_upright_becomes_upright(degrees, wanted):
    way = np.array([math.cos(math.radians(degrees)), math.sin(math.radians(degrees))])
    line = np.array([[50.0, 60.0], [50.0, 60.0] + 100 * way])
    planes = [similarity((0, 0)), PlaneTransform(np.array([[1.1, 0.1, 9], [0, 1, 4], [1e-4, 0, 1]]))]
    turned = levelled(planes, 0, line)
    assert slope(turned[0], line) == pytest.approx(wanted, abs=1e-9)
    np.testing.assert_allclose(turned[0].to_canvas(line.mean(axis=0)), line.mean(axis=0), atol=1e-9)
    between = np.linalg.inv(planes[0].matrix) @ planes[1].matrix
    np.testing.assert_allclose(np.linalg.inv(turned[0].matrix) @ turned[1].matrix, between, atol=1e-12)


def test_a_mesh_bends_the_same_pixels():
    shifts = np.random.default_rng(0).normal(0, 2, (9, 12, 2))
    bent = MeshTransform(similarity((5, 7)), (301, 201), 32.0, shifts)
    turned = levelled([bent], 0, LINE)[0]
    points = np.random.default_rng(1).uniform(0, 200, (20, 2))
    before, after = bent.to_canvas(points), turned.to_canvas(points)
    distances = [np.linalg.norm(each[1:] - each[:-1], axis=1) for each in (before, after)]
    np.testing.assert_allclose(*distances, atol=1e-9)
    assert abs(slope(turned, LINE)) < 1e-9


@pytest.mark.parametrize(
    ("transforms", "line"),
    [
        ([similarity((0, 0))], [[1, 1], [1, 1]]),
        ([camera("flat", 0, 0, 0)], [[1, 1], [1e8, 1e8]]),
        ([camera("sphere", 0, 90, 0)], [[100, 95], [200, 160]]),
        ([similarity((0, 0)), camera("flat", 0, 0, 0)], LINE),
    ],
)
def test_what_cannot_be_level_is_a_sentence(transforms, line):
    with pytest.raises(ts.OptionError, match="; "):
        levelled(transforms, 0, np.array(line, float))


def page():
    """(420, 560) uint8: lines of letters, and a rule."""
    rng = np.random.default_rng(0)
    white = np.full((420, 560), 245, np.uint8)
    for top in range(40, 380, 18):
        letters = rng.random((8, 480)) < 0.4
        white[top : top + 8, 40:520][letters] = 30
    return white


@pytest.mark.parametrize("degrees", [-9.0, -1.3, 0.4, 3.0])
def test_text_lies_level(degrees):
    transforms = [similarity((0, 0), degrees), similarity((20, 300), degrees)]
    found = straightening([page(), page()], transforms)
    assert found is not None
    turned = levelled(transforms, *found)
    assert [np.degrees(np.arctan2(*one.matrix[[1, 0], 0])) for one in turned] == pytest.approx(
        [0, 0], abs=0.1
    )


def test_upside_down_stays_and_what_has_no_direction_is_left():
    upside = straightening([page()], [similarity((0, 0), 177.0)])
    assert upside is not None
    (turned,) = levelled([similarity((0, 0), 177.0)], *upside)
    assert np.degrees(np.arctan2(*turned.matrix[[1, 0], 0])) % 360 == pytest.approx(180, abs=0.1)
    noise = np.random.default_rng(1).integers(0, 256, (200, 300), np.uint8)
    assert straightening([noise], [similarity((0, 0))]) is None
    assert straightening([np.full((50, 60), 9, np.uint8)], [similarity((0, 0))]) is None
