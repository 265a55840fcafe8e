"""Fields of gain: what lenses darken is taken out, and nothing else."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.layers.canvas import Box
from toposeam.layers.exposure import encoded
from toposeam.layers.exposure.gains import fit_fields
from toposeam.layers.exposure.linear_light import Field, decoded, weights_along

SIDE, STEP = 240, 160


def wall(seed=0):
    rng = np.random.default_rng(seed)
    size = SIDE + STEP
    coarse = ndimage.gaussian_filter(rng.standard_normal((size, size)), 6)
    return 110 + 60 * coarse / np.abs(coarse).max()


def darkening(share):
    y, x = np.mgrid[-1 : 1 : SIDE * 1j, -1 : 1 : SIDE * 1j]
    return 1 - share * (x * x + y * y) / 2


def frames(share=0.2, gains=(1.0, 1.05, 0.96, 1.02), dtype=np.uint8, objects=True):
    """Four frames of a wall, darker towards their corners, one with something that the others do not have."""
    whole, result = wall(), []
    rng = np.random.default_rng(1)
    for index, gain in enumerate(gains):
        top, left = STEP * (index // 2), STEP * (index % 2)
        frame = whole[top : top + SIDE, left : left + SIDE].copy()
        if objects and index == 3:
            frame[10:60, 100:170] = 15
        light = decoded(frame / 255) * (darkening(share) * gain) ** 2.4
        frame = 255 * encoded(light) + rng.normal(0, 1, frame.shape)
        full = 1.0 if np.issubdtype(dtype, np.integer) else 255
        scale = 257 if dtype == np.uint16 else 1
        values = frame * scale / full
        image = np.rint(values).astype(dtype) if full == 1.0 else values.astype(dtype)
        result.append(ts.Layer(image, at=(left, top), name=str(index)))
    return result, whole


def off(layers, whole):
    """How far the layers are from the wall at the scale of light, a share, apart from one gain for all."""
    ratios = []
    for layer in layers:
        x, y = layer.at
        image = np.asarray(layer.image) / layer.white
        local = ndimage.median_filter(image / whole[y : y + SIDE, x : x + SIDE], 15)
        ratios.append(local[::8, ::8] * 255)
    together = np.concatenate([ratio.ravel() for ratio in ratios])
    return np.abs(together / np.median(together) - 1)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_what_the_lens_darkens_is_taken_out(dtype):
    layers, whole = frames(dtype=dtype)
    before = np.quantile(off(ts.layers.match_tones(layers), whole), 0.9)
    after = np.quantile(off(ts.layers.match_tones(layers, shading=True), whole), 0.9)
    assert before > 0.06
    assert after < 0.02


def test_the_middle_keeps_its_brightness():
    layers, _ = frames(gains=(1.0, 1.0, 1.0, 1.0))
    for before, after in zip(layers, ts.layers.match_tones(layers, shading=True), strict=True):
        middle = np.s_[110:130, 110:130]
        assert np.asarray(after.image)[middle].mean() / before.image[middle].mean() == pytest.approx(
            1, abs=0.02
        )


def test_an_even_lens_gets_an_even_field_although_things_moved():
    layers, _ = frames(share=0.0)
    even, field = ts.layers.match_tones(layers), ts.layers.match_tones(layers, shading=True)
    for one, other in zip(even, field, strict=True):
        difference = np.asarray(one.image).astype(int) - np.asarray(other.image)
        assert np.abs(np.median(difference)) <= 1
        assert np.abs(difference).mean() < 1.2


def test_stitched_layers_agree_where_they_meet():
    layers, whole = frames(objects=False)
    uneven = {}
    for option in ("match_tones", "match_shading"):
        stitched = ts.stitch(layers, **{option: True})
        ratio = ndimage.median_filter(stitched.image / whole, 9)
        uneven[option] = np.std(ratio) / np.mean(ratio)
    assert uneven["match_tones"] > 0.02
    assert uneven["match_shading"] < 0.01


def test_nothing_bright_burns_out_in_the_corners():
    layers, _ = frames(objects=False)
    bright = []
    for layer in layers:
        image = np.asarray(layer.image).copy()
        image[4:24, 4:24] = 235
        bright.append(ts.Layer(image, at=layer.at, name=layer.name))
    for layer in ts.layers.match_tones(bright, shading=True):
        assert (
            np.asarray(layer.image) == 255
        ).mean() < 0.003  # of 0.007; a thousandth may, and some are rounded up


def test_two_pictures_side_by_side_determine_vertical_shading():
    """Which no overlap does: fields go round the middle."""
    layers, whole = frames(gains=(1.0, 1.0), objects=False)
    assert np.quantile(off(layers, whole), 0.9) > 0.07
    assert np.quantile(off(ts.layers.match_tones(layers, shading=True), whole), 0.9) < 0.03


def test_canvases_of_warped_pictures_are_told_from_pictures():
    """What the lens did lies where the pictures lie, not where their canvases do."""
    layers, _ = frames(objects=False)
    whole = SIDE + STEP
    warped = []
    for layer in layers:
        x, y = layer.at
        pads = (y, whole - SIDE - y), (x, whole - SIDE - x)
        mask = np.pad(np.ones((SIDE, SIDE), bool), pads)
        warped.append(ts.Layer(np.pad(layer.image, pads), mask=mask))
    for layer, canvas in zip(
        ts.layers.match_tones(layers, shading=True), ts.layers.match_tones(warped, shading=True), strict=True
    ):
        x, y = layer.at
        np.testing.assert_array_equal(canvas.image[y : y + SIDE, x : x + SIDE], layer.image)


def test_splines_add_up_to_one_and_give_parabolas_exactly():
    weights = weights_along(90, np.arange(90))
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    x = (np.arange(90) + 0.5) / 90
    fit, *_ = np.linalg.lstsq(weights, x * x, rcond=None)
    np.testing.assert_allclose(weights @ fit, x * x, atol=1e-12)


def test_windows_of_a_field_are_those_of_the_whole():
    field = Field(np.random.default_rng(0).normal(0, 0.1, (5, 5)), Box(0, 0, 60, 80))
    whole = field.logarithm(range(60), range(80))
    part = field.logarithm(range(7, 30, 2), range(9))
    np.testing.assert_allclose(part, whole[7:30:2, :9])


def test_without_telling_pixels_there_is_no_field():
    places = [Box(0, 0, 50, 50), Box(0, 30, 50, 80), Box(200, 200, 220, 220)]
    fields = fit_fields(places, lambda i, j, box: (np.full(box.shape, np.nan), 1))
    assert all((np.exp(field) == 1).all() for field in fields)


def test_few_and_many_layers_get_the_same_fields(monkeypatch):
    layers, _ = frames()
    few = ts.layers.match_tones(layers, shading=True)
    monkeypatch.setattr("toposeam.layers.exposure.gains._DENSE", 0)  # as of many
    for one, other in zip(few, ts.layers.match_tones(layers, shading=True), strict=True):
        np.testing.assert_allclose(one.image.astype(int), other.image.astype(int), atol=1)
