"""Gains: what is protected, and how far they go."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.layers.canvas import Box, extent_of
from toposeam.layers.exposure import encoded
from toposeam.layers.exposure import gains as tones
from toposeam.layers.exposure.gains import LARGEST_GAIN, tone_gains
from toposeam.layers.exposure.linear_light import KNEE, WHITE, Field, Toned, decoded, finished, rolled

DTYPES = [np.uint8, np.uint16, np.float32]


def rendered(light, dtype=np.uint8):
    """Light as a camera would encode it."""
    share = encoded(np.clip(light, 0, 1))
    full = 1 if dtype == np.float32 else np.iinfo(dtype).max
    return (share if full == 1 else np.rint(share * full)).astype(dtype)


def raised(shares, gains, top):
    """(n, C) values whose light is multiplied and rolled off."""
    wanted, whites = encoded(decoded(shares) * gains), encoded(gains)
    return finished(shares.T, wanted.T, whites[:, np.newaxis], top, WHITE).T


def levels(layer):
    """A layer's values as 8-bit levels."""
    return 255 * (np.asarray(layer.image) / layer.white)


def flat(value, x, shape=(20, 30), dtype=np.uint8):
    return ts.Layer(np.full(shape, value, dtype), at=(x, 0))


def gains(layers):
    canvas = extent_of(layers)
    return tone_gains(layers, [canvas.place(layer) for layer in layers])[0]


def exposures(dtype=np.uint8, most=0.6, ratio=1.5, overlap=60):
    """A scene, and its two halves at two exposures."""
    scene = np.random.default_rng(0).uniform(0.01, most, (40, 160, 3))
    left, right = scene[:, : 80 + overlap // 2], scene[:, 80 - overlap // 2 :] * ratio
    layers = [
        ts.Layer(rendered(part, dtype), at=(x, 0)) for part, x in ((left, 0), (right, 80 - overlap // 2))
    ]
    return scene, layers


@pytest.mark.parametrize("dtype", DTYPES)
def test_two_exposures_are_matched_to_a_gray_level(dtype):
    scene, layers = exposures(dtype)
    first, second = ts.layers.match_tones(layers)
    assert np.abs(levels(layers[0])[:, 50:] - levels(layers[1])[:, :60]).max() > 20
    for layer, x in ((first, 0), (second, 50)):
        assert layer.image.dtype == dtype
        wanted = 255 * encoded(scene[:, x : x + 110] * np.sqrt(1.5))
        middle = (wanted > 40) & (wanted < 255 * encoded(KNEE))
        assert np.abs(levels(layer) - np.rint(wanted))[middle].max() <= (1 if dtype == np.uint8 else 0.6)


def test_overall_brightness_is_kept_whichever_layer_is_larger():
    light = np.random.default_rng(1).uniform(0.1, 0.3, (30, 200))
    layers = [ts.Layer(rendered(light[:, :170])), ts.Layer(rendered(1.2 * light[:, 140:]), at=(140, 0))]
    small, large = np.log(gains(layers)[::-1, 0])
    assert 170 * large + 60 * small == pytest.approx(0, abs=1e-9)
    assert large - small == pytest.approx(np.log(1.2), abs=0.02)
    masked = ts.Layer(layers[0].image, mask=np.tile(np.arange(170) >= 110, (30, 1)))  # 60 columns show
    assert np.log(gains([masked, layers[1]])).sum() == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("factor", [0.25, 4.0])
def test_one_other_exposure_hardly_changes_the_rest(factor):
    light = np.random.default_rng(1).uniform(0.05, 0.2, (30, 260))
    parts = [light[:, at : at + 80] * (factor if at == 120 else 1) for at in range(0, 181, 60)]
    layers = [ts.Layer(rendered(part), at=(60 * k, 0)) for k, part in enumerate(parts)]
    found = gains(layers)[:, 0]
    np.testing.assert_allclose(found[[0, 1, 3]] / found[2], factor, rtol=0.03)
    assert abs(np.log(found[0])) < 0.08  # a mean would be 0.35


def test_groups_that_do_not_touch_keep_theirs():
    _, layers = exposures()
    beyond = [ts.Layer(layer.image, at=(layer.at[0] + 500, 0)) for layer in layers]
    np.testing.assert_allclose(np.log(gains([*layers, *beyond])[:2]), np.log(gains(layers)), atol=1e-9)


@pytest.mark.parametrize("top", [1.01, 1.5, 6.0])
def test_highlights_roll_off_without_a_kink(top):
    light = np.linspace(0, top, 20001)
    bent = rolled(light, top)
    below = light <= KNEE
    np.testing.assert_array_equal(bent[below], light[below])
    assert bent[-1] == pytest.approx(1)
    slope = np.diff(bent) / np.diff(light)
    assert (slope > 0).all()
    assert np.abs(np.diff(slope)).max() < 0.01


@pytest.mark.parametrize("dtype", DTYPES)
def test_highlights_agree_too_and_do_not_burn_out(dtype):
    scene = np.random.default_rng(0).uniform(0.01, 0.75, (40, 160, 3))
    scene[:, 110:] *= 1.6  # brighter than the first layer could show
    layers = [
        ts.Layer(rendered(scene[:, :110], dtype)),
        ts.Layer(rendered(scene[:, 50:] * 0.8, dtype), at=(50, 0)),
    ]
    first, second = (levels(layer) for layer in ts.layers.match_tones(layers))
    assert np.abs(first[:, 50:] - second[:, :60]).max() < 3
    beyond = scene[:, 110:] > 1
    assert encoded(scene[:, 110:] * np.sqrt(0.8))[beyond].max() > 1.02
    assert (second[:, 60:][beyond] >= 254.4).mean() < 0.1
    assert second[:, 60:][beyond].min() > 230


def test_hues_stay_where_highlights_roll_off():
    sky = np.array([[0.3, 0.5, 0.85], [0.85, 0.5, 0.3], [0.2, 0.8, 0.4]])
    result = raised(sky, np.full(3, 1.5), 1.5)
    sky = encoded(1.5 * decoded(sky))
    low, middle, high = np.sort(sky, axis=1).T
    lowest, between, highest = np.sort(result, axis=1).T
    np.testing.assert_allclose((between - lowest) / (highest - lowest), (middle - low) / (high - low))
    assert (highest < 1.0).all()
    assert (np.argsort(result, axis=1) == np.argsort(sky, axis=1)).all()


@pytest.mark.parametrize("gain", [0.3, 0.8, 1.3, 4.0])
def test_white_stays_white_and_gray_goes_up_with_gray(gain):
    grays = np.repeat(np.linspace(0, 1, 4001)[:, np.newaxis], 3, axis=1)
    result = raised(grays, gain * np.array([0.95, 1.0, 1.05]), max(1.0, 0.9 * gain))
    assert (np.diff(result, axis=0) >= 0).all()
    np.testing.assert_allclose(result[-1], 1)
    assert np.abs(np.diff(result, axis=0)).max() < 0.02


def test_floats_far_beyond_white_are_light_and_only_multiplied():
    scene = np.random.default_rng(2).exponential(0.5, (40, 100, 3))
    first, second = scene[:, :70], scene[:, 30:] * 1.44
    layers = [ts.Layer(image, at=(x, 0), data_range=1.0) for image, x in ((first, 0), (second, 30))]
    left, right = ts.layers.match_tones(layers)
    np.testing.assert_allclose(left.image, first * 1.2)
    np.testing.assert_allclose(right.image, second / 1.2)


def test_floats_that_ring_a_little_beyond_white_keep_that():
    light = np.random.default_rng(2).uniform(0.05, 0.5, (40, 60))
    ringing = rendered(light, np.float32)
    ringing[:3, :3], ringing[5, 5] = 1.02, -0.01
    first, _ = ts.layers.match_tones([ts.Layer(ringing), ts.Layer(rendered(light / 1.3, np.float32))])
    assert first.image.max() > 1.0
    assert -0.02 < first.image.min() < 0


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("gain", [(0.7, 0.8, 0.75), (1.5, 1.4, 1.6), (1.1, 0.9, 1.0)])
@pytest.mark.parametrize("top", [1.0, 1.4])
@pytest.mark.parametrize("even", [False, True])
def test_tables_and_fields_give_what_reckoning_gives(dtype, gain, top, even):
    image = np.random.default_rng(5).integers(
        0, np.iinfo(dtype).max, (30, 200, 3), endpoint=True, dtype=dtype
    )
    image[:10] = np.sort(image[:10].max(axis=2, keepdims=True)) // (np.arange(3) // 2 + 1)  # and grays
    layer = ts.Layer(image)
    field = Field(np.zeros((5, 5)), Box(0, 0, 30, 200)) if even else None
    found = np.asarray(Toned(layer, np.array(gain), field, top))
    full = float(np.iinfo(dtype).max)
    shares = raised((image / full).reshape(-1, 3), np.array(gain), top).reshape(image.shape)
    np.testing.assert_allclose(found, np.rint(full * shares), atol=1)


def test_burnt_out_white_stays_white_and_mid_tones_do_not():
    bright = np.full((40, 60), 200, np.uint8)
    bright[:10], bright[10:20] = 255, round(255 * (WHITE - 0.05))
    first, _ = ts.layers.match_tones(
        [ts.Layer(bright), ts.Layer((bright * 0.5).astype(np.uint8), at=(30, 0))]
    )
    assert (first.image[:10] == 255).all()
    assert (first.image[10:20] < bright[10, 0] - 20).all()
    assert (first.image[20:] < 180).all()


def test_between_white_and_what_is_below_it_gains_let_go_evenly():
    ramp = np.tile(np.arange(256, dtype=np.uint8), (40, 1))
    first, _ = ts.layers.match_tones([ts.Layer(ramp), ts.Layer((ramp * 0.6).astype(np.uint8))])
    row = first.image[0].astype(int)
    assert row[-1] == 255
    assert (np.diff(row) >= 0).all()
    assert row[200] < 190


def test_an_empty_border_changes_neither_gains_nor_fields():
    rng = np.random.default_rng(6)
    scene, fall = rng.uniform(0.1, 0.5, (40, 74)), np.linspace(1, 0.8, 44)
    small, wide = [], []
    for x, gain in ((0, 1.2), (30, 0.9)):
        image, border = rendered(scene[:, x : x + 44] * fall * gain), ((3, 9), (12, 5))
        small.append(ts.Layer(image, at=(x, 0)))
        mask = np.pad(np.ones(image.shape, bool), border)
        wide.append(ts.Layer(np.pad(image, border, constant_values=90), at=(x - 12, -3), mask=mask))
    for shading in (False, True):
        plain = ts.layers.match_tones(small, shading=shading)
        for layer, other in zip(plain, ts.layers.match_tones(wide, shading=shading), strict=True):
            np.testing.assert_array_equal(other.image[3:43, 12:56], layer.image)
    assert (plain[0].image[:, 30:] != small[0].image[:, 30:]).any()


def test_a_gain_is_never_larger_than_the_limit():
    dark, light = flat(12, 0), flat(246, 15)
    found = gains([dark, light])
    assert found.max() <= LARGEST_GAIN
    assert found.min() >= 1 / LARGEST_GAIN
    assert found.max() / found.min() > 200


def stated(value, x, exposure, burnt):
    image = np.full((20, 30), value, np.uint8)
    image[:, burnt] = 255
    return ts.Layer(image, at=(x, 0), exposure=exposure)


def test_exposures_count_where_an_overlap_is_burnt_out():
    """Its 10 columns are white in both."""
    ends = slice(20, None), slice(0, 10)
    layers = [stated(120, 0, 2.0, ends[0]), stated(120, 20, 1.0, ends[1])]
    dark, light = gains(layers)[:, 0]
    assert light / dark == pytest.approx(2)
    assert dark * light == pytest.approx(1)
    for exposure in (None, 2.0):
        unknown = [stated(120, 0, exposure, ends[0]), stated(120, 20, None, ends[1])]
        assert gains(unknown) == pytest.approx(np.ones((2, 1)))


def test_what_overlaps_show_counts_before_exposures():
    layers = [stated(120, 0, 8.0, slice(0, 0)), stated(120, 20, 1.0, slice(0, 0))]
    assert gains(layers) == pytest.approx(np.ones((2, 1)))


@pytest.mark.parametrize("exposure", [0, -1, np.nan, np.inf, "1/125"])
def test_an_exposure_that_is_none_is_refused(exposure):
    with pytest.raises(ts.OptionError, match="exposure"):
        stated(120, 0, exposure, slice(0, 0))


@pytest.mark.parametrize(("dtype", "white"), [(np.uint8, None), (np.uint16, None), (np.uint16, 4095)])
def test_gains_are_the_same_in_every_depth(dtype, white):
    full = white or np.iinfo(dtype).max
    layers = [
        ts.Layer(np.full((20, 30), round(share * full), dtype), at=(x, 0), data_range=white)
        for share, x in ((0.4, 0), (0.5, 20))
    ]
    first, second = ts.layers.match_tones(layers)
    assert abs(first.image[0, 0] / full - second.image[0, 0] / full) <= 1.5 / 255
    assert first.image[0, 0] / full == pytest.approx(np.sqrt(0.4 * 0.5), abs=0.005)


@pytest.mark.parametrize("dtype", [np.int16, np.int64, np.float32])
def test_layers_of_which_nobody_knows_what_is_white_are_refused(dtype):
    values = np.full((20, 30), 200, dtype)
    with pytest.raises(ts.ImageError, match="say with data_range="):
        ts.layers.match_tones([ts.Layer(values), ts.Layer(values, at=(20, 0))])
    first, _ = ts.layers.match_tones(
        [ts.Layer(values, data_range=255), ts.Layer(values, at=(20, 0), data_range=255)]
    )
    assert (first.image == 200).all()


@pytest.mark.parametrize("count", [1, 2, 3, 1000, 1001, 2500])
@pytest.mark.parametrize(("dtype", "white"), [(np.uint8, 255), (np.uint16, 4095)])
def test_counted_highlights_are_the_sorted_ones(count, dtype, white):
    values = np.random.default_rng(count).integers(0, white, count, endpoint=True).astype(dtype)
    share = values / white
    light = decoded(share)
    telling = light[(light > tones._SHOWING[0]) & (light < tones._SHOWING[1])]
    expected = np.quantile(telling, 0.999) if len(telling) else 0.0
    assert tones._brightest_by_counting(values, float(white)) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("holes", [False, True])
def test_ratios_of_counted_bytes_are_those_of_sorted_logarithms(holes):
    rng = np.random.default_rng(3)
    layers = []
    for x in (0, 30):
        image = rng.integers(0, 256, (41, 60, 3), dtype=np.uint8)
        image[..., 2] = 255  # tells nothing
        alpha = np.where(rng.random((41, 60)) < 0.3, 0, 255).astype(np.uint8) if holes else None
        layers.append(ts.Layer(image, alpha=alpha, at=(x, 0)))
    places = [extent_of(layers).place(layer) for layer in layers]
    common = places[0].shared(places[1])
    planes, step = tones._common_light(*zip(layers, places, strict=True), common, 3, False)
    found = tones._log_ratios((layers[0], places[0], layers[1], places[1], 3, False))
    for known, (one, other, both) in zip(found[:2], planes[:2], strict=True):
        assert known == (
            pytest.approx(np.median(np.log(one[both]) - np.log(other[both])), abs=1e-6),
            both.sum(),
        )
    assert step == 1
    assert found[2] is None


def with_a_burnt_sky(times):
    """A dark view and one exposed `times` longer, both of a blue sky above a wall, that overlap by half."""
    rng = np.random.default_rng(5)
    light = np.empty((120, 300, 3))
    light[:60] = np.array([0.25, 0.4, 0.6]) * np.linspace(0.9, 1.1, 60)[:, None, None]
    light[60:] = np.array([0.15, 0.1, 0.08]) * (0.4 + rng.random((60, 300, 1)))
    pictures = [np.minimum(light[:, :200], 1), np.minimum(times * light[:, 100:], 1)]
    return [ts.Layer(rendered(picture), at=(x, 0)) for picture, x in zip(pictures, (0, 100), strict=True)]


def test_burnt_skies_are_joined_by_gradients():
    layers = with_a_burnt_sky(2.5)
    stitched = ts.stitch(layers, blend="auto", match_tones=True)
    assert stitched.blending.name == "gradient"
    sky = stitched.image[10:50].astype(float)
    assert np.abs(np.diff(sky, axis=1)).max() <= 3  # levels, from column to column
    assert (np.diff(sky.mean(axis=(0, 1))) > 10).all()  # red, green and blue
    torn = ts.stitch(layers, blend="multiband", match_tones=True).image[10:50].astype(float)
    assert np.ptp(torn.mean(axis=0), axis=0).max() > 2 * np.ptp(sky.mean(axis=0), axis=0).max()


def test_skies_of_equal_exposure_need_no_gradients():
    for layers in (with_a_burnt_sky(1.0), with_a_burnt_sky(1.5)):
        assert ts.stitch(layers, blend="auto", match_tones=True).blending.name == "multiband"
    assert ts.stitch(with_a_burnt_sky(2.5), blend="auto").blending.name == "multiband"  # as tones stay
