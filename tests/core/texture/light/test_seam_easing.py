"""Steps at seams, eased into the copies."""

import dataclasses
import tracemalloc

import numpy as np
import pytest
import skimage.data
from scipy import ndimage

import toposeam as ts
from toposeam.texture.canvas import render
from toposeam.texture.exemplar import Atlas
from toposeam.texture.light import CopyLight, EasedLight, levelled_copies
from toposeam.texture.light.seam_easing import is_fibrous


def two_copies(step, wraps):
    """A picture that shows one tone of a sample on the left and another one on the right, eased, and what was
    added to it.
    """
    plane = np.full((60, 120, 1), 100, np.float32)
    plane[:, 60:] += step
    atlas = Atlas.of([np.ones((60, 120), bool)], 4)
    flat = np.arange(atlas.usable.size, dtype=np.int32).reshape(atlas.usable.shape)[atlas.places[0]]
    index = np.concatenate([flat[:, :40], flat[:, 70:110]], axis=1)
    labels = np.repeat(np.array([[0, 1]], np.int32), 40, axis=1).repeat(60, axis=0)
    spread = atlas.spread([plane])
    light = dataclasses.replace(CopyLight.of(spread, atlas), low=0.0, high=255.0)
    added = EasedLight(spread, light, index, labels, wraps)(0).offset[..., 0]
    return spread.reshape(-1)[index] + added, added


@pytest.mark.parametrize("wraps", [(False, False), (True, False)])
def test_a_step_is_shared_by_both_sides_and_dies_away(wraps):
    picture, added = two_copies(20, wraps)
    assert np.abs(np.diff(picture, axis=1)).max() < 1.5  # it was 20
    np.testing.assert_allclose(added[:, 39], -added[:, 40], atol=1e-3)
    assert added[30, 39] == pytest.approx(10, abs=0.8)
    assert np.abs(added[:, [0, -1]]).max() < 1  # three times its reach away
    np.testing.assert_allclose(added, added[:1].repeat(60, axis=0), atol=1e-3)


def test_where_a_texture_repeats_its_border_is_eased_as_well():
    picture, _ = two_copies(20, (False, True))
    assert np.abs(picture[:, 0] - picture[:, -1]).max() < 1.5
    assert np.abs(np.diff(picture, axis=1)).max() < 1.5


def test_an_edge_is_left_and_so_is_what_fits():
    assert np.abs(two_copies(150, (False, False))[1]).max() < 15  # 75 would ease it
    assert np.abs(two_copies(0, (False, False))[1]).max() < 1e-3


def steps(made):
    """The 99th percentile of the steps between copies over that of those inside of them."""
    across, inside = [], []
    for axis in (0, 1):
        step = np.abs(np.diff(made.image.mean(axis=2), axis=axis))
        seam = np.diff(made.labels, axis=axis) != 0
        across.append(step[seam])
        inside.append(step[~seam])
    return np.percentile(np.concatenate(across), 99) / np.percentile(np.concatenate(inside), 99)


@pytest.mark.medium
@pytest.mark.parametrize("tileable", ["none", "both"])
def test_seams_of_a_smooth_sample_step_no_more_than_its_inside(tileable, monkeypatch):
    retina = skimage.data.retina()[560:944, 360:744].reshape(192, 2, 192, 2, 3).mean(axis=(1, 3))
    sample = np.rint(retina).astype(np.uint8)  # a dark spot is cut by its border
    options = {"seed": 1, "tileable": tileable}
    made = ts.synthesize(sample, 320, **options)
    assert made.settings["level"]
    assert steps(made) <= 1.1
    monkeypatch.setattr(
        EasedLight, "_step", lambda self, plane, first, second, step: np.zeros((len(first), 3))
    )
    assert steps(ts.synthesize(sample, 320, **options)) > 1.2


@pytest.mark.parametrize("tileable", ["none", "both"])
def test_steps_of_smooth_samples_are_eased_without_levelling(tileable, monkeypatch):
    # Steps decide at which line a texture that repeats begins.
    monkeypatch.setattr("toposeam.texture.synthesize.begun", lambda made: made)
    noise = ndimage.gaussian_filter(np.random.default_rng(4).normal(size=(96, 96)), 2.5, mode="wrap")
    sample = np.rint(128 + 30 * noise / noise.std()).clip(0, 255).astype(np.uint8)[..., np.newaxis]
    options = {"seed": 3, "patch": 24, "tileable": tileable}
    made, hard = ts.synthesize(sample, 160, **options), ts.synthesize(sample, 160, level=False, **options)
    assert made.settings["level"] == "steps"
    np.testing.assert_array_equal(made.source, hard.source)  # copies stay where they are
    assert steps(made) < 0.95 * steps(hard)
    assert abs(made.image.mean() - hard.image.mean()) < 0.5
    copied = sample[made.source[..., 0], made.source[..., 1], 0].astype(int)
    assert np.median(np.abs(made.image[..., 0] - copied)) <= 3


def fibres(turn, noise, seed=0):
    """(128, 128) of many tones, that fade out slowly along a direction, degrees."""
    rng = np.random.default_rng(seed)
    made = ndimage.gaussian_filter(rng.normal(size=(240, 240)), (40, 0.9))
    made = ndimage.rotate(made, turn, reshape=False, mode="reflect")[56:184, 56:184]
    made = 128 + 45 * made / made.std() + noise * rng.normal(size=made.shape)
    return np.clip(made, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("turn", [0, 20, 75])
@pytest.mark.parametrize("noise", [0, 8])
def test_fibres_are_told_at_any_angle(turn, noise):
    everywhere, image = np.ones((128, 128), bool), fibres(turn, noise) / np.float32(255)
    assert is_fibrous(image[..., np.newaxis], everywhere)
    assert not is_fibrous((image + image.T)[..., np.newaxis], everywhere)
    assert not is_fibrous(np.full((16, 16, 1), 0.5, np.float32), np.ones((16, 16), bool))


@pytest.mark.medium
def test_fibres_do_not_end_in_steps_where_patches_meet():
    image = fibres(0, 4)

    def ends(made):
        step, seam = np.abs(np.diff(made.image.astype(float), axis=0)), np.diff(made.labels, axis=0) != 0
        return step[seam].mean() / step[~seam].mean()

    made, hard = (ts.synthesize(image, 256, seed=1, setting="varied", level=level) for level in (None, False))
    assert made.settings["level"] is True
    assert ends(made) < 0.75 * ends(hard)


def test_fine_detail_keeps_its_values():
    sample = np.random.default_rng(4).integers(0, 256, (64, 64)).astype(np.uint8)
    made = ts.synthesize(sample, 80, patch=20, smooth=0)
    assert made.settings["level"] is False
    np.testing.assert_array_equal(made.image, sample[made.source[..., 0], made.source[..., 1]])


def test_light_of_a_large_canvas_takes_few_bytes_a_pixel():
    rng = np.random.default_rng(3)
    plane = rng.uniform(50, 200, (160, 160, 3)).astype(np.float32)
    atlas = Atlas.of([np.ones((160, 160), bool)], 4)
    flat = np.arange(atlas.usable.size, dtype=np.int32).reshape(atlas.usable.shape)[atlas.places[0]]
    side, count = 40, 36
    index = np.empty((side * count, side * count), np.int32)
    labels = np.repeat(np.arange(count**2, dtype=np.int32).reshape(count, count), side, 0).repeat(side, 1)
    for row in range(count):
        for column in range(count):
            y, x = rng.integers(0, 160 - side, 2)
            index[row * side :, column * side :][:side, :side] = flat[y : y + side, x : x + side]
    spread = atlas.spread([plane])
    tracemalloc.start()
    light = levelled_copies(
        spread, spread / 255, atlas, index, labels, np.arange(count**2, dtype=np.int32), (True, True)
    )
    eased = EasedLight(spread, light, index, labels, (True, True))
    for channel in range(3):
        made = render(
            index, spread[..., channel : channel + 1], atlas.usable, (True, True), 1, eased(channel)
        )
        assert np.isfinite(made).all()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak / index.size < 40  # all at once: more than 100
