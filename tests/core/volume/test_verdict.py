"""The verdict on joined stacks names what a slice shows."""

import numpy as np
import pytest
import scipy

import toposeam as ts


def stacks(gain, noise=600.0):
    """Two uint16 stacks of one scene, the second with a gain."""
    rng = np.random.default_rng(0)
    scene = scipy.ndimage.gaussian_filter(rng.random((12, 70, 150)), 3)
    scene = 60000 * (scene - scene.min()) / (scene.max() - scene.min())
    parts = scene[:, :, :95], gain * scene[:, :, 55:]
    return [np.clip(one + rng.normal(0, noise, one.shape), 0, 65535).astype(np.uint16) for one in parts]


@pytest.mark.parametrize(
    ("gain", "matched", "unseen"), [(1.0, False, True), (0.7, False, False), (0.7, True, True)]
)
def test_a_step_of_brightness_is_named(gain, matched, unseen):
    joined = ts.volume(*stacks(gain), offset=(0, 0, 55), match_tones=matched)
    assert joined.verdict.unseen == unseen
    if not unseen:
        z, y, x = joined.verdict.where
        assert 55 <= x < 95
        assert str(joined.verdict) == f"look at {x},{y} of slice {z}"
        near = np.asarray(joined.labels[z, y, max(0, x - 55 - 6) : x - 55 + 7])
        assert near.any()  # the surface is there
        assert not near.all()
    else:
        assert str(joined.verdict) == "no visible surface"


def test_by_blocks_it_says_the_same():
    a, b = stacks(0.7)
    joined = ts.volume(a, b, offset=(0, 0, 55), block=32)
    assert not joined.verdict.unseen
