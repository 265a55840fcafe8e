"""Loops whose light is levelled: no step is left, nothing is doubled, and what stands still stands still."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.volume.clip.levelling import remove_light_difference
from toposeam.volume.clip.result import add_change


def passing(frames=40, size=(24, 32), seed=0):
    """Clouds: soft forms that pass and never come back."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((size[0], size[1] + frames))
    texture = ndimage.gaussian_filter(noise, 4, mode="wrap")
    texture = 0.2 + 0.6 * (texture - texture.min()) / np.ptp(texture)
    return np.stack([texture[:, t : t + size[1]] for t in range(frames)])


def greatest_step(frames):
    """The greatest step of any place, of a frame to the next one, the last one to the first."""
    changes = np.diff(np.concatenate([frames, frames[:1]]).astype(float), axis=0)
    return ndimage.gaussian_filter(np.abs(changes), (0, 2, 2)).max()


@pytest.mark.parametrize("seed", range(3))
def test_soft_forms_that_never_come_back_do_not_step(seed):
    clip = passing(seed=seed)
    options = {"length": 20, "start": 0, "transition": 10}
    hard, soft = (ts.loop(clip, level=level, **options).frames for level in (False, True))
    changes = np.abs(np.diff(clip, axis=0))
    ordinary = ndimage.gaussian_filter(changes, (0, 2, 2)).max()
    assert greatest_step(hard) > 2 * ordinary  # else this clip tells nothing
    assert greatest_step(soft) < 1.3 * ordinary


def test_the_mean_over_the_loop_stays():
    made = ts.loop(passing(), level=True, length=20, start=0, transition=10)
    pixels = np.take_along_axis(passing(), made.source.astype(int), 0)
    # But for places that would get lighter or darker than the clip ever has them.
    assert made.frames.mean() == pytest.approx(pixels.mean(), abs=1e-4)
    assert np.abs(made.frames - pixels).max() > 0.01


def test_a_clip_that_comes_back_keeps_its_values():
    y, x = np.indices((16, 16)) - 7.5
    turn = np.arctan2(y, x) - 2 * np.pi * np.arange(32)[:, None, None] / 12
    wheel = 0.5 + 0.4 * np.cos(turn)
    made = ts.loop(wheel, level=True, length=12)
    np.testing.assert_allclose(made.frames, np.take_along_axis(wheel, made.source.astype(int), 0), atol=1e-5)


def test_what_is_to_stand_still_does_though_light_is_levelled():
    still = np.zeros((24, 32), bool)
    still[:, :12] = True
    made = ts.loop(passing(), level=True, still=still, length=20, transition=10)
    assert (made.frames[:, still] == made.frames[0, still]).all()
    assert (np.diff(made.frames[:, ~still], axis=0) != 0).any()


@pytest.mark.medium
def test_every_jump_of_a_grown_clip_is_levelled():
    clip = passing(60, seed=1)
    hard, soft = (ts.loop(clip, grow=120, transition=8, seed=1, level=level) for level in (False, True))
    assert len(set(hard.jumps)) > 1
    assert greatest_step(soft.frames) < 0.7 * greatest_step(hard.frames)


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.int16, np.uint16, np.float32, np.float64])
def test_values_stay_of_their_type_and_within_it(dtype):
    if np.issubdtype(dtype, np.integer):
        clip = np.rint(passing() * np.iinfo(dtype).max).astype(dtype)
    else:
        clip = passing() > 0.5 if dtype is bool else passing().astype(dtype)
    given = None if dtype is not np.int16 else 32767
    made = ts.loop(clip, level=True, length=20, start=0, transition=10, data_range=given)
    assert made.frames.dtype == clip.dtype
    assert made.frames.shape[1:] == clip.shape[1:]


def test_sums_beyond_a_type_stop_at_its_ends():
    assert add_change(np.array([250, 3], np.uint8), np.array([9.6, -9.6])).tolist() == [255, 0]
    assert add_change(np.array([-5, 7], np.int16), np.array([-9.6, 0.6])).tolist() == [-15, 8]
    assert add_change(np.array([True, False]), np.array([-0.6, 0.4])).tolist() == [False, False]
    assert add_change(np.array([0.9]), np.array([0.4])).tolist() == [1.3]


def test_light_is_told_from_what_moves():
    rng = np.random.default_rng(0)
    a = np.broadcast_to(0.3 + 0.2 * rng.random((30, 40, 3)), (4, 30, 40, 3)).copy()
    b = a - 0.04
    b[:, 8:20, 10:20] = 0.9  # something that came in
    one, other = remove_light_difference(a.astype(np.float32), b.astype(np.float32))
    apart = (one - other).mean(axis=(0, 3))
    moving = np.zeros(apart.shape, bool)
    moving[8:20, 10:20] = True
    assert np.abs(apart[~moving]).max() < 0.004
    assert apart[moving].max() < -0.3
    np.testing.assert_allclose(one + other, a + b, atol=1e-6)


def test_what_is_always_black_stays_black():
    """A glow that pulses over the lower half: its light must not be spread over the dark ground above."""
    rng = np.random.default_rng(0)
    noise = ndimage.gaussian_filter(rng.standard_normal((40, 24, 32)), (2, 3, 3), mode="wrap")
    clip = np.full((40, 24, 32), 0.02)
    clip[:, 12:] = np.clip(0.6 + 0.3 * noise[:, 12:] / noise.std(), 0.02, 1)
    made = ts.loop(clip, level=True, length=20, start=0, transition=10)
    lit = made.frames - np.take_along_axis(clip, made.source.astype(int), 0)
    assert np.abs(lit[:, 12:]).max() > 0.05  # else this clip tells nothing
    assert np.abs(lit[:, :11]).max() < 1e-6
