"""Slow light: found, taken out, levelled between patches."""

import numpy as np
import pytest
import skimage.data
from scipy import ndimage

import toposeam as ts
from toposeam.texture.light import levelled_copies
from toposeam.texture.light.slow_light import _surface, has_slow_light


@pytest.fixture
def lit(sample):
    """Structure under light that falls off to one side, and the structure itself."""
    structure = 120 + 0.35 * sample(0, (128, 128), channels=3).astype(float)
    y, x = np.mgrid[:128, :128] / 128
    light = (1.15 - 0.7 * x - 0.15 * y)[..., np.newaxis]
    return np.clip(structure * light, 0, 255).astype(np.uint8), structure


def steps_at_seams(made):
    """99th percentile of steps between copies over that of the steps inside of them."""
    image, inner, across = made.image.astype(float).mean(axis=2), [], []
    for axis in (0, 1):
        steps, seam = np.abs(np.diff(image, axis=axis)), np.diff(made.labels, axis=axis) != 0
        inner.append(steps[~seam])
        across.append(steps[seam])
    return np.percentile(np.concatenate(across), 99) / np.percentile(np.concatenate(inner), 99)


def test_slow_light_is_told_from_structure(lit, sample):
    everywhere = np.ones((128, 128), bool)
    assert has_slow_light(lit[0] / np.float32(255), everywhere)
    assert not has_slow_light(sample(1, (128, 128), channels=3) / np.float32(255), everywhere)


def discs(seed, count, radius, side=160):
    """Discs of any colours on a ground that is even but for noise: few elements, and flat light."""
    rng = np.random.default_rng(seed)
    image, (y, x) = np.empty((side, side, 3)), np.mgrid[:side, :side]
    image[:] = rng.uniform(0.2, 0.9, 3)
    colours = rng.uniform(0.05, 0.95, (3, 3))
    for row, column in rng.uniform(0, side, (count, 2)):
        image[np.hypot(y - row, x - column) < radius * rng.uniform(0.7, 1.3)] = colours[rng.integers(3)]
    return np.clip(image + rng.normal(0, 0.03, image.shape), 0, 1).astype(np.float32)


def test_few_elements_are_no_light_and_light_on_them_is():
    everywhere = np.ones((160, 160), bool)
    y, x = np.mgrid[-1:1:160j, -1:1:160j]
    kinds = [(5, 26), (9, 20), (16, 16), (30, 12), (60, 8)]
    flat, lit = [], []
    for seed, (count, radius) in enumerate(kinds * 8):
        image = discs(seed, count, radius)
        flat.append(has_slow_light(image, everywhere))
        if seed < 4 * len(kinds):
            fall = (0.7 - 0.3 * (x if seed % 2 else y))[..., np.newaxis]
            lit.append(has_slow_light(image * fall, everywhere))
    assert sum(flat) <= 1
    assert sum(lit) >= 18


def test_light_changes_no_hue_and_leaves_no_range():
    rng, fall = np.random.default_rng(3), np.linspace(0.3, 1, 128)[:, np.newaxis, np.newaxis]
    hues = np.array([[1.0, 0.2, 0.1], [0.2, 0.8, 0.3], [0.1, 0.2, 0.7]])
    image = hues[rng.integers(0, 3, (32, 32))].repeat(4, axis=0).repeat(4, axis=1) * fall
    made = ts.synthesize(image.astype(np.float32), 200, patch=24, level=False, smooth=0)
    plane = made.atlas.spread([image.astype(np.float32)])
    copies = np.arange(made.labels.max() + 1, dtype=np.int32)
    light = levelled_copies(plane, plane, made.atlas, made.index, made.labels, copies, (False, False))
    gain = light.gain(made.index, made.labels)
    lit = gain * made.image + light.offset(gain)
    assert gain.min() < 0.8
    assert gain.max() > 1.2
    assert image.min() - 1e-5 <= lit.min() <= lit.max() <= image.max() + 1e-5

    def hue(colours):
        low, high = (extreme(axis=2, keepdims=True) for extreme in (colours.min, colours.max))
        return (colours - low) / (high - low)

    np.testing.assert_allclose(hue(lit), hue(made.image), atol=1e-4)


def test_what_is_alike_everywhere_has_no_light():
    for value in np.linspace(0.1, 1, 10, dtype=np.float32):
        assert not has_slow_light(np.full((37, 41, 3), value), np.ones((37, 41), bool))


@pytest.mark.medium
def test_patches_under_unlike_light_show_no_squares(lit):
    image, structure = lit
    made = ts.synthesize(image, 256, patch=32, seed=1)
    hard = ts.synthesize(image, 256, patch=32, seed=1, level=False)
    assert made.settings["level"]
    even = ts.synthesize(structure.astype(np.uint8), 256, patch=32, seed=1)
    assert not even.settings["level"]
    assert steps_at_seams(made) <= 1.1 * steps_at_seams(even)
    assert steps_at_seams(hard) > 1.5 * steps_at_seams(even)
    # All light is mixed now: without levelling the same copies would show their borders.
    copies = image[made.source[..., 0], made.source[..., 1]]
    assert (
        np.abs(np.diff(copies.astype(float), axis=1)).max()
        > 1.5 * np.abs(np.diff(made.image.astype(float), axis=1)).max()
    )
    assert image.min() <= made.image.min() <= made.image.max() <= image.max()
    np.testing.assert_array_equal(
        ts.synthesize(image, 256, patch=32, seed=1, level=False, smooth=0).image,
        image[hard.source[..., 0], hard.source[..., 1]],
    )


def test_a_levelled_texture_is_as_bright_as_its_sample():
    image = np.ascontiguousarray(skimage.data.retina()[560:944:2, 360:744:2])
    made = ts.synthesize(image, 300, patch=40, seed=1)
    assert made.settings["level"] is True
    np.testing.assert_allclose(np.median(made.image, axis=(0, 1)), np.median(image, axis=(0, 1)), atol=3)


@pytest.mark.medium
def test_light_does_not_drift_from_one_side_to_the_other():
    # Fur: dark tufts at the lower border, where the sample ends, never fade out downwards.
    image = np.kron(skimage.data.chelsea()[15:95, 70:150], np.ones((2, 2, 1), np.uint8))
    down = np.linspace(-1, 1, 480)[:, np.newaxis, np.newaxis]
    made = [ts.synthesize(image, 480, patch=40, seed=seed, level=True) for seed in (1, 2)]
    slope = 3 * np.mean([one.image * down for one in made], axis=(0, 1, 2))
    assert np.abs(slope).max() < 4


@pytest.mark.medium
def test_a_dark_spot_does_not_stand_in_rows():
    image = np.ascontiguousarray(skimage.data.retina()[560:944:2, 360:744:2])
    dark = ndimage.gaussian_filter(image.mean(axis=2), 6)  # the spot, cut by the sample's border
    row, column = np.unravel_index(dark.argmin(), dark.shape)
    y, x = np.indices(dark.shape)
    away = np.hypot(y - row, x - column)
    near = total = 0
    for seed in range(2):
        made = ts.synthesize(image, 400, seed=seed)
        assert made.settings["level"] is True
        pieces, count = ndimage.label(away[made.source[..., 0], made.source[..., 1]] < 5)
        at = np.array(ndimage.center_of_mass(pieces > 0, pieces, np.arange(1, count + 1)))
        apart = np.hypot(*(at[:, np.newaxis] - at).transpose(2, 0, 1))
        near += (np.count_nonzero(apart < 60) - count) // 2
        total += count
    assert total >= 6
    assert near <= total / 5


def test_maps_are_cut_alike_and_keep_their_values(lit, sample):
    other = sample(3, (128, 128), dtype=np.uint16)
    made = ts.synthesize(lit[0], 150, patch=32, maps=[other], weights=[1, 0], smooth=0)
    np.testing.assert_array_equal(made.maps[0], other[made.source[..., 0], made.source[..., 1]])


@pytest.mark.medium
def test_flattening_divides_the_light_away(lit):
    image, structure = lit
    flat = ts.texture.flatten_light(image)
    assert flat.dtype == np.uint8
    slow = [ndimage.gaussian_filter(one.astype(float).mean(axis=2), 16) for one in (image, flat)]
    assert np.ptp(slow[1]) < 0.15 * np.ptp(slow[0])
    expected = structure * image.mean() / structure.mean()
    assert np.abs(flat - expected).mean() < 3
    made = ts.synthesize(image, 200, patch=32, flatten=True, level=False, smooth=0)
    np.testing.assert_array_equal(made.image, flat[made.source[..., 0], made.source[..., 1]])


@pytest.mark.medium
def test_what_flattening_leaves_of_slow_light_is_levelled(lit):
    # A dark spot is no quadratic surface, and would show as squares.
    retina = np.ascontiguousarray(skimage.data.retina()[560:944:2, 360:744:2])
    assert ts.synthesize(retina, 100, flatten=True).settings["level"] is True
    assert ts.synthesize(lit[1].astype(np.uint8), 100, flatten=True).settings["level"] is False
    assert ts.synthesize(retina, 100, flatten=True, level=False).settings["level"] is False


@pytest.mark.parametrize(("option", "value"), [("flatten", "yes"), ("level", 2)])
def test_wrong_words_are_refused(lit, option, value):
    with pytest.raises(ts.OptionError, match=option):
        ts.synthesize(lit[0], 60, patch=24, **{option: value})


def test_an_empty_mask_leaves_no_light_to_find(lit):
    with pytest.raises(ts.ImageError, match="source_mask is empty"):
        ts.texture.flatten_light(lit[0], source_mask=np.zeros((128, 128)))


def test_levelled_copies_stay_within_the_allowed_range():
    rng = np.random.default_rng(6)
    sample = rng.integers(0, 128, (96, 120, 3)).astype(np.uint8)
    sample[:, :, 1] = np.linspace(20, 127, 96)[:, None].astype(np.uint8)
    sample[:, 70:] = 250  # not to be copied: neither its pixels nor its light
    mask = np.zeros((96, 120), bool)
    mask[2:94, 2:68] = True
    made = ts.synthesize(sample, (100, 100), patch=20, source_mask=mask, level=True).image
    assert made.max() <= sample[:, :68].max()


def test_a_quadratic_surface_is_found_from_some_of_its_pixels():
    y, x = np.mgrid[:9, :7].astype(float)  # odd sides: 0 in the middle of each
    wanted = np.stack([1 + 2 * x - y, x * y - x * x + 3 * y * y], axis=2)
    some = (x + 2 * y) % 3 == 0
    np.testing.assert_allclose(_surface(wanted, some), wanted, atol=1e-8)
