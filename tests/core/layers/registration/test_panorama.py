"""From adjusted pictures to a canvas: what is level, what lies in the middle, and which projection."""

import math

import numpy as np
import pytest
from rendered import before_a_wall, grid, turn

from toposeam.layers.canvas import NOWHERE, PlaneTransform, reach
from toposeam.layers.registration import View, camera_transforms, plane_transforms
from toposeam.layers.registration.bundle_adjustment import Bundle

SIZE = (360, 240)
MIDDLE = (np.array(SIZE) - 1) / 2
FOCAL = 400.0
#: Some frame in which the cameras of a set may have been adjusted.
FRAMES = [np.eye(3), turn(70, 25, -15), turn(-160, -40, 80)]


def cameras(turns, frame=None, focal=FOCAL, middle=None, **more):
    """A bundle of cameras turned as :func:`turn` has it, seen in some other frame."""
    rotations = np.array([(np.eye(3) if frame is None else frame) @ turn(*angles) for angles in turns])
    return Bundle(
        family="rotation",
        sizes=np.tile(np.array(SIZE, float), (len(turns), 1)),
        matrices=rotations / np.array([focal, focal, 1.0]),
        focals=np.full(len(turns), focal),
        distortion=more.get("distortion", 0.0),
        middle=len(turns) // 2 if middle is None else middle,
    )


def plane(transforms, middle=0, sizes=None):
    """A bundle of homographies to some plane, that of the picture in the middle."""
    sizes = np.array(sizes or [SIZE] * len(transforms), float)
    matrices = []
    for size, transform in zip(sizes, transforms, strict=True):
        centre = np.eye(3)
        centre[:2, 2] = (size - 1) / 2
        matrices.append(np.linalg.inv(transforms[middle].matrix) @ transform.matrix @ centre)
    back = np.eye(3)
    back[:2, 2] = -(sizes[middle] - 1) / 2
    matrices = [back @ matrix for matrix in matrices]
    return Bundle(
        family="plane",
        sizes=sizes,
        matrices=np.array([matrix / matrix[2, 2] for matrix in matrices]),
        focals=np.ones(len(sizes)),
        distortion=0.0,
        middle=middle,
    )


def middles(transforms):
    return np.array([transform.to_canvas(MIDDLE) for transform in transforms])


def rolls(transforms):
    """By how much pictures lie turned in their middle, degrees clockwise."""
    to_right = [
        transform.to_canvas(MIDDLE + np.array([1, 0])) - transform.to_canvas(MIDDLE)
        for transform in transforms
    ]
    return np.degrees([math.atan2(y, x) for x, y in to_right])


@pytest.mark.parametrize("frame", FRAMES)
def test_rows_come_to_lie_level(frame):
    turns = [(yaw, 0, 0) for yaw in range(-60, 61, 20)]
    transforms, wrap = camera_transforms(cameras(turns, frame), View())
    assert wrap is None
    assert middles(transforms)[:, 1] == pytest.approx(np.zeros(7), abs=1e-6)
    assert middles(transforms)[:, 0] == pytest.approx(FOCAL * np.radians(range(-60, 61, 20)), abs=3)
    assert rolls(transforms) == pytest.approx(np.zeros(7), abs=1e-6)


@pytest.mark.parametrize(
    ("projection", "edge"),
    [
        ("flat", FOCAL * math.tan(math.radians(30))),
        ("cylinder", FOCAL * math.radians(30)),
        ("sphere", FOCAL * math.radians(30)),
        ("panini", 2 * FOCAL * math.tan(math.radians(15))),
    ],
)
def test_pictures_reach_as_far_as_the_field_of_view(projection, edge):
    turns = [(yaw, 0, 0) for yaw in range(-60, 61, 20)]
    transforms, _ = camera_transforms(cameras(turns), View(projection=projection, fov=60))
    shown = [reach(transform, SIZE) for transform in transforms]
    assert [one is None for one in shown] == [True, False, False, False, False, False, True]
    assert min(low[0] for low, _ in shown[1:-1]) == -math.floor(edge)
    assert max(high[0] for _, high in shown[1:-1]) == math.floor(edge)
    for transform, (low, high) in zip(transforms[1:-1], shown[1:-1], strict=True):
        points = transform.to_canvas(grid(SIZE, 200)).reshape(-1, 2)
        points = points[np.abs(points[:, 0]) <= math.floor(edge)]
        assert (points.min(axis=0) >= low - 1e-6).all()
        assert (points.max(axis=0) <= high + 1e-6).all()
        # It may be a little larger: some 1/64 of the picture.
        assert (np.abs([points.min(axis=0) - low, points.max(axis=0) - high]) < 12).all()


def test_the_field_of_view_decides_on_projection_and_whole_turn():
    turns = [(yaw, 0, 0) for yaw in range(0, 360, 30)]
    narrow, wrap = camera_transforms(cameras(turns), View(fov=90))
    assert (narrow[0].projection, wrap) == ("flat", None)
    wide, wrap = camera_transforms(cameras(turns), View(fov=200))
    assert (wide[0].projection, wrap) == ("cylinder", None)
    whole, wrap = camera_transforms(cameras(turns), View(fov=360))
    assert wrap == pytest.approx(2 * math.pi * FOCAL, abs=1)
    assert whole[0].fov is None


def test_rows_that_look_up_are_level_too():
    """Each picture is held level but looks at roofs: their middles lie on a circle of latitude."""
    turns = [(yaw, -15, 0) for yaw in range(-60, 61, 20)]
    transforms, _ = camera_transforms(cameras(turns, FRAMES[1]), View(projection="sphere"))
    assert middles(transforms)[:, 1] == pytest.approx(np.full(7, -FOCAL * math.radians(15)), abs=1)
    assert rolls(transforms) == pytest.approx(np.zeros(7), abs=0.1)


def test_an_unsteady_hand_is_level_in_the_mean():
    rng = np.random.default_rng(0)
    turns = [(yaw, *rng.normal(0, 2, 2)) for yaw in range(-75, 76, 15)]
    transforms, _ = camera_transforms(cameras(turns, FRAMES[2]), View())
    # In the mean over as many pictures and over 75° to each side.
    assert abs(np.mean(rolls(transforms))) < 1
    slope = np.polyfit(*middles(transforms).T, 1)[0]
    assert abs(math.degrees(slope)) < 2.5


@pytest.mark.parametrize("frame", FRAMES)
def test_a_column_of_pictures_stays_upright(frame):
    """Its turns tell nothing of the horizon: the horizontal axes of all its pictures are the same."""
    turns = [(0, pitch, 0) for pitch in (-40, -20, 0, 15)]
    transforms, _ = camera_transforms(cameras(turns, frame, middle=2), View())
    found = middles(transforms)
    assert found[:, 0] == pytest.approx(np.zeros(4), abs=0.5)
    assert (np.diff(found[:, 1]) > 100).all()
    assert rolls(transforms) == pytest.approx(np.zeros(4), abs=0.5)


def test_what_is_not_levelled_lies_as_the_middle_picture():
    turns = [(-70, 0, 8), (0, 10, 8), (70, 0, 8)]
    level, _ = camera_transforms(cameras(turns), View(projection="sphere"))
    free, _ = camera_transforms(cameras(turns), View(projection="sphere", level=False))
    assert rolls(free)[1] == pytest.approx(0, abs=0.1)
    assert middles(free)[1, 1] == pytest.approx(0, abs=1e-6)
    assert abs(rolls(level)[1]) > 2


def test_cameras_that_look_straight_down_are_not_levelled():
    turns = [(0, 90, 0), (0, 90, 20), (0, 90, -20)]
    transforms, _ = camera_transforms(cameras(turns, middle=0), View())
    assert middles(transforms) == pytest.approx(np.zeros((3, 2)), abs=1)
    assert rolls(transforms) == pytest.approx([0, 20, -20], abs=0.5)


@pytest.mark.parametrize(
    ("yaws", "pitch", "projection"),
    [
        ((0,), 0, "flat"),
        ((-20, 0, 20), 0, "flat"),  # 88° across
        ((-25, 0, 25), 0, "cylinder"),  # 98°
        (range(-80, 81, 20), 0, "cylinder"),
        (range(0, 360, 30), 0, "cylinder"),
        ((-25, 0, 25), 38, "flat"),  # up to 55° down, but no farther off the middle than a flat corner
        ((-50, -25, 0, 25, 50), 38, "sphere"),
        (range(0, 360, 30), -40, "sphere"),
    ],
)
def test_the_field_of_view_chooses_the_projection(yaws, pitch, projection):
    transforms, _ = camera_transforms(cameras([(yaw, pitch, 0) for yaw in yaws]), View())
    assert {transform.projection for transform in transforms} == {projection}


@pytest.mark.parametrize("projection", ["flat", "cylinder", "sphere", "panini"])
def test_a_projection_that_is_asked_for_is_taken(projection):
    transforms, wrap = camera_transforms(cameras([(-15, 0, 0), (15, 0, 0)]), View(projection=projection))
    assert {transform.projection for transform in transforms} == {projection}
    assert wrap is None
    assert [transform.radius for transform in transforms] == [FOCAL, FOCAL]


@pytest.mark.parametrize("projection", ["flat", "cylinder", "sphere", "panini"])
def test_a_whole_turn_goes_round_cylinders_and_spheres(projection):
    turns = [(yaw, 0, 0) for yaw in range(0, 360, 30)]
    transforms, wrap = camera_transforms(cameras(turns, focal=401.3), View(projection=projection))
    if projection in ("flat", "panini"):
        assert wrap is None
        assert transforms[0].radius == 401.3
    else:
        assert wrap == round(2 * math.pi * 401.3)
        assert 2 * math.pi * transforms[0].radius == pytest.approx(wrap, abs=1e-9)
        assert sorted(middles(transforms)[:, 0] % wrap) == pytest.approx(np.arange(12) * wrap / 12, abs=1e-6)


def test_a_turn_with_a_gap_does_not_go_round():
    turns = [(yaw, 0, 0) for yaw in range(0, 301, 30)]  # 12° of 360 are not seen
    transforms, wrap = camera_transforms(cameras(turns, FRAMES[1]), View())
    assert wrap is None
    # The gap lies at both ends of the canvas.
    across = middles(transforms)[:, 0]
    assert (np.diff(across) > 0).all()
    assert across[0] == pytest.approx(-across[-1], abs=3)


def test_the_middle_of_all_lies_in_the_middle():
    turns = [(yaw, 0, 0) for yaw in (10, 30, 50, 70)]
    transforms, _ = camera_transforms(cameras(turns), View(projection="cylinder"))
    assert middles(transforms)[:, 0] == pytest.approx(FOCAL * np.radians([-30, -10, 10, 30]), abs=2)


@pytest.mark.parametrize("projection", ["flat", "cylinder", "sphere"])
@pytest.mark.parametrize("number", [0, 2])
def test_a_picture_can_be_asked_into_the_middle(number, projection):
    turns = [(yaw, 6, 0) for yaw in (-25, 0, 25)]
    view = View(projection=projection, centre=number)
    transforms, _ = camera_transforms(cameras(turns), view)
    found = middles(transforms)[number]
    assert found[0] == pytest.approx(0, abs=1e-6)
    down = {"flat": 0, "cylinder": math.tan(math.radians(6)), "sphere": math.radians(6)}[projection]
    assert found[1] == pytest.approx(FOCAL * down, abs=1)


def test_a_whole_turn_can_be_begun_anywhere():
    turns = [(yaw, 0, 0) for yaw in range(0, 360, 30)]
    for number in (3, 11):
        transforms, _ = camera_transforms(cameras(turns), View(centre=number))
        assert middles(transforms)[number] == pytest.approx([0, 0], abs=1e-6)


def test_a_flat_canvas_looks_at_the_middle_of_what_is_seen():
    turns = [(yaw, -25, 0) for yaw in (-15, 15)]
    transforms, _ = camera_transforms(cameras(turns), View())
    assert transforms[0].projection == "flat"
    there = np.concatenate([transform.to_canvas(grid(SIZE)).reshape(-1, 2) for transform in transforms])
    low, high = there.min(axis=0), there.max(axis=0)
    assert low[0] == pytest.approx(-high[0], abs=2)
    assert abs(low[1] + high[1]) < 0.2 * (high[1] - low[1])


def test_the_lens_reaches_the_transforms():
    transforms, _ = camera_transforms(cameras([(-15, 0, 0), (15, 0, 0)], distortion=-0.02), View())
    assert {transform.lens for transform in transforms} == {(0.0, -0.02, 0.0)}
    assert {transform.size for transform in transforms} == {SIZE}


def test_two_pictures_of_a_plane_share_the_perspective():
    """Neither is laid flat at the other's expense."""
    views = before_a_wall(FOCAL, [(-80, 0, 1.0, 10, 0, 0), (80, 0, 1.0, -10, 0, 0)], SIZE)
    for middle in (0, 1):
        left, right = plane_transforms(plane(views, middle))
        corners = np.array([[0, 0], [SIZE[0] - 1, 0], [SIZE[0] - 1, SIZE[1] - 1], [0, SIZE[1] - 1]], float)
        one, other = left.to_canvas(corners), right.to_canvas(corners[[1, 0, 3, 2]])
        centre = (left.to_canvas(MIDDLE) + right.to_canvas(MIDDLE)) / 2
        assert (one - centre) == pytest.approx((other - centre) * [-1, 1], abs=0.5)
        assert left.matrix[2, 0] * right.matrix[2, 0] < 0


def test_homographies_stay_what_they_are_to_each_other():
    views = before_a_wall(
        FOCAL, [(0, 0, 1, 5, 3, 1), (150, 20, 1.1, -6, 2, 0), (90, 120, 0.9, 2, -8, 2)], SIZE
    )
    found = plane_transforms(plane(views, 1))
    points = grid(SIZE, 5)
    for i in range(3):
        exact = views[i].to_picture(views[0].to_canvas(points))
        seen = (exact != NOWHERE).all(axis=-1)
        assert found[i].to_picture(found[0].to_canvas(points))[seen] == pytest.approx(exact[seen], abs=1e-4)


def test_in_the_mean_pictures_are_neither_turned_nor_scaled():
    views = before_a_wall(
        FOCAL, [(0, 0, 1, 9, 3, 4), (150, 20, 1.1, -6, 2, 10), (90, 120, 0.9, 2, -8, 6)], SIZE
    )
    step = np.eye(2)
    moved = [
        [transform.to_canvas(MIDDLE + move) - transform.to_canvas(MIDDLE) for move in step]
        for transform in plane_transforms(plane(views, 2))
    ]
    assert np.mean(moved, axis=0) == pytest.approx(np.eye(2), abs=2e-3)


def test_similarities_come_out_moved_and_turned_only():
    angle, places = math.radians(4), [(0, 0), (210, -15), (120, 130)]
    linear = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    given = [PlaneTransform(np.block([[linear, np.array([[x], [y]])], [0, 0, 1]])) for x, y in places]
    for middle in range(3):
        found = plane_transforms(plane(given, middle))
        shifts = np.array([transform.matrix[:2, 2] for transform in found])
        for transform in found:
            assert transform.matrix[:2, :2] == pytest.approx(np.eye(2), abs=1e-9)
            assert transform.matrix[2] == pytest.approx([0, 0, 1], abs=1e-12)
        expected = (np.array(places) - places[0]) @ linear
        assert shifts - shifts[0] == pytest.approx(expected, abs=1e-6)


def test_a_corner_beyond_the_horizon_hides_no_picture():
    """The first pixel of a picture lies behind the plane's viewer, but not its middle."""
    steep = PlaneTransform(np.array([[1.0, 0, 150], [0, 1, 0], [0, 0, 1]]))
    beyond = np.array([[1.0, 0, 0], [0, 1.0, 0], [6e-3, 0, 1.0]]) @ steep.matrix
    beyond = beyond @ np.array([[1.0, 0, -MIDDLE[0]], [0, 1, -MIDDLE[1]], [0, 0, 1]])
    beyond[2, 2] = 0.8 + beyond[2, 2] - beyond[2] @ [*MIDDLE, 1]
    assert beyond[2, 2] < 0 < beyond[2] @ [*MIDDLE, 1]
    bundle = plane([PlaneTransform(np.eye(3)), PlaneTransform(beyond / beyond[2, 2])])
    for transform in plane_transforms(bundle):
        assert np.isfinite(transform.to_canvas(MIDDLE)).all()


def test_a_camera_tells_a_plane_which_way_is_up():
    """What lies far away is a plane to a camera that turns: it is seen as that camera shows it."""
    turns = [(-18, 0, 4), (4, 2, 4.5), (21, -1, 3)]
    camera = cameras(turns, frame=turn(0, 0, 12))
    seen = camera.matrices @ np.array([np.eye(3)] * 3)
    middle = np.linalg.inv(seen[1])
    flat = Bundle(
        family="plane",
        sizes=camera.sizes,
        matrices=middle @ seen,
        focals=np.ones(3),
        distortion=0.0,
        middle=1,
    )
    wanted, _ = camera_transforms(camera, View(projection="flat"))
    points = grid(SIZE)
    for own, other in zip(plane_transforms(flat, camera, View()), wanted, strict=True):
        np.testing.assert_allclose(own.to_canvas(points), other.to_canvas(points), atol=1e-6)
    assert np.abs(rolls(plane_transforms(flat, camera, View()))).mean() < 2
    # A camera that sees much of it behind its back is not asked.
    wide = cameras([(-70, 0, 0), (0, 0, 0), (70, 0, 0)])
    for own, other in zip(plane_transforms(flat, wide), plane_transforms(flat), strict=True):
        np.testing.assert_array_equal(own.matrix, other.matrix)
