"""The boundary of a joined picture: bent towards a rectangle within bounds, filled, and cropped."""

import dataclasses

import numpy as np
import pytest
from skimage import data

import toposeam as ts
from toposeam.layers.boundary import best_box, fitted_boundary
from toposeam.layers.canvas import FittedTransform, PlaneTransform, largest_full, on_canvas, similarity

GROUND = np.random.default_rng(0).normal(0, 2, (500, 900, 3))


def views(picture, turn=4.0):
    """Two pictures cut out of one, the right one turned, with their transforms."""
    left = PlaneTransform(np.eye(3))
    right = similarity((300.0, 6.0), turn)
    y, x = np.mgrid[0:380, 0:480]
    at = right.to_canvas(np.stack([x, y], axis=-1).astype(float)).round().astype(int)
    inner = picture[np.clip(at[..., 1], 0, len(picture) - 1), np.clip(at[..., 0], 0, picture.shape[1] - 1)]
    layers = [ts.Layer(picture[:380, :480], name="left"), ts.Layer(inner, name="right")]
    return layers, [left, right]


@pytest.fixture(scope="module")
def photograph():
    whole = np.tile(data.coffee(), (2, 2, 1))[:500, :900]
    return np.ascontiguousarray(whole)


@pytest.fixture(scope="module")
def fitted_pair(photograph):
    layers, transforms = views(photograph)
    boundary = fitted_boundary(layers, transforms)
    bent = [FittedTransform(one, boundary) for one in transforms]
    composed = ts.stitch([on_canvas(*item) for item in zip(layers, bent, strict=True)])
    plain = ts.stitch([on_canvas(*item) for item in zip(layers, transforms, strict=True)])
    return boundary, composed, plain


def test_the_best_box_is_that_of_all_boxes():
    values = np.random.default_rng(3).normal(-0.1, 1, (9, 11)).astype(np.float32)
    total = np.zeros((10, 12))
    total[1:, 1:] = values.cumsum(axis=0).cumsum(axis=1)
    best = max(
        total[b, r] - total[t, r] - total[b, c] + total[t, c]
        for t in range(9)
        for b in range(t + 1, 10)
        for c in range(11)
        for r in range(c + 1, 12)
    )
    assert values[best_box(values).slices].sum() == pytest.approx(best, abs=1e-4)
    box = best_box(values, goes_round=True)
    assert (box.left, box.right) == (0, 11)


def test_a_bent_boundary_stretches_and_turns_within_bounds(fitted_pair):
    boundary, _, _ = fitted_pair
    height, width = boundary.size[::-1]
    y, x = np.mgrid[0:height:7, 0:width:7]
    at = np.stack([x, y], axis=-1) + 0.0
    here, right, down = (boundary.to_canvas(at + step) for step in ((0, 0), (1, 0), (0, 1)))
    jacobian = np.stack([right - here, down - here], axis=-1)
    values = np.linalg.svd(jacobian, compute_uv=False)
    assert np.abs(boundary.coefficients).max() > 1
    assert np.percentile(np.abs(np.log(values)), 99) < 0.16
    turn = np.degrees(
        np.arctan2(jacobian[..., 1, 0] - jacobian[..., 0, 1], np.trace(jacobian, axis1=-2, axis2=-1))
    )
    assert np.abs(turn).max() < 3.5


def test_more_is_kept_than_by_the_largest_rectangle(fitted_pair):
    _, composed, plain = fitted_pair
    box = largest_full(plain.alpha == 255)
    fit = ts.layers.fitted(composed)
    assert fit.kept > plain.crop(box).kept + 0.02
    assert fit.alpha is None
    assert 0 <= fit.filled < 0.1
    np.testing.assert_array_equal(np.asarray(fit), fit.window(slice(None), slice(None))[0])


def test_a_transform_and_its_inverse_agree_on_a_bent_canvas(photograph, fitted_pair):
    boundary, _, _ = fitted_pair
    transforms = views(photograph)[1]
    points = np.array([[0.0, 0.0], [479.0, 379.0], [123.4, 300.1], [np.nan, 1.0]])
    for transform in transforms:
        bent = FittedTransform(transform, boundary)
        there = bent.to_canvas(points)
        np.testing.assert_allclose(bent.to_picture(there[:3]), points[:3], atol=0.01)
        assert np.isnan(there[3]).all()


def test_deep_sky_is_filled_and_structure_is_not(photograph):
    sky = (np.array([90.0, 140.0, 210.0]) + GROUND).clip(0, 255).astype(np.uint8)
    kept = []
    for picture in (sky, photograph):
        layers = [
            ts.Layer(picture[:400, :500], at=(0, 0)),
            ts.Layer(picture[30:430, 380:880], at=(380, 30)),
        ]
        fit = ts.layers.fitted(ts.stitch(layers))
        assert fit.alpha is None
        kept.append(fit)
    assert kept[0].kept > 0.98
    assert kept[0].filled > 0.03
    assert kept[1].kept < 0.96
    image = np.asarray(kept[0], float)
    assert np.abs(image[:25, -80:].mean(axis=(0, 1)) - [90, 140, 210]).max() < 3


@pytest.mark.parametrize("kind", ["gray", "16 bit", "float"])
def test_any_kind_of_pixels_is_fitted(photograph, kind):
    pixels = {
        "gray": photograph[..., 1],
        "16 bit": photograph.astype(np.uint16) * 257,
        "float": photograph / 255,
    }
    picture = pixels[kind]
    layers = [ts.Layer(picture[:300, :400]), ts.Layer(picture[9:309, 300:700], at=(300, 9))]
    fit = ts.layers.fitted(ts.stitch(layers))
    assert fit.image.dtype == picture.dtype
    assert fit.alpha is None
    assert fit.kept > 0.9


def test_a_whole_turn_keeps_its_full_width(photograph):
    layers = [
        ts.Layer(np.roll(photograph[:, :800], -start, axis=1)[:300, :500], at=(start, 7 * (number % 2)))
        for number, start in enumerate((0, 400))
    ]
    joined = ts.stitch(layers, wrap=800)
    fit = ts.layers.fitted(joined)
    assert fit.shape[1] == 800
    assert fit.shape[0] >= 292
    boundary = fitted_boundary(layers, [similarity(layer.at) for layer in layers], 800)
    assert boundary is None or not boundary.coefficients[..., 0].any()


def test_what_fills_the_canvas_is_left_as_it_is(photograph):
    layers = [ts.Layer(photograph[:300, :400]), ts.Layer(photograph[:300, 300:700], at=(300, 0))]
    assert fitted_boundary(layers, [similarity(layer.at) for layer in layers]) is None
    joined = ts.stitch(layers)
    fit = ts.layers.fitted(joined)
    assert fit.kept == 1
    assert fit.cropped is None
    assert fit.filled == 0
    np.testing.assert_array_equal(np.asarray(fit), np.asarray(joined))


def test_nothing_opaque_is_left_alone(photograph):
    layer = ts.Layer(photograph[:60, :80], alpha=np.full((60, 80), 9, np.uint8))
    both = [layer, dataclasses.replace(layer, at=(40, 0))]
    assert ts.layers.fitted(ts.stitch(both)).shape == (60, 120)
