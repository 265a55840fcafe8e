"""Transforms from the pixels of a picture to the canvas and back."""

import math

import numpy as np
import pytest
from rendered import grid, turn

from toposeam.layers.canvas import (
    NOWHERE,
    PROJECTIONS,
    CameraTransform,
    PlaneTransform,
    angles_of,
    as_similarity,
    distorted,
    is_move,
    reach,
    settled,
    similarity,
    turned_camera,
    undistorted,
)
from toposeam.layers.canvas.transforms import LARGEST_ENLARGEMENT

SIZE = (301, 201)
MIDDLE = np.array([150.0, 100.0])
LENSES = {
    "none": (0.0, 0.0, 0.0),
    "barrel": (0.0, -0.04, 0.0),
    "pincushion": (0.0, 0.05, 0.0),
    "all": (0.02, -0.05, 0.01),
}


def camera(projection="sphere", angles=(0, 0, 0), focal=260.0, radius=300.0, **more):
    return CameraTransform(
        size=SIZE, rotation=turn(*angles), focal=focal, projection=projection, radius=radius, **more
    )


def ray(yaw, pitch, focal=260.0):
    """Where a camera that looks straight ahead sees a direction, degrees to the right and down."""
    across, down = np.radians([yaw, pitch])
    return MIDDLE + focal * np.array([math.tan(across), math.tan(down) / math.cos(across)])


def tilted(x, y):
    return PlaneTransform(np.array([[1.1, 0.05, -20], [-0.04, 0.95, 12], [x, y, 1.0]]))


def areas(transform, points, step=1e-3):
    """How much a transform enlarges areas at points."""
    right, down = (
        (transform.to_canvas(points + move) - transform.to_canvas(points - move)) / (2 * step)
        for move in step * np.eye(2)
    )
    return right[..., 0] * down[..., 1] - right[..., 1] * down[..., 0]


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("projection", PROJECTIONS)
def test_what_a_camera_maps_comes_back(projection, lens):
    transform = camera(projection, (10, -8, 5), lens=LENSES[lens], shift=(4.0, -2.5))
    points = grid(SIZE)
    there = transform.to_canvas(points)
    assert np.isfinite(there).all()
    assert transform.to_picture(there) == pytest.approx(points, abs=1e-5)


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_what_the_canvas_maps_comes_back(projection):
    transform = camera(projection, (-14, 6, -3), lens=(0.0, -0.03, 0.0))
    points = transform.to_canvas(MIDDLE) + np.random.default_rng(0).uniform(-60, 60, (50, 2))
    assert transform.to_canvas(transform.to_picture(points)) == pytest.approx(points, abs=1e-5)


def test_what_a_homography_maps_comes_back():
    transform = tilted(4e-4, -6e-4)
    points = grid(SIZE)
    assert transform.to_picture(transform.to_canvas(points)) == pytest.approx(points, abs=1e-8)


@pytest.mark.parametrize("yaw", [-25.0, 0.0, 12.0, 28.0])
@pytest.mark.parametrize("pitch", [-18.0, 0.0, 15.0])
def test_directions_lie_where_each_projection_puts_them(yaw, pitch):
    across, down = np.radians([yaw, pitch])
    steep = math.tan(down)
    expected = {
        "flat": (math.tan(across), steep / math.cos(across)),
        "cylinder": (across, steep),
        "sphere": (across, down),
        "panini": (2 * math.tan(across / 2), steep / math.cos(across / 2) ** 2),
    }
    for projection, place in expected.items():
        there = camera(projection).to_canvas(ray(yaw, pitch))
        assert there == pytest.approx(300 * np.array(place), abs=1e-9), projection


def test_cameras_turn_to_the_right_down_and_clockwise():
    assert camera(angles=(30, 0, 0)).to_canvas(MIDDLE) == pytest.approx([300 * math.pi / 6, 0])
    assert camera(angles=(0, 20, 0)).to_canvas(MIDDLE) == pytest.approx([0, 300 * math.pi / 9])
    right = camera(angles=(0, 0, 10)).to_canvas(MIDDLE + np.array([20, 0]))
    assert right[1] > 0 < right[0]


def test_a_shift_moves_what_lies_in_the_middle():
    assert camera(shift=(7.0, -3.0)).to_canvas(MIDDLE + np.array([7, -3])) == pytest.approx([0, 0])


@pytest.mark.parametrize("projection", PROJECTIONS)
def test_what_lies_behind_a_camera_is_nowhere_in_it(projection):
    transform = camera(projection, (130, 0, 0))
    assert (transform.to_picture(np.array([[-40.0, 5.0], [0.0, 0.0]])) == NOWHERE).all()


def test_a_flat_canvas_shows_nothing_that_lies_behind():
    assert np.isnan(camera("flat", (180, 0, 0)).to_canvas(grid(SIZE))).all()
    assert np.isnan(camera("panini", (180, 0, 0)).to_canvas(MIDDLE)).all()
    assert np.isfinite(camera("panini", (150, 0, 0)).to_canvas(MIDDLE)).all()


def test_cylinders_do_not_show_the_poles_and_spheres_do():
    up = (0, -85, 0)
    assert np.isnan(camera("cylinder", up).to_canvas(MIDDLE)).all()
    assert camera("sphere", up).to_canvas(MIDDLE) == pytest.approx([0, -300 * math.radians(85)])


def test_flat_and_cylinder_end_where_they_enlarge_too_much():
    steepest = math.acos(1 / math.sqrt(LARGEST_ENLARGEMENT))
    highest = math.acos(1 / LARGEST_ENLARGEMENT)
    for projection, angle, move in (("flat", steepest, (1, 0)), ("cylinder", highest, (0, 1))):
        shown, hidden = (
            camera(projection, (*(math.degrees(angle) * off * np.array(move)), 0.0)).to_canvas(MIDDLE)
            for off in (0.99, 1.01)
        )
        assert np.isfinite(shown).all(), projection
        assert np.isnan(hidden).all(), projection


def test_homographies_end_where_they_enlarge_too_much():
    transform = tilted(-2.6e-3, -4e-4)
    points = grid(SIZE, 61)[1:-1, 1:-1]
    shown = np.isfinite(transform.to_canvas(points)).all(axis=-1)
    assert 0.2 < shown.mean() < 0.9
    grown = areas(PlaneTransform(transform.matrix), points[shown])
    assert np.nanmax(grown) < LARGEST_ENLARGEMENT**2 * 1.001
    assert np.nanmax(grown) > LARGEST_ENLARGEMENT**2 * 0.8
    w = points @ transform.matrix[2, :2] + 1
    assert ((w[~shown] <= 0) | (np.linalg.det(transform.matrix) / w[~shown] ** 3 > 9)).all()


def test_beyond_its_horizon_a_homography_shows_nothing():
    transform = tilted(-2.6e-3, -4e-4)
    inverse = np.linalg.inv(transform.matrix)
    points = grid((4001, 4001), 41) - 2000
    back = transform.to_picture(points)
    shown = (back != NOWHERE).all(axis=-1)
    assert 0 < shown.sum() < shown.size
    assert transform.to_canvas(back[shown]) == pytest.approx(points[shown], abs=1e-6)
    assert ((points @ inverse[2, :2] + inverse[2, 2])[shown] > 0).all()


def test_no_two_places_of_the_canvas_show_one_pixel():
    """Where a lens's distortion turns back it would."""
    transform = camera("flat", lens=(0.0, -0.3, 0.0))
    along = np.stack([np.linspace(0, 420, 200), np.zeros(200)], axis=1)
    back = transform.to_picture(along)
    shown = (back != NOWHERE).all(axis=1)
    assert shown[0]
    assert not shown[-1]
    assert (np.diff(back[shown][:, 0]) > 0).all()


def test_distortion_is_one_at_half_of_the_smaller_side():
    lens = LENSES["all"]
    at = np.array([[0.0, 100.5], [60.0, 0.0]])
    drawn = distorted(at, SIZE, lens) - MIDDLE
    assert drawn[0] == pytest.approx(at[0])
    r = 60 / 100.5
    assert drawn[1] == pytest.approx([60 * (0.02 * r**3 - 0.05 * r**2 + 0.01 * r + 1.02), 0])
    assert np.isnan(distorted(np.array([[130.0, 0.0]]), SIZE, (0.0, -0.3, 0.0))).all()


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_distortion_is_undone(lens):
    points = grid(SIZE)
    ideal = undistorted(points, SIZE, lens, (3.0, 1.0))
    assert distorted(ideal, SIZE, lens, (3.0, 1.0)) == pytest.approx(points, abs=1e-6)


def test_beyond_what_a_lens_draws_points_stay_finite():
    ideal = undistorted(grid(SIZE), SIZE, (0.0, -0.45, 0.0))
    assert np.isfinite(ideal).all()
    assert np.abs(ideal).max() < 200


@pytest.mark.parametrize("projection", ["cylinder", "sphere"])
@pytest.mark.parametrize("yaw", [179.0, -179.0, 180.0])
def test_a_camera_that_looks_back_is_not_torn(projection, yaw):
    transform = camera(projection, (yaw, 0, 0))
    there = transform.to_canvas(grid(SIZE, 61))
    assert np.abs(np.diff(there[..., 0], axis=1)).max() < 8
    low, high = reach(transform, SIZE)
    assert high[0] - low[0] < 400
    assert transform.to_picture(there) == pytest.approx(grid(SIZE, 61), abs=1e-6)
    way_round = np.array([2 * math.pi * 300, 0.0])
    assert transform.to_picture(there - way_round) == pytest.approx(grid(SIZE, 61), abs=1e-6)


def test_only_homographies_that_move_are_moves():
    move = np.array([[1, 0, 5.5], [0, 1, -2], [0, 0, 1.0]])
    assert is_move(PlaneTransform(move))
    assert is_move(PlaneTransform(3 * move))
    assert not is_move(camera())
    assert not is_move(tilted(0, 0))
    assert not is_move(similarity((5, 5), scale=1.001))
    move[2, 0] = 1e-6
    assert not is_move(PlaneTransform(move))


def test_similarities_turn_clockwise_scale_and_move():
    transform = similarity((40, -7), turn=30, scale=2)
    assert transform.to_canvas(np.zeros(2)) == pytest.approx([40, -7])
    right = transform.to_canvas(np.array([10.0, 0.0])) - [40, -7]
    assert right == pytest.approx([20 * math.cos(math.pi / 6), 10])
    assert is_move(similarity((1, 2)))


@pytest.mark.parametrize("scale", [0.02, 50.0])
def test_similarities_may_enlarge_as_much_as_they_like(scale):
    transform = similarity((3, 4), turn=200, scale=scale)
    points = grid(SIZE)
    assert transform.to_picture(transform.to_canvas(points)) == pytest.approx(points, abs=1e-8)


def test_reach_holds_all_that_is_shown():
    transform = camera("cylinder", (20, -10, 4))
    low, high = reach(transform, SIZE)
    there = transform.to_canvas(grid(SIZE, 201)).reshape(-1, 2)
    assert there.min(axis=0) == pytest.approx(low, abs=0.05)
    assert there.max(axis=0) == pytest.approx(high, abs=0.05)
    assert reach(camera("flat", (180, 0, 0)), SIZE) is None


@pytest.mark.parametrize("fov", [20.0, 21.37, 33.0])
def test_reach_has_whole_pixels_within_the_field_of_view(fov):
    low, high = reach(camera("cylinder", fov=fov), SIZE)
    edge = math.floor(300 * math.radians(fov) / 2)
    assert (low[0], high[0]) == (-edge, edge)


@pytest.mark.parametrize("angles", [(0, 0, 0), (-179.3, 12.5, 3), (370.1, -88, -170), (10, 90, 0)])
def test_angles_of_a_camera_give_its_turn(angles):
    rotation = turned_camera(*angles)
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
    assert turned_camera(*angles_of(rotation)) == pytest.approx(rotation, abs=1e-9)


def test_a_camera_turns_right_then_up_then_clockwise():
    forward, right = np.array([0.0, 0, 1]), np.array([1.0, 0, 0])
    assert turned_camera(90, 0, 0) @ forward == pytest.approx([1, 0, 0])
    assert turned_camera(0, 90, 0) @ forward == pytest.approx([0, -1, 0])
    assert turned_camera(0, 0, 90) @ right == pytest.approx([0, 1, 0])


def test_settled_transforms_are_those_of_their_rounded_numbers():
    """Settling again changes nothing, not a bit, and the first time hardly anything."""
    rng = np.random.default_rng(7)
    spots = grid(SIZE)
    for _ in range(200):
        found = similarity(tuple(rng.uniform(-900, 900, 2)), rng.uniform(-180, 180), rng.uniform(0.5, 2))
        once = settled(found)
        assert np.array_equal(settled(once).matrix, once.matrix)
        assert np.abs(once.to_canvas(spots) - found.to_canvas(spots)).max() < 1e-6
        x, y, turn, scale = as_similarity(once)
        rounded = similarity((round(x, 6), round(y, 6)), round(turn, 10), round(scale, 12))
        assert np.array_equal(rounded.matrix, once.matrix)
        angles = rng.uniform((-180, -89, -180), (180, 89, 180))
        seen = camera("sphere", tuple(angles))
        once = settled(seen)
        assert np.array_equal(settled(once).rotation, once.rotation)
        assert np.abs(once.rotation - seen.rotation).max() < 1e-11
        rounded = turned_camera(*(round(angle, 10) for angle in angles_of(once.rotation)))
        assert np.array_equal(rounded, once.rotation)


def test_homographies_are_settled_as_they_are():
    tilted = PlaneTransform(np.array([[1.1, 0.2, 3.3], [0.1, 0.9, -2], [1e-4, 0, 1 / 3]]))
    assert settled(tilted) is tilted
    assert as_similarity(tilted) is None
    assert as_similarity(camera("flat")) is None
    move = similarity((0.1 + 0.2, 7))
    assert settled(move) is move
