"""Pairs on several planes: found one after another, verified together, and aligned by the cheapest seam."""

from dataclasses import replace

import numpy as np
import pytest
from skimage import data

import toposeam as ts
from toposeam.layers.canvas import PlaneTransform, on_canvas
from toposeam.layers.registration import applied, cheapest, find_planes, together_verified

SIZE = (800, 600)


def plane(right, down=0.0, tilt=0.0):
    return np.array([[1.0, 0, right], [0.01, 1.0, down], [tilt, 0, 1.0]])


#: Four strips of a picture, each on a plane of its own.
PLANES = [plane(300), plane(325, 4), plane(350, -6, 1e-5), plane(375, 8)]


def in_strips(counts, strays, seed=0, apart=True):
    """Matches of two pictures, so many on each plane, in strips of the second one or all over it."""
    rng = np.random.default_rng(seed)
    first, second = [], []
    for number, (count, matrix) in enumerate(zip(counts, PLANES, strict=True)):
        low, high = (number * 115, number * 115 + 100) if apart else (0, 420)
        own = rng.uniform((low, 0), (high, SIZE[1] - 1), (count, 2))
        first.append(applied(matrix, own) + rng.normal(0, 0.4, own.shape))
        second.append(own)
    wrong = rng.uniform((300, 0), (780, 590), (strays, 2)), rng.uniform((0, 0), (480, 590), (strays, 2))
    order = rng.permutation(sum(counts) + strays)
    return tuple(
        np.concatenate([*own, other])[order] for own, other in zip((first, second), wrong, strict=True)
    )


def planes_of(first, second):
    return find_planes(first, second, (SIZE, SIZE), 2.0)


def test_planes_are_found_one_after_another():
    first, second = in_strips((56, 51, 46, 27), 70)
    found = planes_of(first, second)
    assert [int(one.inliers.sum()) for one in found] == pytest.approx([56, 51, 46], abs=4)  # at most three
    assert np.sum([one.inliers for one in found], axis=0).max() == 1


def test_planes_verify_together_what_none_does_alone():
    first, second = in_strips((56, 51, 46, 27), 70)
    found = planes_of(first, second)
    assert not any(replace(one, overlap=len(first)).verified for one in found)
    assert together_verified(first, found)


def test_what_repeats_itself_verifies_nothing():
    """The same counts, but matches of all four lie among each other, as on a facade some windows off."""
    first, second = in_strips((56, 51, 46, 27), 70, apart=False)
    found = planes_of(first, second)
    assert len(found) > 1
    assert not together_verified(first, found)


def test_strays_lie_on_no_plane():
    rng = np.random.default_rng(3)
    first, second = rng.uniform(0, 1, (2, 250, 2)) * SIZE
    assert not planes_of(first, second)
    assert not together_verified(first, [])


def test_planes_far_apart_are_no_parallax():
    rng = np.random.default_rng(4)
    own = rng.uniform((0, 0), (480, 590), (120, 2))
    moved = np.where(np.arange(120)[:, np.newaxis] < 80, own + np.array([300, 0]), own + np.array([20, 0]))
    assert len(planes_of(moved, own)) == 1


@pytest.fixture(scope="module")
def walked():
    """Two views of a wall, the lower part of which is nearer: placed by the far and by the near plane."""
    far, near = data.brick()[:400, :400], data.gravel()[:400, :400]
    views = []
    for right, shift in ((0, 0), (100, 22)):
        view = np.full((220, 260), 128, np.uint8)
        view[:60] = far[:60, right : right + 260]
        view[60:] = near[60:220, right + shift : right + shift + 260]
        views.append(ts.Layer(view, name=f"view {right}"))
    return views


def placed(views, right):
    transforms = (PlaneTransform(np.eye(3)), PlaneTransform(plane(right) * [[1, 1, 1], [0, 1, 1], [1, 1, 1]]))
    layers = tuple(on_canvas(view, one) for view, one in zip(views, transforms, strict=True))
    return ts.layers.Placement(
        layers=layers,
        model="plane",
        sizes=((260, 220), (260, 220)),
        transforms=transforms,
        numbers=(0, 1),
        correlations={},
        residuals={},
        misfit=0.5,
    )


def test_the_cheapest_seam_decides(walked):
    far, near = placed(walked, 100), placed(walked, 122)
    best = cheapest(walked, far, iter([near]))
    first, second = (one.matrix for one in best.transforms)
    between = np.linalg.inv(first) @ second
    assert between / between[2, 2] == pytest.approx(near.transforms[1].matrix, abs=1e-6)
    assert ts.stitch(near.layers).cost < ts.stitch(far.layers).cost
    assert cheapest(walked, near, iter([far])) is near


def test_a_cheap_seam_of_stretched_pictures_is_not_taken(walked):
    far, near = placed(walked, 100), placed(walked, 122)
    wide = np.diag([2.5, 1.0, 1.0])
    stretched = replace(near, transforms=tuple(PlaneTransform(wide @ one.matrix) for one in near.transforms))
    wider = replace(far, transforms=tuple(PlaneTransform(wide @ one.matrix) for one in far.transforms))
    assert cheapest(walked, wider, iter([stretched])) is wider


def test_an_unseen_seam_needs_no_other_alignment():
    whole = data.camera()
    views = [ts.Layer(whole[:220, :260]), ts.Layer(whole[:220, 100:360])]

    def others():
        raise AssertionError
        yield

    kept = placed(views, 100)
    assert cheapest(views, kept, others()) is kept
