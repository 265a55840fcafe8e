"""Pictures of unlike depth, channels and profile beside each other."""

import io
from dataclasses import replace

import numpy as np
import pytest
from picture_samples import DEPTHS, GRAY22, OTHER_SRGB, P3, SRGB, fails, gray_profile, sample, smooth
from PIL import Image, ImageCms

from toposeam.errors import ImageError
from toposeam_cli.media.pictures.picture import Picture, match_pictures


def test_gray_is_widened_and_the_deepest_depth_wins():
    pictures = [
        Picture(
            pixels=np.array([[0, 1, 255]], np.uint8),
            alpha=np.array([[0, 128, 255]], np.uint8),
            resolution=(4, 5),
        ),
        Picture(pixels=sample("uint16")),
    ]
    gray, rgb = match_pictures(pictures)
    np.testing.assert_array_equal(
        gray.pixels, np.repeat(np.array([[0, 257, 65535]], np.uint16)[..., None], 3, axis=2)
    )
    np.testing.assert_array_equal(gray.alpha, [[0, 128 * 257, 65535]])
    assert gray.alpha.dtype == np.uint16
    assert gray.resolution == (4, 5)
    np.testing.assert_array_equal(rgb.pixels, sample("uint16"))
    floats = match_pictures([*pictures, Picture(pixels=sample("float32", 1))])
    assert [picture.pixels.dtype for picture in floats] == [np.float32] * 3
    np.testing.assert_allclose(floats[0].pixels[0, :, 0], [0, 1 / 255, 1])
    assert match_pictures([]) == []
    assert match_pictures([Picture(pixels=sample("uint8", 1))])[0].pixels.shape == (11, 17)


def test_profiles_are_converted_to_the_first():
    """A colour inside both gamuts, against Pillow's own conversion."""
    values = smooth()
    first, second = match_pictures([Picture(pixels=values, icc=P3), Picture(pixels=values, icc=SRGB)])
    assert first.icc == second.icc == P3
    np.testing.assert_array_equal(first.pixels, values)
    expected = ImageCms.profileToProfile(
        Image.fromarray(values),
        ImageCms.ImageCmsProfile(io.BytesIO(SRGB)),
        ImageCms.ImageCmsProfile(io.BytesIO(P3)),
        renderingIntent=ImageCms.Intent.RELATIVE_COLORIMETRIC,
        flags=ImageCms.Flags.BLACKPOINTCOMPENSATION,
    )
    np.testing.assert_allclose(
        second.pixels, np.asarray(expected).astype(int), atol=1
    )  # both round to 8 bits
    assert np.abs(second.pixels.astype(int) - values).max() > 5


def test_floats_within_zero_to_one_are_converted_others_refused():
    values = (smooth() / 255).astype(np.float32)
    values[0, 0], values[0, 1] = 0, 1
    converted = match_pictures([Picture(pixels=values, icc=P3), Picture(pixels=values, icc=SRGB)])[1].pixels
    assert converted[0, 0] == pytest.approx(0, abs=1e-4)
    assert converted[0, 1] == pytest.approx(1, abs=1e-4)
    values[0, 0] = -0.01
    with pytest.raises(ImageError, match=r"float pixels from -0.01 to 1 cannot be converted"):
        match_pictures([Picture(pixels=values, icc=P3), Picture(pixels=values, icc=SRGB)])


def test_a_picture_without_profile_counts_as_srgb():
    muted = smooth() // 2 + 64  # inside sRGB's gamut too
    plain, wide = match_pictures([Picture(pixels=smooth()), Picture(pixels=muted, icc=P3)])
    assert plain.icc is None
    assert wide.icc is None
    np.testing.assert_array_equal(plain.pixels, smooth())
    assert np.abs(wide.pixels.astype(int) - muted).max() > 5
    back = match_pictures([Picture(pixels=smooth(), icc=P3), wide])[1]
    np.testing.assert_allclose(back.pixels, muted.astype(int), atol=1)  # rounded to 8 bits twice


@pytest.mark.parametrize("icc", [None, OTHER_SRGB])
@pytest.mark.parametrize("dtype", DEPTHS)
def test_two_spellings_of_srgb_change_no_pixel(dtype, icc):
    _, second = match_pictures(
        [Picture(pixels=sample(dtype), icc=SRGB), Picture(pixels=sample(dtype, seed=1), icc=icc)]
    )
    assert second.icc == SRGB
    np.testing.assert_array_equal(second.pixels, sample(dtype, seed=1))


def test_a_gray_profile_is_applied_on_the_way_to_rgb():
    ramp = np.arange(0, 65536, 257, dtype=np.uint16)[None]
    gray, rgb = match_pictures(
        [Picture(pixels=ramp, icc=gray_profile(1.0)), Picture(pixels=sample("uint8"), icc=OTHER_SRGB)]
    )
    assert gray.icc == rgb.icc == OTHER_SRGB
    assert gray.pixels.dtype == np.uint16
    linear = ramp / 65535
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    # lcms rounds XYZ to 16 bits, which sRGB stretches up to 13 times in the dark.
    np.testing.assert_allclose(
        gray.pixels / 65535, np.repeat(srgb[..., None], 3, axis=2), atol=13 * 2 / 65535
    )


def test_gray_pictures_stay_gray_in_the_first_ones_profile():
    ramp = np.arange(256, dtype=np.uint8)[None]
    for icc, other in ((GRAY22, gray_profile(1.8)), (GRAY22, None), (None, GRAY22)):
        first, second = match_pictures([Picture(pixels=ramp, icc=icc), Picture(pixels=ramp, icc=other)])
        assert first.icc == second.icc == icc
        assert second.pixels.shape == ramp.shape
        np.testing.assert_array_equal(first.pixels, ramp)
        assert second.pixels[0, 0] == 0
        assert second.pixels[0, -1] == 255
        assert (np.diff(second.pixels[0].astype(int)) >= 0).all()
        assert np.abs(second.pixels.astype(int) - ramp).max() > 3


def test_float_pixels_out_of_range_are_not_clipped_in_silence():
    bright = Picture(pixels=sample("float32") * 2, icc=P3)
    assert match_pictures([bright, replace(bright)])[1].pixels.max() > 1
    assert "same profile" in fails(match_pictures, [Picture(pixels=sample("float32")), bright])
    inside = replace(bright, pixels=sample("float32"))
    converted = match_pictures([Picture(pixels=sample("float32")), inside])[1]
    assert converted.pixels.dtype == np.float32
    assert 0 <= converted.pixels.min() < converted.pixels.max() <= 1
