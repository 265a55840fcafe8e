"""What catches the eye, and objects that seams leave whole and do not repeat near by."""

import numpy as np
from scipy import ndimage
from skimage import data

import toposeam as ts
from toposeam.texture.exemplar import add_guard, find_landmarks

SIDE = 128


def discs():
    """A sample with discs of 16 px on paper, all of one look, and the number of the disc at each pixel."""
    y, x = np.mgrid[:SIDE, :SIDE]
    objects, rng, middles = np.zeros((SIDE, SIDE), int), np.random.default_rng(1), []
    for _ in range(4000):
        row, column = rng.integers(10, SIDE - 10, 2)
        if all(np.hypot(row - a, column - b) > 24 for a, b in middles):
            middles.append((row, column))
            objects[np.hypot(y - row, x - column) < 8] = len(middles)
    paper = 0.8 + 0.04 * rng.normal(size=(SIDE, SIDE))
    return np.clip(np.where(objects > 0, 0.2, paper), 0, 1).astype(np.float32), objects


def test_objects_on_a_ground_are_told_from_gravel_and_brick():
    image, objects = discs()
    every = np.ones(image.shape, bool)
    weight, guard = find_landmarks(image[..., np.newaxis], every, 1)
    assert abs(weight.mean() - 1) < 1e-3
    assert weight[objects > 0].mean() > 10 * weight[objects == 0].mean()
    assert guard[objects.ravel() > 0].mean() > 10 * guard[objects.ravel() == 0].mean()
    coarse, _ = find_landmarks(image[..., np.newaxis], every, 2)
    assert coarse.shape == image.shape
    assert np.corrcoef(coarse.ravel(), weight.ravel())[0, 1] > 0.9
    for other in (data.gravel(), data.brick(), data.grass()):
        part = other[:192, :192, np.newaxis] / np.float32(255)
        assert find_landmarks(part, np.ones(part.shape[:2], bool), 1).guard is None
    plain, nothing = find_landmarks(np.full((20, 20, 1), 0.5, np.float32), np.ones((20, 20), bool), 1)
    assert np.isfinite(plain).all()
    assert nothing is None or np.isfinite(nothing).all()


def test_small_objects_are_found_and_mortar_is_none():
    y, x = np.mgrid[:SIDE, :SIDE]
    noise = 0.04 * np.random.default_rng(1).normal(size=(SIDE, SIDE))
    discs = np.hypot(y % 20 - 10, (x + 7 * (y // 20)) % 20 - 10) < 5
    mortar = ((y % 32) < 4) | (((x + 20 * (y // 32 % 2)) % 40) < 4)
    for shown, found in ((discs, True), (mortar, False)):
        image = (np.where(shown, 0.2, 0.8) + noise).astype(np.float32)[..., np.newaxis]
        assert (find_landmarks(image, np.ones(shown.shape, bool), 1).guard is not None) == found
    bricks = data.brick()[192:384, 192:384, np.newaxis] / np.float32(255)
    assert find_landmarks(bricks, np.ones(bricks.shape[:2], bool), 1).guard is None


def test_a_seam_pays_for_objects_unless_they_are_continued():
    guard = np.arange(100, dtype=np.float32)
    padded = np.full((4, 5), -1, np.int32)
    padded[1:3, 1:4] = [[10, 11, 12], [20, 21, 22]]
    source = np.array([[10, 51, 52], [20, 61, 62]], np.int32)
    plane = np.zeros((4, 5, 1), np.float32)
    a, b = add_guard(guard, plane, plane, padded, source)
    assert a.shape == b.shape == (4, 5, 2)
    np.testing.assert_array_equal(a[1:3, 1:4, 1], [[0, 11, 12], [0, 21, 22]])
    np.testing.assert_array_equal(b[1:3, 1:4, 1], [[0, -51, -52], [0, -61, -62]])
    assert not a[0].any()
    assert not b[:, 0].any()


def test_objects_stay_whole_and_do_not_come_twice_near_by():
    image, objects = discs()
    area = np.median(np.bincount(objects.ravel())[1:])
    whole = total = near = 0
    for seed in range(3):
        made = ts.synthesize(image, 320, patch=44, seed=seed)
        shown = objects[made.source[..., 0], made.source[..., 1]]
        pieces, _ = ndimage.label(shown > 0)
        for number, box in enumerate(ndimage.find_objects(pieces), start=1):
            if all(side.start > 0 and side.stop < 320 for side in box):
                total += 1
                whole += abs((pieces[box] == number).sum() / area - 1) < 0.1
        for number in range(1, objects.max() + 1):
            parts, count = ndimage.label(shown == number)
            sizes = np.bincount(parts.ravel(), minlength=count + 1)
            large = [k for k in range(1, count + 1) if sizes[k] > 0.5 * area]
            at = np.array(ndimage.center_of_mass(parts > 0, parts, large)).reshape(-1, 2)
            apart = np.hypot(*(at[:, np.newaxis] - at).transpose(2, 0, 1))
            near += int((np.triu(apart, 1) > 0)[(apart < SIDE / 2)].sum())
    assert total > 150
    assert whole > 0.9 * total  # 0.82 where seams do not know of objects
    assert near < 0.15 * total  # 0.36 where every pixel counts alike, and any distance
