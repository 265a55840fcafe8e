"""Pictures that are placed by points that somebody marked."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.layers.canvas import inside
from toposeam.layers.registration import matches_of

SIZES = [(120, 80), (120, 80), (60, 90)]
#: Of a picture that lies 70 px to the right of the other and 4 px higher.
MOVED = np.array([[75, 10], [110, 20], [90, 60], [112, 70]])
POINTS = np.hstack([MOVED, MOVED - np.array([70, -4])])


def dark(*more):
    """Pictures in which there is nothing to be found."""
    return [ts.Layer(np.full((80, 120), 90, np.uint8), name=name) for name in ("left", "right", *more)]


@pytest.mark.parametrize("points", [{(0, 1): POINTS}, {(1, 0): POINTS[:, [2, 3, 0, 1]].tolist()}])
def test_points_place_what_shows_nothing(points):
    found = ts.find_places(dark(), points=points)
    assert [layer.at for layer in found.layers] == [(0, 0), (70, -4)]
    assert found.residuals[0, 1].features == 200
    assert found.misfit < 0.01


def test_points_join_what_features_do_not():
    rng = np.random.default_rng(0)
    whole = rng.integers(0, 255, (120, 160), dtype=np.uint8).repeat(2, 0).repeat(2, 1)
    pictures = [ts.Layer(whole[:, left : left + 180].copy(), name=str(left)) for left in (0, 80)]
    pictures.append(dark()[0])
    own = np.array([[150, 40], [175, 60], [160, 75], [178, 45]])
    found = ts.find_places(pictures, points={(1, 2): np.hstack([own, own - np.array([140, 20])])})
    assert found.numbers == (0, 1, 2)
    assert [layer.at for layer in found.layers] == [(0, 0), (80, 0), (220, 20)]


def test_a_perspective_is_found_from_points():
    matrix = np.array([[1.0, 0.02, 60], [-0.03, 1.05, 5], [2e-4, 1e-4, 1]])
    grid = np.stack(np.meshgrid([5, 30, 50], [8, 40, 70]), axis=-1).reshape(-1, 2).astype(float)
    there = np.append(grid, np.ones((9, 1)), 1) @ matrix.T
    there = there[:, :2] / there[:, 2:]
    assert inside(there, SIZES[0]).all()
    found = ts.find_places(dark(), points={(0, 1): np.hstack([there, grid])}, model="plane")
    seen = [one.to_canvas(own) for one, own in zip(found.transforms, (there, grid), strict=True)]
    np.testing.assert_allclose(seen[0], seen[1], atol=0.01)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ({(0, 3): POINTS}, "points of (0, 3) are of no pair; name two different pictures"),
        ({(1, 1): POINTS}, "are of no pair"),
        ({0: POINTS}, "points of 0 are of no pair"),
        ({(0, 1): POINTS[:3]}, "have shape (3, 4); give (M, 4), x and y in both, with M at least 4"),
        ({(0, 1): POINTS[:, :3]}, "have shape (4, 3)"),
        ({(0, 1): POINTS + 60}, "a point of pictures 0 and 1 lies outside of them"),
        ({(0, 1): np.linspace(POINTS[0], POINTS[1], 5)}, "lie on one line; add some beside it"),
        ({(0, 1): POINTS * np.nan}, "outside of them"),
    ],
)
def test_points_that_mean_nothing_are_refused(points, words):
    with pytest.raises(ts.OptionError) as caught:
        matches_of(points, SIZES)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ({"points": POINTS}, "points is"),
        ({"progress": 3}, "progress is 3; pass a function, or None"),
        ({"level": "no"}, "level is 'no'"),
    ],
)
def test_options_of_another_kind_are_refused(option, words):
    with pytest.raises(ts.OptionError, match=words):
        ts.find_places(dark(), **option)
