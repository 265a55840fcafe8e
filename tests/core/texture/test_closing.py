from types import SimpleNamespace

import numpy as np
import pytest
import skimage.data
from scipy import ndimage

import toposeam as ts
from toposeam.texture.closing import _mismatch, _sheared, order_axis
from toposeam.texture.mend import _seam_costs


def slanted_stripes(size=128, slope=0.04, pitch=14.3, seed=0):
    """Bright lines that run down and a little to the right, and waver: they never meet their own
    beginning.
    """
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:size, :size]
    waver = ndimage.gaussian_filter(rng.normal(size=(size, size)), 12) * 20
    phase = ((x - slope * y + waver) / pitch) % 1
    lines = np.exp(-np.square((phase - 0.5) / 0.12))
    return np.clip(60 + 150 * lines + rng.normal(size=lines.shape) * 4, 0, 255).astype(np.uint8)


def features(image):
    return (image / np.float32(255)).astype(np.float32)[..., np.newaxis]


def test_order_is_found_along_the_lines_and_none_in_noise(sample):
    image = slanted_stripes()
    everywhere = np.ones(image.shape, bool)
    assert order_axis(features(image), everywhere) == 0
    assert order_axis(features(image.T), everywhere) == 1
    assert order_axis(features(sample(0, (128, 128))), everywhere) is None


@pytest.mark.parametrize(("wraps", "pitch"), [(True, 16), (False, 16.7)])
def test_lines_that_are_out_of_step_are_sheared_until_they_close(wraps, pitch):
    y, x = np.mgrid[: 192 + 2 * 32, :160]
    # Over 192 rows the lines move by 8 to 12 px, at each column differently.
    drift = 8 + 2 * (1 - np.cos(2 * np.pi * x / 160))
    grown = np.exp(-np.square((((x - drift * y / 192) / pitch) % 1 - 0.5) / 0.15)).astype(np.float32)[
        ..., np.newaxis
    ]
    closed = _sheared(grown, 192, 32, wraps)

    def step(plane):
        columns = slice(None) if wraps else slice(20, -20)
        return np.abs(plane[-1, columns] - plane[0, columns]).mean()

    assert closed.shape == (192, 160, 1)
    assert step(grown[16 : 16 + 192]) > 0.3
    assert step(closed) < 0.08


@pytest.mark.slow
def test_bricks_that_repeat_are_broken_less_often_with_a_plan():
    image = skimage.data.brick()[:192, :192]
    rare = np.percentile(np.abs(np.diff(image.astype(float), axis=0)), 99.5)

    def cuts(close):
        """Lines that end at a seam near the border, by steps along them that are rare inside the sample."""
        made = [
            ts.synthesize(image, 400, patch=40, seed=seed, tileable=True, close=close) for seed in range(2)
        ]
        rows = [np.roll(one.image.astype(float), 60, axis=0)[:120] for one in made]
        return sum((np.abs(np.diff(part, axis=0)) > rare).sum() for part in rows)

    assert cuts(True) < cuts(False)


@pytest.mark.medium
def test_mending_makes_the_seams_better():
    image = skimage.data.brick()[:128, :128]

    def total(share):
        made = ts.synthesize(image, 150, patch=32, seed=1, mend=share)
        laid = SimpleNamespace(
            guard=None,
            atlas=made.atlas,
            features=made.atlas.spread([image[..., np.newaxis] / np.float32(255)]),
        )
        return _seam_costs(laid, made.atlas.index_of(made.exemplar, made.source)).sum(), made.count

    (before, patches), (after, more) = total(0), total(1.0)
    assert after < 0.95 * before
    assert more > patches


def test_coordinates_alone_cut_other_pictures_alike(sample):
    first, second = sample(2), sample(3)
    made = ts.synthesize([first, second], 90, patch=32, tileable=True)
    again = ts.apply_coordinates([first, second], made.source, made.exemplar, tileable=True)
    np.testing.assert_array_equal(again, made.image)
    with pytest.raises(ts.ImageError, match="point beyond"):
        ts.apply_coordinates([first, second[:20]], made.source, made.exemplar)
    with pytest.raises(ts.ImageError, match="row and column"):
        ts.apply_coordinates(first, made.source[..., 0])


@pytest.mark.parametrize("shift", [3, 5, -3, -5])
def test_what_a_shift_brings_from_beyond_an_open_side_counts_as_the_rest_does(shift):
    """One row of twelve columns; where the shifted end has no column of its own the mean stands."""
    beginning, end = np.zeros((1, 12, 1), np.float32), np.arange(12, dtype=np.float32).reshape(1, 12, 1)
    square = np.roll(np.arange(12.0), -shift) ** 2
    square[range(12 - shift, 12) if shift > 0 else range(-shift)] = square.mean()
    np.testing.assert_allclose(_mismatch(beginning, end, shift, 1, "nearest"), square[::4])
