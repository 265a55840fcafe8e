"""The patch that suits a texture: a few of its elements."""

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts


def test_the_patch_is_chosen_by_the_size_of_the_elements(sample):
    fine = sample(15, (192, 192))
    coarse = ndimage.zoom(sample(15, (64, 64)), 3, order=1)
    patches = [ts.synthesize(image, 40, setting="varied").settings["patch"] for image in (fine, coarse)]
    assert 8 <= patches[0] < patches[1] <= 64


def test_the_natural_patch_holds_about_four_elements():
    stripes = np.tile(np.repeat(np.array([0, 255], np.uint8), 6), (240, 20))
    # Along the stripes nothing changes: four elements would be more than a quarter of the sample.
    assert ts.texture.natural_patch(stripes) == 60
    checks = np.kron(np.indices((20, 20)).sum(axis=0) % 2, np.ones((12, 12))).astype(np.uint8) * 255
    # The correlation, 1 - 2 × distance / 12, is below 0.2 from 5 px on: 4 elements of 2 × 5 px.
    assert ts.texture.natural_patch(checks) == 40
    # With checks of 24 px from 10 px on, which no bound meets: at 0.4 it were 8 px, and a patch of 64.
    assert ts.texture.natural_patch(np.kron(checks // 255, np.full((2, 2), 255, np.uint8))) == 80
    masked = np.zeros(checks.shape, bool)
    masked[:100, :100] = True
    assert 24 <= ts.texture.natural_patch(checks, source_mask=masked) <= 96


def test_the_patch_fits_between_holes(sample):
    image, whole = sample(3, (120, 120)), np.ones((120, 120), bool)
    usual = ts.texture.natural_patch(image)
    holed = whole.copy()
    holed[::18] = False
    assert usual > 17
    assert ts.texture.natural_patch(image, source_mask=holed) == 17
    made = ts.synthesize(image, 60, source_mask=holed)
    assert made.settings["patch"] == 17
    assert holed[made.source[..., 0], made.source[..., 1]].all()
    holed[:60] = whole[:60]  # there is one large enough place
    assert ts.texture.natural_patch(image, source_mask=holed) == usual


@pytest.mark.parametrize("shape", [(20, 20), (8, 8), (9, 64), (64, 9)])
def test_small_pictures_are_grown_and_filled_by_fitting_patches(sample, shape):
    image = sample(4, shape)
    assert ts.synthesize(image, 48, tileable=True).image.shape == (48, 48)
    hole = np.zeros(shape, bool)
    hole[shape[0] // 2, shape[1] // 2] = True
    made = ts.fill(image, hole, by="patches")
    assert made.settings["patch"] <= min(shape)
    assert made.labels[hole].item() > 0
