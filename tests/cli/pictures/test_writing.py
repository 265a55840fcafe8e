"""What goes out, as other programs read it."""

import numpy as np
import pytest
import tifffile
from picture_samples import DEPTHS, GRAY22, P3, SRGB, fails, names, sample, smooth, stored
from PIL import Image

from toposeam_cli.files.writing import PICTURE_SUFFIXES
from toposeam_cli.media.pictures import picture as picture_module
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture


@pytest.mark.parametrize(("n_channels", "has_alpha"), [(1, False), (1, True), (3, False), (3, True)])
@pytest.mark.parametrize(
    ("dtype", "suffix"),
    [("uint8", ".png"), ("uint8", ".tif"), ("uint16", ".tiff"), ("float32", ".tif"), ("uint8", ".webp")],
)
def test_other_programs_find_the_same_values(tmp_path, dtype, suffix, n_channels, has_alpha):
    pixels, alpha = sample(dtype, n_channels), sample(dtype, 1, seed=1) if has_alpha else None
    if dtype == "float32":
        pixels = pixels * 3 - 1
    write_picture(tmp_path / f"out{suffix}", Picture(pixels=pixels, alpha=alpha))
    expected = np.atleast_3d(pixels)
    if suffix == ".webp" and n_channels == 1:
        expected = np.repeat(expected, 3, axis=2)
    if has_alpha:
        expected = np.dstack([expected, alpha])
    found = np.atleast_3d(stored(tmp_path / f"out{suffix}"))
    assert found.dtype == dtype
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    ("n_channels", "has_alpha", "colour_type"), [(1, False, 0), (1, True, 4), (3, False, 2), (3, True, 6)]
)
def test_sixteen_bit_png_stays_sixteen_bit(tmp_path, n_channels, has_alpha, colour_type):
    pixels, alpha = sample("uint16", n_channels), sample("uint16", 1, seed=1) if has_alpha else None
    write_picture(tmp_path / "out.png", Picture(pixels=pixels, alpha=alpha))
    header = (tmp_path / "out.png").read_bytes()[24:26]
    assert tuple(header) == (16, colour_type)
    back = read_picture(tmp_path / "out.png")
    np.testing.assert_array_equal(back.pixels, pixels)
    if has_alpha:
        np.testing.assert_array_equal(back.alpha, alpha)
    if (n_channels, has_alpha) == (1, False):  # the one 16-bit PNG Pillow reads in full
        np.testing.assert_array_equal(stored(tmp_path / "out.png"), pixels)


def test_tiff_is_compressed_and_alpha_is_not_multiplied_in(tmp_path):
    write_picture(
        tmp_path / "out.tif", Picture(pixels=smooth(400, 600), alpha=np.full((400, 600), 128, np.uint8))
    )
    assert (tmp_path / "out.tif").stat().st_size < 400 * 600 * 4 / 10
    with tifffile.TiffFile(tmp_path / "out.tif") as file:
        page = file.pages[0]
        assert not file.is_bigtiff
        assert page.compression == tifffile.COMPRESSION.ADOBE_DEFLATE
        assert page.extrasamples == (tifffile.EXTRASAMPLE.UNASSALPHA,)


def test_tiff_beyond_four_gigabytes_is_bigtiff(tmp_path, monkeypatch):
    monkeypatch.setattr(picture_module, "_BIGTIFF_BYTES", 500)
    write_picture(tmp_path / "out.tif", Picture(pixels=sample("uint8")))
    with tifffile.TiffFile(tmp_path / "out.tif") as file:
        assert file.is_bigtiff
    np.testing.assert_array_equal(read_picture(tmp_path / "out.tif").pixels, sample("uint8"))


def test_the_colour_under_transparent_pixels_survives(tmp_path):
    for suffix in (".png", ".tif", ".webp"):
        write_picture(
            tmp_path / f"out{suffix}", Picture(pixels=sample("uint8"), alpha=np.zeros((11, 17), np.uint8))
        )
        np.testing.assert_array_equal(read_picture(tmp_path / f"out{suffix}").pixels, sample("uint8"))


def test_jpeg_is_near_lossless_without_colour_subsampling(tmp_path):
    write_picture(tmp_path / "out.jpg", Picture(pixels=smooth()))
    with Image.open(tmp_path / "out.jpg") as image:
        assert [layer[1:3] for layer in image.layer] == [(1, 1)] * 3
        assert np.abs(np.asarray(image).astype(int) - smooth()).max() <= 4
    write_picture(tmp_path / "gray.jpg", Picture(pixels=smooth()[..., 0]))
    with Image.open(tmp_path / "gray.jpg") as image:
        assert image.mode == "L"


def test_a_large_jpeg_decodes_alike_with_standard_huffman_codes(tmp_path, monkeypatch):
    picture = Picture(pixels=smooth())
    write_picture(tmp_path / "small.jpg", picture)
    monkeypatch.setattr(picture_module, "_CODED_PIXELS", smooth()[..., 0].size - 1)
    write_picture(tmp_path / "large.jpg", picture)
    small, large = (tmp_path / f"{name}.jpg" for name in ("small", "large"))
    np.testing.assert_array_equal(read_picture(small).pixels, read_picture(large).pixels)
    assert small.stat().st_size < large.stat().st_size


@pytest.mark.parametrize("dtype", DEPTHS)
def test_jpeg_drops_full_alpha_and_refuses_any_other(tmp_path, dtype):
    alpha = np.full((11, 17), DEPTHS[dtype], dtype)
    write_picture(tmp_path / "out.jpg", Picture(pixels=sample(dtype), alpha=alpha))
    assert stored(tmp_path / "out.jpg").shape == (11, 17, 3)
    alpha[5, 5] *= 0.99
    text = fails(write_picture, tmp_path / "clear.jpg", Picture(pixels=sample(dtype), alpha=alpha))
    assert ".png or .tif" in text
    assert names(tmp_path) == ["out.jpg"]


def test_deep_pictures_are_rounded_where_the_format_is_shallow(tmp_path):
    levels = np.array([[0, 127, 128, 129, 256, 257, 385, 386, 65406, 65407, 65535]], np.uint16)
    write_picture(tmp_path / "out.webp", Picture(pixels=levels))
    np.testing.assert_array_equal(stored(tmp_path / "out.webp")[..., 0], np.rint(levels / 257))
    floats = np.array([[-0.5, 0, 0.25, 0.5, 1, 1.5]], np.float32)
    write_picture(tmp_path / "out.png", Picture(pixels=floats))
    np.testing.assert_array_equal(stored(tmp_path / "out.png"), [[0, 0, 16384, 32768, 65535, 65535]])
    write_picture(tmp_path / "eight.webp", Picture(pixels=floats, alpha=np.clip(floats, 0, 1)))
    np.testing.assert_array_equal(stored(tmp_path / "eight.webp")[0, :, 0], [0, 0, 64, 128, 255, 255])
    np.testing.assert_array_equal(stored(tmp_path / "eight.webp")[0, :, 3], [0, 0, 64, 128, 255, 255])


@pytest.mark.parametrize("suffix", PICTURE_SUFFIXES)
@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (2, 3)])
def test_odd_sizes(tmp_path, suffix, size):
    for n_channels in (1, 3):
        pixels = np.full(size if n_channels == 1 else (*size, 3), 77, np.uint8)
        write_picture(tmp_path / f"out{n_channels}{suffix}", Picture(pixels=pixels))
        back = read_picture(tmp_path / f"out{n_channels}{suffix}")
        assert back.pixels.shape[:2] == size
        assert np.abs(back.pixels.astype(int) - 77).max() <= 1


@pytest.mark.parametrize("suffix", PICTURE_SUFFIXES)
@pytest.mark.parametrize("icc", [SRGB, P3, None])
def test_profile_is_kept_byte_for_byte(tmp_path, suffix, icc):
    Image.fromarray(smooth()).save(tmp_path / f"in{suffix}", **({"icc_profile": icc} if icc else {}))
    write_picture(tmp_path / f"out{suffix}", read_picture(tmp_path / f"in{suffix}"))
    with Image.open(tmp_path / f"out{suffix}") as image:
        assert image.info.get("icc_profile") == icc
    assert read_picture(tmp_path / f"out{suffix}").icc == icc


@pytest.mark.parametrize("suffix", [".png", ".tif", ".jpg"])
def test_gray_profile_is_kept_byte_for_byte(tmp_path, suffix):
    Image.fromarray(smooth()[..., 0]).save(tmp_path / f"in{suffix}", icc_profile=GRAY22)
    write_picture(tmp_path / f"out{suffix}", read_picture(tmp_path / f"in{suffix}"))
    with Image.open(tmp_path / f"out{suffix}") as image:
        assert image.info["icc_profile"] == GRAY22


def test_gray_profile_is_applied_where_the_format_has_no_gray(tmp_path):
    ramp = np.arange(256, dtype=np.uint8)[None]
    write_picture(tmp_path / "out.webp", Picture(pixels=ramp, icc=GRAY22))
    with Image.open(tmp_path / "out.webp") as image:
        assert "icc_profile" not in image.info
    linear = (ramp / 255) ** 2.2
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    # Black is moved onto black, one step at most; 8 bits round.
    np.testing.assert_allclose(stored(tmp_path / "out.webp")[..., 1], 255 * srgb, atol=1.5)


def test_bright_float_gray_with_profile_is_clipped_not_refused(tmp_path):
    write_picture(tmp_path / "out.webp", Picture(pixels=np.array([[-1, 0, 1, 9]], np.float32), icc=GRAY22))
    np.testing.assert_array_equal(stored(tmp_path / "out.webp")[0, :, 0], [0, 0, 255, 255])


def test_a_profile_that_does_not_fit_the_channels_is_ignored(tmp_path):
    for icc in (SRGB, b"garbage" * 40, b""):
        Image.fromarray(smooth()[..., 0]).save(tmp_path / "in.tif", icc_profile=icc)
        assert read_picture(tmp_path / "in.tif").icc is None
        write_picture(tmp_path / "out.png", Picture(pixels=smooth()[..., 0], icc=icc), force=True)
        assert read_picture(tmp_path / "out.png").icc is None


@pytest.mark.parametrize("suffix", PICTURE_SUFFIXES)
@pytest.mark.parametrize("dpi", [(300, 300), (600, 300), (72, 72), (25.4, 25.4), None])
def test_resolution_is_kept(tmp_path, suffix, dpi):
    resolution = dpi and (dpi[0] / 25.4, dpi[1] / 25.4)
    write_picture(tmp_path / f"out{suffix}", Picture(pixels=smooth(), resolution=resolution))
    back = read_picture(tmp_path / f"out{suffix}").resolution
    assert back == (pytest.approx(resolution, rel=1e-3) if dpi not in (None, (72, 72)) else None)
    with Image.open(tmp_path / f"out{suffix}") as image:
        if dpi != (600, 300) and suffix != ".webp":  # Pillow reads one number for JPEG, none for WebP
            assert image.info["dpi"] == pytest.approx(dpi or (72, 72), abs=0.05)


def test_a_resolution_in_exif_alone_is_read(tmp_path):
    exif = Image.Exif()
    exif.update({0x011A: 118.0, 0x011B: 59.0, 0x0128: 3})  # per cm
    Image.fromarray(smooth()).save(tmp_path / "in.webp", exif=exif)
    assert read_picture(tmp_path / "in.webp").resolution == pytest.approx((11.8, 5.9), rel=1e-3)
