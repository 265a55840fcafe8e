"""A trembling camera is measured and taken out, whatever moves in the picture."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.volume.clip import moved, steadied
from toposeam.volume.clip.frames import as_clip


def scene(frames=30, size=(90, 140), seed=0):
    """A ground that stands still, and a wheel before its middle that turns once in ten frames, in 8 bits."""
    rng = np.random.default_rng(seed)
    ground = ndimage.gaussian_filter(rng.standard_normal(size), 2)
    ground = 0.5 + 0.15 * ground / ground.std()
    y, x = np.indices(size) - (np.array(size)[:, None, None] - 1) / 2
    turn = np.arctan2(y, x) - 2 * np.pi * np.arange(frames)[:, None, None] / 10
    clip = np.where(np.hypot(y, x) < 22, 0.5 + 0.4 * np.cos(3 * turn), ground)
    return np.rint(255 * np.clip(clip, 0, 1)).astype(np.uint8)


def trembling(clip, px=3.0, turn=0.01, seed=1):
    """The clip as a camera sees it that moves smoothly by about so much, and the motion."""
    rng = np.random.default_rng(seed)
    motion = ndimage.gaussian_filter1d(rng.standard_normal((len(clip), 3)), 2, axis=0)
    motion *= np.array([px, px, turn]) / motion.std(axis=0)
    middle = (np.array(clip.shape[1:]) - 1) / 2
    seen = []
    for frame, (down, right, angle) in zip(clip, motion, strict=True):
        back = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        at = middle - back @ (middle + np.array([down, right]))
        seen.append(ndimage.affine_transform(frame.astype(float), back, at, order=3, mode="mirror"))
    return np.rint(np.clip(seen, 0, 255)).astype(np.uint8), motion


@pytest.mark.medium
@pytest.mark.parametrize("seed", [0, 1])
def test_shift_and_turn_are_measured(seed):
    seen, motion = trembling(scene(seed=seed), seed=seed + 5)
    found = steadied(as_clip(seen)[0], None)
    origin = len(seen) // 2
    for index in (0, 10, 29):
        # Where the corner of the middle frame lies in another one.
        corners = []
        for path in (motion, found.motion):
            down, right, turn = path[index]
            here = path[origin]
            corner = np.array([-40.0, -65.0]) - (here[:2] if path is motion else 0)
            angle = turn - (here[2] if path is motion else 0)
            rotated = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]) @ corner
            corners.append(rotated + np.array([down, right]))
        np.testing.assert_allclose(*corners, atol=0.35)


@pytest.mark.medium
def test_what_stands_still_stands_still_in_the_loop():
    seen, motion = trembling(scene())
    made = ts.loop(seen, stabilise=True, level=False)
    assert len(made) % 10 == 0
    right, down, turn = made.steadied
    spans = np.ptp(motion, axis=0)
    assert (down, right, np.radians(turn)) == pytest.approx(spans, abs=0.5)
    height, width = made.size
    assert made.frames.shape == (len(made), height, width)
    assert 90 - 1.5 * down - 5 < height < 90
    rim = np.zeros((height, width), bool)
    rim[:12], rim[-12:] = True, True
    assert (
        made.frames[:, rim].astype(float).std(axis=0).mean()
        < 0.2 * seen[:, 8:16].astype(float).std(axis=0).mean()
    )


@pytest.mark.medium
def test_a_camera_that_stands_still_is_left_alone():
    clip = scene()
    plain, same = ts.loop(clip), ts.loop(clip, stabilise=True)
    assert same.steadied is None
    np.testing.assert_array_equal(plain.frames, same.frames)


@pytest.mark.medium
def test_a_mask_of_what_stays_still_is_cropped_alike():
    seen, _ = trembling(scene())
    mask = np.ones(seen.shape[1:], bool)
    mask[25:65, 50:90] = False
    made = ts.loop(seen, stabilise=True, still=mask)
    assert (np.ptp(made.frames, axis=0)[:15] == 0).all()
    assert np.ptp(made.frames, axis=0).max() > 50


@pytest.mark.medium
def test_a_camera_that_moves_too_far_is_told():
    wide = scene(30, (60, 500))[0]
    panned = np.stack([wide[:, 8 * t : 8 * t + 120] for t in range(30)])
    with pytest.raises(ts.ImageError, match="take a part of the clip"):
        ts.loop(panned, stabilise=True)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_whole_pixels_move_exactly(dtype):
    frame = (np.random.default_rng(0).random((20, 30, 2)) * 100).astype(dtype)
    found = moved(frame, 2, -3, 0.0, (9.5, 14.5))
    np.testing.assert_allclose(found[:-2, 3:], frame[2:, :-3], atol=1e-4)


def test_turning_there_and_back_hardly_changes_a_smooth_frame():
    frame = ndimage.gaussian_filter(np.random.default_rng(0).random((60, 80, 1)), (4, 4, 0))
    back = moved(moved(frame, 0, 0, 0.05, (29.5, 39.5)), 0, 0, -0.05, (29.5, 39.5))
    assert np.abs(back - frame)[8:-8, 8:-8].max() < 0.02 * np.ptp(frame)


@pytest.mark.parametrize("size", [(24, 1), (1, 24)])
def test_a_clip_of_one_pixel_across_is_left_alone(size):
    clip = np.random.default_rng(0).random((16, *size))
    assert steadied(as_clip(clip)[0], 1.0) is None
