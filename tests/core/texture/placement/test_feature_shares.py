"""Features on their shares: places whose features have shown too often are dearer."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.texture.canvas import PlaceGrid
from toposeam.texture.exemplar import Atlas
from toposeam.texture.placement.feature_shares import FeatureShares

SIDE, PATCH = 64, (16, 16)


def halves():
    """An exemplar that is dark on the left and bright on the right, its atlas and its feature shares."""
    values = np.full((SIDE, SIDE, 1), 0.2, np.float32)
    values[:, SIDE // 2 :] = 0.8
    atlas = Atlas.of([np.ones((SIDE, SIDE), bool)], 8)
    return atlas, FeatureShares(atlas.spread([values]), atlas, np.full((len(atlas.usable), 1), 4.0))


def dearer(atlas, shares, usage, variety=0.5):
    """How much dearer places are, those of the exemplar's own rows and columns."""
    count = SIDE - PATCH[0] + 1
    places = PlaceGrid((0, 0), PATCH, atlas.margin, 1, (count, count), ((0, PATCH[0]), (0, PATCH[1])))
    return shares.factor(places, usage, variety)


def test_features_shown_at_their_share_have_a_neutral_price():
    atlas, shares = halves()
    usage = np.where(atlas.copied, 3, 0).astype(np.int32)
    np.testing.assert_allclose(dearer(atlas, shares, usage), 1, atol=0.05)
    np.testing.assert_array_equal(dearer(atlas, shares, 0 * usage), 1)


def test_an_overused_kind_is_dearer_wherever_it_occurs():
    atlas, shares = halves()
    usage = np.zeros(atlas.usable.shape, np.int32)
    m = atlas.margin
    usage[m : m + SIDE // 2, m : m + SIDE // 2] = 5  # dark ones, of the upper half only
    found = dearer(atlas, shares, usage)
    dark, bright = found[:, : SIDE // 2 - PATCH[1] - 8], found[:, SIDE // 2 + 8 :]
    assert dark.min() > 2
    assert bright.max() < 0.5
    assert found[-1, 0] == pytest.approx(found[0, 0], rel=0.05)


def test_first_patches_count_as_little_as_if_a_quarter_showed():
    atlas, shares = halves()
    usage = np.zeros(atlas.usable.shape, np.int32)
    m = atlas.margin
    usage[m : m + SIDE // 2, m : m + SIDE // 2] = 1  # as many as a quarter of the exemplar
    few, many = (np.log(dearer(atlas, shares, number * usage, variety=0.01)) for number in (1, 10_000))
    assert few.max() > 0.05
    np.testing.assert_allclose(few, many / 2, atol=2e-3)


def test_a_patch_price_averages_its_kinds_scaled_by_variety():
    atlas, shares = halves()
    usage = np.zeros(atlas.usable.shape, np.int32)
    usage[:, : atlas.margin + SIDE // 2] = atlas.copied[:, : atlas.margin + SIDE // 2]
    found, half = (np.log(dearer(atlas, shares, usage, variety)) for variety in (0.1, 0.05))
    np.testing.assert_allclose(found, 2 * half, atol=1e-5)
    assert found[20, 0] > 0 > found[20, -1]
    middle = found[20, SIDE // 2 - PATCH[1] // 2]
    assert middle == pytest.approx((found[20, 0] + found[20, -1]) / 2, abs=0.2)


def test_nothing_is_infinitely_dear():
    atlas, shares = halves()
    usage = np.zeros(atlas.usable.shape, np.int32)
    usage[atlas.margin, atlas.margin] = 1 << 24
    found = dearer(atlas, shares, usage, variety=100)
    assert np.isfinite(found).all()
    assert found.min() > 0


def test_a_texture_keeps_its_framed_sample_s_brightness(monkeypatch):
    """A frame holds half of a sample's pixels, but patches lie in its middle mostly."""
    rng = np.random.default_rng(0)
    sample = rng.normal(60, 8, (96, 96))
    sample[14:-14, 14:-14] += 100
    sample = np.clip(sample, 0, 255).astype(np.uint8)

    def difference():
        made = [ts.synthesize(sample, 256, patch=24, seed=seed) for seed in (1, 2)]
        return abs(np.mean([one.image.mean() for one in made]) - sample.mean())

    with_kinds = difference()
    monkeypatch.setattr("toposeam.texture.placement.feature_shares._STRENGTH", 0.0)
    without = difference()
    assert with_kinds < 0.6 * without


def test_prices_are_gentler_for_objects_and_follow_light():
    rng = np.random.default_rng(1)
    values = np.full((SIDE, SIDE, 1), 0.5, np.float32)
    values[:, SIDE // 2 :, 0] += rng.choice(np.float32([-0.2, 0.2]), (SIDE, SIDE // 2))
    atlas = Atlas.of([np.ones((SIDE, SIDE), bool)], 8)
    average = np.full((len(atlas.usable), 1), 4.0)
    usage = np.zeros(atlas.usable.shape, np.int32)
    usage[:, atlas.margin + SIDE // 2 :] = 3 * atlas.copied[:, atlas.margin + SIDE // 2 :]

    def calm(**options):
        shares = FeatureShares(atlas.spread([values]), atlas, average, **options)
        return np.log(dearer(atlas, shares, usage, variety=0.05)[:, 0]).mean()

    assert calm() < calm(objects=True) < 0
    assert calm() < 1.5 * calm(levelled=True) < 0
