"""What comes in: every depth, mode, profile and orientation, as other programs write them."""

import os

import numpy as np
import pytest
import pyvips
import tifffile
from picture_samples import DEPTHS, fails, names, sample, smooth
from PIL import Image, ImageOps

import toposeam as ts
from toposeam.errors import ImageError
from toposeam_cli.media.pictures.masks import read_white
from toposeam_cli.media.pictures.picture import Picture, read_picture, read_strips, write_picture

CMYK = pyvips.Image.profile_load("cmyk")


@pytest.mark.parametrize(
    ("mode", "n_channels", "has_alpha"),
    [("L", 1, False), ("LA", 1, True), ("RGB", 3, False), ("RGBA", 3, True)],
)
@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_eight_bit_files_from_pillow(tmp_path, suffix, mode, n_channels, has_alpha):
    values = sample("uint8", n_channels + has_alpha)
    Image.fromarray(values, mode).save(tmp_path / f"in{suffix}")
    read = read_picture(tmp_path / f"in{suffix}")
    assert read.source == tmp_path / f"in{suffix}"
    assert read.icc is None
    assert read.resolution is None
    expected = values[..., :n_channels] if n_channels == 3 else values.reshape(11, 17, -1)[..., 0]
    np.testing.assert_array_equal(read.pixels, expected)
    if has_alpha:
        np.testing.assert_array_equal(read.alpha, values[..., -1])
        np.testing.assert_array_equal(read.covered(), values[..., -1] > 0)
    else:
        assert read.alpha is None
        assert read.covered().all()
        assert read.covered().shape == (11, 17)


@pytest.mark.parametrize("dtype", DEPTHS)
@pytest.mark.parametrize(("n_channels", "has_alpha"), [(1, False), (1, True), (3, False), (3, True)])
def test_tiff_files_from_tifffile(tmp_path, dtype, n_channels, has_alpha):
    values = sample(dtype, n_channels + has_alpha)
    tifffile.imwrite(
        tmp_path / "in.tif",
        values,
        photometric="rgb" if n_channels == 3 else "minisblack",
        planarconfig="contig" if values.ndim == 3 else None,
        extrasamples=["unassalpha"] if has_alpha else None,
    )
    read = read_picture(tmp_path / "in.tif")
    assert read.pixels.dtype == dtype
    np.testing.assert_array_equal(
        read.pixels, values[..., :3] if n_channels == 3 else values.reshape(11, 17, -1)[..., 0]
    )
    assert (read.alpha is not None) == has_alpha
    if has_alpha:
        np.testing.assert_array_equal(read.alpha, values[..., -1])


def test_sixteen_bit_rgb_png_keeps_every_bit(tmp_path):
    values = sample("uint16")
    pyvips.Image.new_from_array(values).copy(interpretation="rgb16").pngsave(str(tmp_path / "in.png"))
    np.testing.assert_array_equal(read_picture(tmp_path / "in.png").pixels, values)


def test_arrays_are_writable_and_contiguous(tmp_path):
    Image.fromarray(sample("uint8", 4), "RGBA").save(tmp_path / "in.png")
    read = read_picture(tmp_path / "in.png")
    for values in (read.pixels, read.alpha):
        assert values.flags.writeable
        assert values.flags.c_contiguous


def test_palette_with_transparency_is_expanded(tmp_path):
    image = Image.fromarray(np.array([[0, 1], [2, 1]], np.uint8), "P")
    image.putpalette([10, 20, 30, 40, 50, 60, 70, 80, 90])
    image.save(tmp_path / "in.png", transparency=1)
    read = read_picture(tmp_path / "in.png")
    np.testing.assert_array_equal(read.pixels, [[[10, 20, 30], [40, 50, 60]], [[70, 80, 90], [40, 50, 60]]])
    np.testing.assert_array_equal(read.alpha, [[255, 0], [255, 0]])


@pytest.mark.parametrize(
    ("name", "options"), [("in.png", {}), ("in.tif", {}), ("in.tif", {"compression": "group4"})]
)
def test_single_bits_become_black_and_white(tmp_path, name, options):
    bits = sample("uint8", 1) > 127
    Image.fromarray(bits).save(tmp_path / name, **options)
    np.testing.assert_array_equal(read_picture(tmp_path / name).pixels, np.where(bits, 255, 0))


def test_white_is_zero_tiff_is_not_inverted(tmp_path):
    values = sample("uint8", 1)
    tifffile.imwrite(tmp_path / "in.tif", 255 - values, photometric="miniswhite")
    np.testing.assert_array_equal(read_picture(tmp_path / "in.tif").pixels, values)


def test_the_first_frame_is_read_instead_of_previews(tmp_path):
    pages = np.stack([np.full((4, 5), level, np.uint8) for level in (50, 100, 150)])
    with tifffile.TiffWriter(tmp_path / "in.tif") as file:
        for page in (pages[0], pages[1, ::2, ::2]):
            file.write(page, photometric="minisblack")
    frames = [Image.fromarray(page) for page in pages]
    frames[0].save(tmp_path / "in.gif", save_all=True, append_images=frames[1:])
    frames[0].save(tmp_path / "in.webp", save_all=True, append_images=frames[1:], lossless=True)
    for name in ("in.tif", "in.gif", "in.webp"):
        read = read_picture(tmp_path / name)
        assert read.pixels.shape[:2] == (4, 5), name
        assert (read.pixels == 50).all(), name


def test_pages_are_refused_also_a_few_rows_after_the_other(tmp_path):
    pages = np.stack([np.full((4, 5), level, np.uint8) for level in (50, 100, 150)])
    tifffile.imwrite(tmp_path / "in.tif", pages, photometric="minisblack")
    with pytest.raises(ImageError, match="holds 3 pages; save the one that is meant"):
        read_picture(tmp_path / "in.tif")
    with pytest.raises(ImageError, match="holds 3 pages"):
        list(read_strips(tmp_path / "in.tif"))


@pytest.mark.parametrize("suffix", [".jpg", ".tif"])
@pytest.mark.parametrize("icc", [None, CMYK])
def test_cmyk_becomes_srgb(tmp_path, suffix, icc):
    Image.new("CMYK", (8, 8), (0, 255, 255, 0)).save(
        tmp_path / f"in{suffix}", **({"icc_profile": icc} if icc else {})
    )
    read = read_picture(tmp_path / f"in{suffix}")
    assert read.pixels.dtype == np.uint8
    assert read.pixels.shape == (8, 8, 3)
    assert read.alpha is None
    assert read.icc is not None
    assert read.icc[16:20] == b"RGB "
    red, green, blue = read.pixels[4, 4].astype(
        int
    )  # full magenta and yellow print as a red, not as pure [255, 0, 0]
    assert red > 200
    assert green < 80
    assert blue < 80


def test_sixteen_bit_cmyk_with_alpha(tmp_path):
    values = np.zeros((6, 7, 5), np.uint16)
    values[..., 4] = np.arange(7) * 10_000
    tifffile.imwrite(
        tmp_path / "in.tif",
        values,
        photometric="separated",
        planarconfig="contig",
        extrasamples=["unassalpha"],
    )
    read = read_picture(tmp_path / "in.tif")
    assert read.pixels.dtype == np.uint16
    assert (read.pixels > 64_000).all()
    np.testing.assert_array_equal(read.alpha, values[..., 4])


def test_lab_becomes_srgb(tmp_path):
    lab = pyvips.Image.new_from_array(np.full((4, 4, 3), (50.0, 0.0, 0.0), np.float32)).copy(
        interpretation="lab"
    )
    lab.colourspace("labs").tiffsave(str(tmp_path / "in.tif"))
    read = read_picture(tmp_path / "in.tif")
    assert read.pixels.dtype == np.uint16
    # L* = 50 is 18.4 % of white's luminance, which sRGB encodes as 0.466; libvips passes through a table.
    np.testing.assert_allclose(read.pixels / 65535, 0.466, atol=0.006)
    Image.new("LAB", (4, 4)).save(tmp_path / "eight.tif")  # 8-bit LAB is refused by libvips 8.18
    assert "export it again" in fails(read_picture, tmp_path / "eight.tif")


@pytest.mark.parametrize(
    ("dtype", "full"), [("uint32", 2**32 - 1), ("int32", 2**31 - 1), ("int16", 2**15 - 1), ("int8", 127)]
)
def test_unusual_integers_become_floats_of_their_full_scale(tmp_path, dtype, full):
    values = np.array([[0, full // 2, full], [1, 2, 3]], dtype)
    if np.dtype(dtype).kind == "i":
        values[1] *= -1
    tifffile.imwrite(tmp_path / "in.tif", values, photometric="minisblack")
    read = read_picture(tmp_path / "in.tif")
    assert read.pixels.dtype == np.float32
    np.testing.assert_allclose(read.pixels, values / full, rtol=1e-6)


def test_half_floats_become_floats(tmp_path):
    values = sample("float32").astype(np.float16)
    tifffile.imwrite(tmp_path / "in.tif", values, photometric="rgb")
    np.testing.assert_array_equal(read_picture(tmp_path / "in.tif").pixels, values.astype(np.float32))


def test_floats_outside_zero_to_one_are_read_but_not_nan(tmp_path):
    values = sample("float32") * 8 - 4
    tifffile.imwrite(tmp_path / "in.tif", values, photometric="rgb")
    np.testing.assert_array_equal(read_picture(tmp_path / "in.tif").pixels, values)
    for bad in (np.nan, np.inf, -np.inf):
        values[3, 4, 1] = bad
        tifffile.imwrite(tmp_path / "bad.tif", values, photometric="rgb")
        assert "NaN or infinite" in fails(read_picture, tmp_path / "bad.tif")


def test_opacities_outside_zero_to_one_are_its_ends(tmp_path):
    values = sample("float32", 4)
    values[..., 3] = np.linspace(-1, 3, values[..., 3].size, dtype=np.float32).reshape(values.shape[:2])
    tifffile.imwrite(tmp_path / "in.tif", values, photometric="rgb", extrasamples=["unassalpha"])
    read = read_picture(tmp_path / "in.tif")
    np.testing.assert_array_equal(read.alpha, np.clip(values[..., 3], 0, 1))
    np.testing.assert_array_equal(read.pixels, values[..., :3])


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif", ".webp"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientation_is_applied_once(tmp_path, suffix, orientation):
    values = smooth()
    exif = Image.Exif()
    exif[0x0112] = orientation
    path = tmp_path / f"in{suffix}"
    options = {".jpg": {"quality": 95}, ".webp": {"lossless": True}}.get(suffix, {})
    Image.fromarray(values).save(path, exif=exif, dpi=(300, 150), **options)
    with Image.open(path) as image:
        expected = np.asarray(ImageOps.exif_transpose(image))
    read = read_picture(path)
    assert read.pixels.shape == expected.shape
    # JPEG decoders differ by rounding and in how they enlarge the colour channels.
    np.testing.assert_allclose(read.pixels, expected.astype(int), atol=6 if suffix == ".jpg" else 0)
    if suffix != ".webp":  # Pillow writes no resolution there
        assert read.resolution == pytest.approx(
            (150 / 25.4, 300 / 25.4) if orientation > 4 else (300 / 25.4, 150 / 25.4), rel=1e-3
        )
    write_picture(tmp_path / "out.png", read)
    with Image.open(tmp_path / "out.png") as image:
        assert image.getexif().get(0x0112, 1) == 1
        np.testing.assert_array_equal(np.asarray(image), read.pixels)


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
@pytest.mark.parametrize(
    ("dpi", "expected"), [((300, 300), (300, 300)), ((118, 59), (118, 59)), (None, None)]
)
def test_resolution_is_read_in_pixels_per_mm(tmp_path, suffix, dpi, expected):
    Image.fromarray(smooth()).save(tmp_path / f"in{suffix}", **({"dpi": dpi} if dpi else {}))
    read = read_picture(tmp_path / f"in{suffix}")
    assert read.resolution == (
        pytest.approx(tuple(value / 25.4 for value in expected), rel=1e-3) if expected else None
    )


@pytest.mark.parametrize("name", ["50% [1].png", "a[page=1].png", "été 日本.png", b"latin-\xe9.png", "-.png"])
def test_any_file_name_is_just_a_name(tmp_path, name):
    path = tmp_path / os.fsdecode(name)
    write_picture(path, Picture(pixels=smooth()))
    np.testing.assert_array_equal(read_picture(path).pixels, smooth())
    assert len(names(tmp_path)) == 1


def test_the_content_counts_not_the_extension(tmp_path):
    Image.fromarray(smooth()).save(tmp_path / "really.png")
    (tmp_path / "really.png").rename(tmp_path / "in.jpg")
    np.testing.assert_array_equal(read_picture(tmp_path / "in.jpg").pixels, smooth())


def test_a_file_that_changed_is_read_anew(tmp_path):
    for level in (10, 200):
        write_picture(tmp_path / "in.png", Picture(pixels=np.full((3, 3), level, np.uint8)), force=True)
        assert (read_picture(tmp_path / "in.png").pixels == level).all()


def test_a_mask_is_white_from_half_scale_on_where_it_is_opaque(tmp_path):
    path = tmp_path / "mask.png"
    write_picture(path, Picture(pixels=np.array([[0, 127, 128, 255]], np.uint8)))
    assert read_white(path, (1, 4), "a.png", 100).tolist() == [[False, False, True, True]]
    write_picture(path, Picture(pixels=np.array([[32767, 32768]], np.uint16)), force=True)
    assert read_white(path, (1, 2), "a.png", 100).tolist() == [[False, True]]
    floats = tmp_path / "mask.tif"
    write_picture(floats, Picture(pixels=np.array([[0.49, 0.5]], np.float32)))
    assert read_white(floats, (1, 2), "a.png", 100).tolist() == [[False, True]]
    # Colours count by the mean of their channels: 382 of 3 × 255 is less than half, 383 is more.
    colours = np.array([[[255, 127, 0], [255, 128, 0]]], np.uint8)
    write_picture(path, Picture(pixels=colours), force=True)
    assert read_white(path, (1, 2), "a.png", 100).tolist() == [[False, True]]
    pixels, alpha = np.full((1, 2), 255, np.uint8), np.array([[0, 255]], np.uint8)
    write_picture(path, Picture(pixels=pixels, alpha=alpha), force=True)
    assert read_white(path, (1, 2), "a.png", 100).tolist() == [[False, True]]
    with pytest.raises(ts.ImageError, match=r"the mask mask\.png is 2 × 1 px, but a\.png is 1 × 2 px"):
        read_white(path, (2, 1), "a.png", 100)
