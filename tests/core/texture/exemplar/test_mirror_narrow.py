import numpy as np
import pytest
import skimage.data

import toposeam as ts
from toposeam.texture.exemplar import widened

PICTURE = skimage.data.coffee()
ROW = PICTURE[200:201, :120]


@pytest.mark.parametrize("shape", [(1, 120), (120, 1), (3, 70), (2, 3), (1, 9)])
def test_a_sample_of_a_few_rows_grows_in_both_directions(shape):
    sample = PICTURE[200 : 200 + shape[0], : shape[1]]
    made = ts.synthesize(sample, (60, 70), tileable="both")
    assert made.image.shape == (60, 70, 3)
    assert np.ptp(made.image[..., 0].astype(int)) > np.ptp(sample[..., 0].astype(int)) / 3


def test_pixels_of_a_row_go_on_as_stripes():
    made = ts.synthesize(ROW, (60, 70), smooth=0, level=False)
    np.testing.assert_array_equal(made.image, ROW[0, made.source[..., 1]])
    below = made.image[1:] == made.image[:-1]
    assert below.all(axis=2).mean() > 0.8


def test_other_pictures_as_narrow_are_cut_alike():
    other = 255 - ROW
    made = ts.synthesize(ROW, (50, 60), maps=[other], level=False)
    np.testing.assert_array_equal(made.maps[0], made.apply(other, smooth=0))
    np.testing.assert_array_equal(made.maps[0], ts.texture.apply_coordinates(other, made.source, smooth=0))
    np.testing.assert_array_equal(made.image, made.apply(ROW))


def test_what_belongs_to_a_row_is_as_narrow():
    opacity, mask = np.full((1, 120), 255, np.uint8), np.ones((1, 120), bool)
    opacity[:, :10], mask[:, 60:] = 0, False
    made = ts.synthesize(
        [ROW, PICTURE[:50, :50]],
        (40, 50),
        alpha=[opacity, None],
        source_mask=[mask, None],
        guide=np.linspace(0, 1, 2000).reshape(40, 50),
        guide_source=[ROW[..., 0] / 255, PICTURE[:50, :50, 0] / 255],
        turns="quarters",
        patch=20,
    )
    assert made.image.shape == (40, 50, 3)
    assert ts.texture.natural_patch(ROW, alpha=opacity, source_mask=mask) >= 4


def test_wide_pictures_stay_as_they_are():
    picture = np.zeros((4, 5))
    assert widened(picture) is picture
    assert widened("no picture") == "no picture"
    assert widened([picture, None])[0] is picture
