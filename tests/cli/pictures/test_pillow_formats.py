"""Formats that libvips does not know are read by Pillow, and then treated like all others."""

import io
import sys

import numpy as np
import pytest
from picture_samples import fails, sample, smooth
from PIL import Image, ImageCms

from toposeam_cli.media.pictures import pillow_formats
from toposeam_cli.media.pictures.decode import size_of
from toposeam_cli.media.pictures.picture import read_picture, write_picture

COLOUR, GRAY, DEEP = sample("uint8", 3, (30, 44)), sample("uint8", 1, (30, 44)), sample("uint16", 1, (30, 44))


def turned(orientation):
    exif = Image.Exif()
    exif[0x0112], exif[0x010F] = orientation, "A camera"
    return exif.tobytes()


@pytest.mark.parametrize("suffix", ["bmp", "jp2"])
@pytest.mark.parametrize("values", [COLOUR, GRAY], ids=["colour", "gray"])
def test_pixels_come_as_they_were_stored(tmp_path, suffix, values):
    Image.fromarray(values).save(tmp_path / f"in.{suffix}")
    picture = read_picture(tmp_path / f"in.{suffix}")
    np.testing.assert_array_equal(picture.pixels, values)
    assert (picture.pixels.dtype, picture.alpha, picture.icc) == (np.uint8, None, None)
    assert size_of(tmp_path / f"in.{suffix}") == (44, 30)


def test_sixteen_bits_and_opacity_survive(tmp_path):
    Image.fromarray(DEEP).save(tmp_path / "deep.jp2")
    np.testing.assert_array_equal(read_picture(tmp_path / "deep.jp2").pixels, DEEP)
    Image.fromarray(np.dstack([COLOUR, GRAY])).save(tmp_path / "alpha.jp2")
    picture = read_picture(tmp_path / "alpha.jp2")
    np.testing.assert_array_equal(picture.pixels, COLOUR)
    np.testing.assert_array_equal(picture.alpha, GRAY)


def test_palettes_and_single_bits_become_colours_and_gray(tmp_path):
    Image.fromarray(COLOUR).convert("P").save(tmp_path / "palette.bmp")
    assert read_picture(tmp_path / "palette.bmp").pixels.shape == (30, 44, 3)
    Image.fromarray(GRAY > 99).save(tmp_path / "bits.bmp")
    np.testing.assert_array_equal(read_picture(tmp_path / "bits.bmp").pixels, (GRAY > 99) * np.uint8(255))


def test_the_resolution_of_a_bmp_is_kept_and_none_made_up(tmp_path):
    Image.fromarray(COLOUR).save(tmp_path / "in.bmp", dpi=(300, 300))
    assert read_picture(tmp_path / "in.bmp").resolution == pytest.approx((11.811, 11.811), rel=1e-4)
    Image.fromarray(COLOUR).save(tmp_path / "in.jp2")
    assert read_picture(tmp_path / "in.jp2").resolution is None


def test_profile_orientation_and_metadata_go_on(tmp_path):
    """AVIF has all of them; here Pillow reads it."""
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    Image.fromarray(COLOUR).save(
        tmp_path / "in.avif", quality=100, subsampling="4:4:4", icc_profile=profile, exif=turned(6)
    )
    expected = read_picture(tmp_path / "in.avif")
    content = pillow_formats.as_png(tmp_path / "in.avif", lambda width, height: None)
    (tmp_path / "as.png").write_bytes(content)
    picture = read_picture(tmp_path / "as.png")
    assert np.abs(picture.pixels.astype(int) - expected.pixels).max() <= 2
    assert picture.icc == expected.icc == profile
    assert b"A camera" in picture.exif
    assert picture.pixels.shape == (44, 30, 3)


@pytest.mark.parametrize("suffix", ["bmp", "jp2"])
@pytest.mark.parametrize("kept", [0.1, 0.5, 0.9])
def test_what_is_cut_short_is_refused(tmp_path, suffix, kept):
    file = io.BytesIO()
    Image.fromarray(COLOUR).save(file, "BMP" if suffix == "bmp" else "JPEG2000")
    (tmp_path / f"in.{suffix}").write_bytes(file.getvalue()[: int(kept * len(file.getvalue()))])
    assert "export it again" in fails(read_picture, tmp_path / f"in.{suffix}")


def test_what_is_too_large_is_refused_before_it_is_decoded(tmp_path, monkeypatch):
    Image.fromarray(COLOUR).save(tmp_path / "in.bmp")
    monkeypatch.setattr(pillow_formats, "_values", None)  # not called
    assert "raise --max-megapixels" in fails(read_picture, tmp_path / "in.bmp", max_pixels=1000)


def test_what_pillow_knows_besides_is_not_tried(tmp_path):
    Image.fromarray(COLOUR).save(tmp_path / "in.tga")
    Image.fromarray(COLOUR).save(tmp_path / "in.ppm")
    for name in ("in.tga", "in.ppm"):
        assert "none of PNG, TIFF" in fails(read_picture, tmp_path / name)


def test_without_pi_heif_the_sentence_names_it(tmp_path, monkeypatch):
    for name in ("pi_heif", "pillow_heif"):
        monkeypatch.setitem(sys.modules, name, None)
    (tmp_path / "in.heic").write_bytes(b"\0\0\0\x18ftypheic\0\0\0\0mif1heic" + bytes(40))
    assert "pip install pi-heif" in fails(read_picture, tmp_path / "in.heic")


@pytest.mark.parametrize("alpha", [False, True])
def test_heic_is_read_upright_by_pillow_heif(tmp_path, alpha):
    pillow_heif = pytest.importorskip("pillow_heif")
    colour = smooth(30, 44)
    values = np.dstack([colour, GRAY]) if alpha else colour
    made = pillow_heif.from_bytes("RGBA" if alpha else "RGB", (44, 30), values.tobytes())
    made.save(tmp_path / "in.heic", quality=-1, chroma=444, exif=turned(6))
    picture = read_picture(tmp_path / "in.heic")
    assert picture.pixels.shape == (44, 30, 3)
    assert np.abs(picture.pixels.astype(int) - np.rot90(colour, -1)).max() <= 3
    assert (picture.alpha is not None) == alpha
    assert b"A camera" in picture.exif
    assert size_of(tmp_path / "in.heic") == (30, 44)
    write_picture(tmp_path / "out.png", picture)
    assert read_picture(tmp_path / "out.png").pixels.shape == (44, 30, 3)


def test_heic_of_ten_bits_keeps_them(tmp_path):
    pillow_heif = pytest.importorskip("pillow_heif")
    values = smooth(30, 44).astype(np.uint16) * np.uint16(257)
    made = pillow_heif.from_bytes("RGB;16", (44, 30), values.tobytes())
    made.save(tmp_path / "in.heic", quality=-1, chroma=444)
    picture = read_picture(tmp_path / "in.heic")
    assert picture.pixels.dtype == np.uint16
    assert np.abs(picture.pixels.astype(int) - values).max() <= 5 * 64
