"""Gains: what is protected, and how far they go."""

import numpy as np
import pytest

import toposeam as ts
from toposeam.layers import tones
from toposeam.layers.layer import extent_of
from toposeam.layers.tones import LARGEST_GAIN, WHITE, tone_gains


def flat(value, x, shape=(20, 30), dtype=np.uint8):
    return ts.Layer(np.full(shape, value, dtype), at=(x, 0))


def gains(layers):
    canvas = extent_of(layers)
    return tone_gains(layers, [canvas.place(layer) for layer in layers])


def test_burnt_out_white_stays_white_and_mid_tones_do_not():
    bright = np.full((40, 60), 200, np.uint8)
    bright[:10], bright[10:20] = 255, round(255 * (WHITE - 0.05))
    first, _ = ts.match_tones([ts.Layer(bright), ts.Layer((bright * 0.5).astype(np.uint8), at=(30, 0))])
    assert (first.image[:10] == 255).all()
    assert (first.image[10:20] < bright[10, 0] - 20).all()
    assert (first.image[20:] < 180).all()


def test_between_white_and_what_is_below_it_gains_let_go_evenly():
    ramp = np.tile(np.arange(256, dtype=np.uint8), (40, 1))
    first, _ = ts.match_tones([ts.Layer(ramp), ts.Layer((ramp * 0.6).astype(np.uint8))])
    row = first.image[0].astype(int)
    assert row[-1] == 255
    assert (np.diff(row) >= 0).all()
    assert row[200] < 190


def test_a_gain_is_never_larger_than_the_limit():
    dark, light = flat(12, 0), flat(240, 15)
    found = gains([dark, light])
    assert found.max() <= LARGEST_GAIN
    assert found.min() >= 1 / LARGEST_GAIN
    assert found.max() / found.min() > 2


@pytest.mark.parametrize(("dtype", "white"), [(np.uint8, None), (np.uint16, None), (np.uint16, 4095)])
def test_gains_are_the_same_in_every_depth(dtype, white):
    full = white or np.iinfo(dtype).max
    layers = [
        ts.Layer(np.full((20, 30), round(share * full), dtype), at=(x, 0), data_range=white)
        for share, x in ((0.4, 0), (0.5, 20))
    ]
    first, second = ts.match_tones(layers)
    assert abs(first.image[0, 0] / full - second.image[0, 0] / full) <= 1.5 / 255
    assert first.image[0, 0] / full == pytest.approx(np.sqrt(0.4 * 0.5), abs=0.005)


@pytest.mark.parametrize("dtype", [np.int16, np.int64, np.float32])
def test_layers_of_which_nobody_knows_what_is_white_are_refused(dtype):
    values = np.full((20, 30), 200, dtype)
    with pytest.raises(ts.ImageError, match="say with data_range="):
        ts.match_tones([ts.Layer(values), ts.Layer(values, at=(20, 0))])
    first, _ = ts.match_tones(
        [ts.Layer(values, data_range=255), ts.Layer(values, at=(20, 0), data_range=255)]
    )
    assert (first.image == 200).all()


@pytest.mark.parametrize("count", [1, 2, 3, 1000, 1001, 2500])
@pytest.mark.parametrize(("dtype", "white"), [(np.uint8, 255), (np.uint16, 4095)])
def test_counted_highlights_are_the_sorted_ones(count, dtype, white):
    values = np.random.default_rng(count).integers(0, white, count, endpoint=True).astype(dtype)
    share = values / white
    telling = share[(share > tones.TELLING[0]) & (share < tones.TELLING[1])]
    expected = np.quantile(telling, 0.999) if len(telling) else 0.0
    assert tones._counted(values, float(white)) == pytest.approx(expected, rel=1e-12)


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
    planes, step = tones._both(layers[0], places[0], layers[1], places[1], 3)
    found = tones._log_ratios((layers[0], places[0], layers[1], places[1], 3))
    for known, (one, other, both) in zip(found[:2], planes[:2], strict=True):
        assert known == (
            pytest.approx(np.median(np.log(one[both]) - np.log(other[both])), abs=1e-15),
            both.sum(),
        )
    assert step == 1
    assert found[2] is None
