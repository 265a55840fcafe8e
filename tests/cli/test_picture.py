"""Image files come back as they went in, read and written by others too; every unusable file ends in one sentence."""

import io
import os
import resource
import struct
import subprocess
import sys
import zlib
from dataclasses import replace

import numpy as np
import pytest
import pyvips
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageCms, ImageOps

from toposeam.errors import ImageError, OptionError
from toposeam_cli import decode
from toposeam_cli import picture as picture_module
from toposeam_cli.output import PICTURE_SUFFIXES, OutputError
from toposeam_cli.picture import Picture, match_pictures, read_picture, write_picture
from toposeam_cli.recipe_file import to_xmp

SRGB = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
OTHER_SRGB = pyvips.Image.profile_load("srgb")
P3 = pyvips.Image.profile_load("p3")
CMYK = pyvips.Image.profile_load("cmyk")
DEPTHS = {"uint8": 255, "uint16": 65535, "float32": 1.0}


def gray_profile(gamma):
    """A minimal ICC version 2 profile: gray with a plain gamma."""
    description = b"desc\0\0\0\0" + struct.pack(">I", 5) + b"gray\0" + bytes(8 + 2 + 1 + 67 + 2)
    white = b"XYZ \0\0\0\0" + struct.pack(">3i", 63190, 65536, 54061)
    curve = b"curv\0\0\0\0" + struct.pack(">IHH", 1, round(gamma * 256), 0)
    tags = [(b"desc", description), (b"cprt", b"text\0\0\0\0none\0\0\0\0"), (b"wtpt", white), (b"kTRC", curve)]
    table, body, start = struct.pack(">I", len(tags)), b"", 128 + 4 + 12 * len(tags)
    for signature, data in tags:
        table += signature + struct.pack(">II", start + len(body), len(data))
        body += data
    size = 128 + len(table) + len(body)
    header = struct.pack(">I4xI", size, 0x02400000) + b"mntrGRAYXYZ " + struct.pack(">6H", 2020, 1, 1, 0, 0, 0) + b"acsp" + bytes(28)
    return header + struct.pack(">3i", 63190, 65536, 54061) + bytes(48) + table + body


GRAY22 = gray_profile(2.2)


def sample(dtype, n_channels=3, size=(11, 17), seed=0):
    shape = size if n_channels == 1 else (*size, n_channels)
    values = np.random.default_rng(seed).random(shape) * DEPTHS[dtype]
    return values.astype(dtype) if dtype == "float32" else np.rint(values).astype(dtype)


def smooth(height=40, width=60):
    """An RGB picture that survives lossy compression."""
    y, x = np.mgrid[:height, :width]
    return np.stack([60 + 2 * x, 60 + 3 * y, 200 - x - y], axis=-1).astype(np.uint8)


def fails(function, *arguments, error=ImageError, **options):
    """The one sentence a call fails with."""
    with pytest.raises(error) as caught:
        function(*arguments, **options)
    text = str(caught.value)
    assert text
    assert "\n" not in text
    return text


def refusal(path, **options):
    """The sentence a file is refused with, empty if it is read."""
    try:
        read_picture(path, **options)
    except ImageError as error:
        return str(error)
    return ""


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def png_file(width, height, body=b""):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(body)) + chunk(b"IEND", b"")


# What comes in


@pytest.mark.parametrize(("mode", "n_channels", "has_alpha"), [("L", 1, False), ("LA", 1, True), ("RGB", 3, False), ("RGBA", 3, True)])
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
    np.testing.assert_array_equal(read.pixels, values[..., :3] if n_channels == 3 else values.reshape(11, 17, -1)[..., 0])
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


@pytest.mark.parametrize(("name", "options"), [("in.png", {}), ("in.tif", {}), ("in.tif", {"compression": "group4"})])
def test_single_bits_become_black_and_white(tmp_path, name, options):
    bits = sample("uint8", 1) > 127
    Image.fromarray(bits).save(tmp_path / name, **options)
    np.testing.assert_array_equal(read_picture(tmp_path / name).pixels, np.where(bits, 255, 0))


def test_white_is_zero_tiff_is_not_inverted(tmp_path):
    values = sample("uint8", 1)
    tifffile.imwrite(tmp_path / "in.tif", 255 - values, photometric="miniswhite")
    np.testing.assert_array_equal(read_picture(tmp_path / "in.tif").pixels, values)


def test_first_page_and_first_frame(tmp_path):
    pages = np.stack([np.full((4, 5), level, np.uint8) for level in (50, 100, 150)])
    tifffile.imwrite(tmp_path / "in.tif", pages, photometric="minisblack")
    frames = [Image.fromarray(page) for page in pages]
    frames[0].save(tmp_path / "in.gif", save_all=True, append_images=frames[1:])
    frames[0].save(tmp_path / "in.webp", save_all=True, append_images=frames[1:], lossless=True)
    for name in ("in.tif", "in.gif", "in.webp"):
        read = read_picture(tmp_path / name)
        assert read.pixels.shape[:2] == (4, 5), name
        assert (read.pixels == 50).all(), name


@pytest.mark.parametrize("suffix", [".jpg", ".tif"])
@pytest.mark.parametrize("icc", [None, CMYK])
def test_cmyk_becomes_srgb(tmp_path, suffix, icc):
    Image.new("CMYK", (8, 8), (0, 255, 255, 0)).save(tmp_path / f"in{suffix}", **({"icc_profile": icc} if icc else {}))
    read = read_picture(tmp_path / f"in{suffix}")
    assert read.pixels.dtype == np.uint8
    assert read.pixels.shape == (8, 8, 3)
    assert read.alpha is None
    assert read.icc is not None
    assert read.icc[16:20] == b"RGB "
    red, green, blue = read.pixels[4, 4].astype(int)  # full magenta and yellow print as a red, not as pure [255, 0, 0]
    assert red > 200
    assert green < 80
    assert blue < 80


def test_sixteen_bit_cmyk_with_alpha(tmp_path):
    values = np.zeros((6, 7, 5), np.uint16)
    values[..., 4] = np.arange(7) * 10_000
    tifffile.imwrite(tmp_path / "in.tif", values, photometric="separated", planarconfig="contig", extrasamples=["unassalpha"])
    read = read_picture(tmp_path / "in.tif")
    assert read.pixels.dtype == np.uint16
    assert (read.pixels > 64_000).all()
    np.testing.assert_array_equal(read.alpha, values[..., 4])


def test_lab_becomes_srgb(tmp_path):
    lab = pyvips.Image.new_from_array(np.full((4, 4, 3), (50.0, 0.0, 0.0), np.float32)).copy(interpretation="lab")
    lab.colourspace("labs").tiffsave(str(tmp_path / "in.tif"))
    read = read_picture(tmp_path / "in.tif")
    assert read.pixels.dtype == np.uint16
    # L* = 50 is 18.4 % of white's luminance, which sRGB encodes as 0.466; libvips passes through a table.
    np.testing.assert_allclose(read.pixels / 65535, 0.466, atol=0.006)
    Image.new("LAB", (4, 4)).save(tmp_path / "eight.tif")  # 8-bit LAB is refused by libvips 8.18
    assert "export it again" in fails(read_picture, tmp_path / "eight.tif")


@pytest.mark.parametrize(("dtype", "full"), [("uint32", 2**32 - 1), ("int32", 2**31 - 1), ("int16", 2**15 - 1), ("int8", 127)])
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


def test_float_values_outside_zero_to_one_are_allowed_but_not_nan(tmp_path):
    values = sample("float32") * 8 - 4
    tifffile.imwrite(tmp_path / "in.tif", values, photometric="rgb")
    np.testing.assert_array_equal(read_picture(tmp_path / "in.tif").pixels, values)
    for bad in (np.nan, np.inf, -np.inf):
        values[3, 4, 1] = bad
        tifffile.imwrite(tmp_path / "bad.tif", values, photometric="rgb")
        assert "NaN or infinite" in fails(read_picture, tmp_path / "bad.tif")


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
        assert read.resolution == pytest.approx((150 / 25.4, 300 / 25.4) if orientation > 4 else (300 / 25.4, 150 / 25.4), rel=1e-3)
    write_picture(tmp_path / "out.png", read)
    with Image.open(tmp_path / "out.png") as image:
        assert image.getexif().get(0x0112, 1) == 1
        np.testing.assert_array_equal(np.asarray(image), read.pixels)


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
@pytest.mark.parametrize(("dpi", "expected"), [((300, 300), (300, 300)), ((118, 59), (118, 59)), (None, None)])
def test_resolution_is_read_in_pixels_per_mm(tmp_path, suffix, dpi, expected):
    Image.fromarray(smooth()).save(tmp_path / f"in{suffix}", **({"dpi": dpi} if dpi else {}))
    read = read_picture(tmp_path / f"in{suffix}")
    assert read.resolution == (pytest.approx(tuple(value / 25.4 for value in expected), rel=1e-3) if expected else None)


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


# What cannot come in


def test_missing_folder_empty_and_foreign_files_end_in_one_sentence(tmp_path):
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.png").write_text("hello " * 100)
    (tmp_path / "table.csv").write_text("1,2\n3,4\n")
    (tmp_path / "file").touch()
    (tmp_path / "drawing.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"><path d="M0 0L5 5"/></svg>')
    os.mkfifo(tmp_path / "pipe.png")
    assert "there is no file" in fails(read_picture, tmp_path / "missing.png")
    assert "there is no file" in fails(read_picture, tmp_path / "file" / "x.png")
    assert "folder" in fails(read_picture, tmp_path)
    assert "empty" in fails(read_picture, tmp_path / "empty.png")
    assert "export it again" in fails(read_picture, tmp_path / "text.png")
    assert "export it again" in fails(read_picture, tmp_path / "table.csv")
    assert "SVG" in fails(read_picture, tmp_path / "drawing.svg")
    assert "regular file" in fails(read_picture, tmp_path / "pipe.png")
    assert "cannot read" in fails(read_picture, tmp_path / ("n" * 300))
    assert "cannot read" in fails(read_picture, tmp_path / "nul\0.png")


def test_an_unreadable_file_ends_in_one_sentence(tmp_path, monkeypatch):
    def fail(*arguments):
        raise PermissionError(13, "Permission denied")

    (tmp_path / "in.png").touch()
    monkeypatch.setattr("pathlib.Path.open", fail)
    text = fails(decode._check_input, tmp_path / "in.png")
    monkeypatch.undo()
    assert "Permission denied" in text
    assert "right to read" in text


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".webp", ".gif", ".raw.tif"])
@pytest.mark.parametrize("kept", [0.01, 0.3, 0.9, 0.999])
def test_a_truncated_file_is_refused_in_silence(tmp_path, capfd, suffix, kept):
    path = tmp_path / f"in{suffix}"
    values = sample("uint8", 3, (100, 120))
    if suffix == ".raw.tif":
        tifffile.imwrite(path, values)  # pixels last: the header stays readable
    else:
        Image.fromarray(values).save(path, **({"compression": "tiff_lzw"} if suffix == ".tif" else {}))
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * kept)])
    assert "damaged" in fails(read_picture, path)
    captured = capfd.readouterr()
    assert captured.out == captured.err == ""


def test_every_prefix_of_a_small_file_is_refused_or_read(tmp_path, capfd):
    whole = io.BytesIO()
    Image.fromarray(sample("uint8", 3, (4, 5))).save(whole, "PNG", dpi=(300, 300))
    path = tmp_path / "in.png"
    for length in range(1, len(whole.getvalue())):
        path.write_bytes(whole.getvalue()[:length])
        text = refusal(path)
        assert "\n" not in text
        assert text or read_picture(path).pixels.shape == (4, 5, 3)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("size", [(100_000, 100_000), (1_000_000, 501), (2**31 - 1, 2**31 - 1), (2**31 - 1, 1), (0, 5), (5, 0)])
def test_a_huge_or_empty_header_is_refused_before_decoding(tmp_path, size):
    (tmp_path / "in.png").write_bytes(png_file(*size))
    text = fails(read_picture, tmp_path / "in.png")
    if size[0] in (100_000, 1_000_000):  # libvips itself refuses the others
        assert "--max-megapixels" in text
        assert f"{size[0]} x {size[1]}" in text
        assert "500 megapixels" in text


def test_the_pixel_limit_is_inclusive(tmp_path):
    Image.fromarray(smooth(40, 60)).save(tmp_path / "in.png")
    assert read_picture(tmp_path / "in.png", max_pixels=2400).pixels.shape == (40, 60, 3)
    assert "0.002399 megapixels" in fails(read_picture, tmp_path / "in.png", max_pixels=2399)


def test_depths_libvips_cannot_decode_end_in_one_sentence(tmp_path):
    for dtype in (np.float64, np.complex64, np.uint64):
        tifffile.imwrite(tmp_path / "in.tif", np.ones((4, 5), dtype), photometric="minisblack")
        text = fails(read_picture, tmp_path / "in.tif")
        assert "export it again" in text
        assert dtype != np.float64 or "32 bits" in text


def test_many_channels_end_in_one_sentence(tmp_path):
    tifffile.imwrite(tmp_path / "in.tif", np.ones((5, 6, 7), np.uint8), photometric="minisblack", planarconfig="contig")
    assert "7 channels" in fails(read_picture, tmp_path / "in.tif")


@settings(max_examples=150, deadline=None)
@given(st.data())
def test_damaged_files_are_read_or_refused_never_worse(tmp_path_factory, data):
    suffix = data.draw(st.sampled_from([".png", ".jpg", ".tif", ".webp", ".gif"]))
    whole = io.BytesIO()
    Image.fromarray(smooth(9, 13)).save(whole, {".jpg": "JPEG", ".tif": "TIFF"}.get(suffix, suffix[1:].upper()))
    content = bytearray(whole.getvalue())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.mktemp("damaged") / f"in{suffix}"
    path.write_bytes(content)
    assert "\n" not in refusal(path, max_pixels=10_000)


# What goes out


def stored(path):
    """The values another program finds in a file."""
    if path.suffix in (".tif", ".tiff"):
        return tifffile.imread(path)
    with Image.open(path) as image:
        return np.asarray(image)


@pytest.mark.parametrize(("n_channels", "has_alpha"), [(1, False), (1, True), (3, False), (3, True)])
@pytest.mark.parametrize(
    ("dtype", "suffix"), [("uint8", ".png"), ("uint8", ".tif"), ("uint16", ".tiff"), ("float32", ".tif"), ("uint8", ".webp")]
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


@pytest.mark.parametrize(("n_channels", "has_alpha", "colour_type"), [(1, False, 0), (1, True, 4), (3, False, 2), (3, True, 6)])
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
    write_picture(tmp_path / "out.tif", Picture(pixels=smooth(400, 600), alpha=np.full((400, 600), 128, np.uint8)))
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
        write_picture(tmp_path / f"out{suffix}", Picture(pixels=sample("uint8"), alpha=np.zeros((11, 17), np.uint8)))
        np.testing.assert_array_equal(read_picture(tmp_path / f"out{suffix}").pixels, sample("uint8"))


def test_jpeg_is_near_lossless_without_colour_subsampling(tmp_path):
    write_picture(tmp_path / "out.jpg", Picture(pixels=smooth()))
    with Image.open(tmp_path / "out.jpg") as image:
        assert [layer[1:3] for layer in image.layer] == [(1, 1)] * 3
        assert np.abs(np.asarray(image).astype(int) - smooth()).max() <= 4
    write_picture(tmp_path / "gray.jpg", Picture(pixels=smooth()[..., 0]))
    with Image.open(tmp_path / "gray.jpg") as image:
        assert image.mode == "L"


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


# What does not go out


def test_too_large_for_the_format_ends_in_one_sentence(tmp_path):
    for suffix, side in ((".webp", 16_384), (".jpg", 65_501)):
        text = fails(write_picture, tmp_path / f"out{suffix}", Picture(pixels=np.zeros((1, side), np.uint8)))
        assert str(side) in text
        assert ".png or .tif" in text
        write_picture(tmp_path / f"fits{suffix}", Picture(pixels=np.zeros((1, side - 1), np.uint8)))
    assert names(tmp_path) == ["fits.jpg", "fits.webp"]


def test_unsupported_extensions_and_existing_files_are_refused(tmp_path):
    picture = Picture(pixels=smooth())
    assert ".webp" in fails(write_picture, tmp_path / "out.gif", picture, error=OptionError)
    write_picture(tmp_path / "out.png", picture)
    before = (tmp_path / "out.png").read_bytes()
    black = Picture(pixels=np.zeros((3, 3), np.uint8))
    assert "--force" in fails(write_picture, tmp_path / "out.png", black, error=OptionError)
    assert (tmp_path / "out.png").read_bytes() == before
    write_picture(tmp_path / "out.png", black, force=True)
    assert not stored(tmp_path / "out.png").any()
    assert "no folder" in fails(write_picture, tmp_path / "missing" / "out.png", picture, error=OptionError)
    assert names(tmp_path) == ["out.png"]


@pytest.mark.parametrize("suffix", PICTURE_SUFFIXES)
def test_a_disk_that_fills_up_keeps_the_existing_file(tmp_path, suffix, capfd):
    path = tmp_path / f"out{suffix}"
    path.write_bytes(b"precious")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    picture = Picture(pixels=sample("uint8", 3, (200, 300)))
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))  # libvips meets a real failing write after 20 kB
    try:
        text = fails(write_picture, path, picture, error=OutputError, force=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "file too large" in text.lower()
    assert "free some space" in text
    assert path.read_bytes() == b"precious"
    assert names(tmp_path) == [path.name]
    assert capfd.readouterr().err == ""


def test_the_source_itself_can_be_replaced(tmp_path):
    path = tmp_path / "in.png"
    Image.fromarray(smooth()).save(path)
    read = read_picture(path)
    write_picture(path, replace(read, pixels=255 - read.pixels), force=True)
    np.testing.assert_array_equal(stored(path), 255 - smooth())


def test_the_same_picture_gives_the_same_bytes(tmp_path):
    picture = Picture(pixels=sample("uint8", 3, (100, 200)), icc=SRGB, resolution=(10, 10))
    for suffix in PICTURE_SUFFIXES:
        write_picture(tmp_path / f"a{suffix}", picture)
        write_picture(tmp_path / f"b{suffix}", picture)
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes(), suffix


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"pixels": np.zeros((3, 4, 4), np.uint8)}, r"\(3, 4, 4\)"),
        ({"pixels": np.zeros((3, 4, 1), np.uint8)}, r"\(3, 4, 1\)"),
        ({"pixels": np.zeros((0, 4), np.uint8)}, r"\(0, 4\)"),
        ({"pixels": np.zeros(4, np.uint8)}, r"\(4,\)"),
        ({"pixels": np.zeros((3, 4))}, "float64"),
        ({"pixels": np.zeros((3, 4), bool)}, "bool"),
        ({"pixels": np.zeros((3, 4), np.uint8), "alpha": np.zeros((4, 3), np.uint8)}, r"\(4, 3\)"),
        ({"pixels": np.zeros((3, 4), np.uint8), "alpha": np.zeros((3, 4), np.uint16)}, "uint16"),
        ({"pixels": np.zeros((3, 4), np.uint8), "resolution": (0.0, 4.0)}, "pixels per mm"),
        ({"pixels": np.zeros((3, 4), np.float32), "alpha": np.full((3, 4), np.nan, np.float32)}, "NaN"),
    ],
)
def test_a_picture_is_checked_on_construction(fields, message):
    with pytest.raises(ImageError, match=message):
        Picture(**fields)


# Side by side


def test_gray_is_widened_and_the_deepest_depth_wins():
    pictures = [
        Picture(pixels=np.array([[0, 1, 255]], np.uint8), alpha=np.array([[0, 128, 255]], np.uint8), resolution=(4, 5)),
        Picture(pixels=sample("uint16")),
    ]
    gray, rgb = match_pictures(pictures)
    np.testing.assert_array_equal(gray.pixels, np.repeat(np.array([[0, 257, 65535]], np.uint16)[..., None], 3, axis=2))
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
    np.testing.assert_allclose(second.pixels, np.asarray(expected).astype(int), atol=1)  # both round to 8 bits
    assert np.abs(second.pixels.astype(int) - values).max() > 5


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
    _, second = match_pictures([Picture(pixels=sample(dtype), icc=SRGB), Picture(pixels=sample(dtype, seed=1), icc=icc)])
    assert second.icc == SRGB
    np.testing.assert_array_equal(second.pixels, sample(dtype, seed=1))


def test_a_gray_profile_is_applied_on_the_way_to_rgb():
    ramp = np.arange(0, 65536, 257, dtype=np.uint16)[None]
    gray, rgb = match_pictures([Picture(pixels=ramp, icc=gray_profile(1.0)), Picture(pixels=sample("uint8"), icc=OTHER_SRGB)])
    assert gray.icc == rgb.icc == OTHER_SRGB
    assert gray.pixels.dtype == np.uint16
    linear = ramp / 65535
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    # lcms rounds XYZ to 16 bits, which sRGB stretches up to 13 times in the dark.
    np.testing.assert_allclose(gray.pixels / 65535, np.repeat(srgb[..., None], 3, axis=2), atol=13 * 2 / 65535)


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


# Start-up


def test_importing_the_module_does_not_load_libvips():
    code = "import sys, toposeam_cli.picture; sys.exit('pyvips' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path))).returncode == 0


def test_the_formats_are_the_ones_the_check_allows():
    assert tuple(picture_module._FORMATS) == PICTURE_SUFFIXES


# --- metadata

PACKET = (
    '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF'
    ' xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" xmlns:tiff="http://ns.adobe.com/tiff/1.0/"'
    ' tiff:Orientation="6" xmlns:dc="http://purl.org/dc/elements/1.1/" dc:source="the attic"/></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
).encode()


def photograph(path):
    """A picture with all that a camera and an editor write, lying on its side."""
    exif = Image.Exif()
    exif.update({0x010F: "Maker", 0x0112: 6, 0x8298: "(c) Somebody"})
    exif.get_ifd(0x8769).update({0x829A: (1, 250), 0x9003: "2024:01:02 03:04:05", 0xA002: 60, 0xA003: 40, 0x927C: b"makernote" * 9})
    exif.get_ifd(0x8825).update({1: "N", 2: (47.0, 30.0, 12.5)})
    Image.fromarray(smooth(40, 60)).save(path, exif=exif, xmp=PACKET, dpi=(300, 150))


@pytest.mark.parametrize("target", [".jpg", ".png", ".webp", ".tif"])
@pytest.mark.parametrize("source", [".jpg", ".webp"])
def test_metadata_is_copied_where_the_format_has_a_place_for_it(tmp_path, source, target):
    photograph(tmp_path / f"in{source}")
    write_picture(tmp_path / f"out{target}", read_picture(tmp_path / f"in{source}"))
    again = read_picture(tmp_path / f"out{target}")
    assert again.pixels.shape == (60, 40, 3)
    assert again.xmp == PACKET.replace(b'Orientation="6"', b'Orientation="1"')
    with Image.open(tmp_path / f"out{target}") as image:
        exif = image.getexif()
        assert exif.get(0x0112, 1) == 1
        if target == ".tif":
            return  # libvips writes no EXIF into TIFF
        assert (exif[0x010F], exif[0x8298]) == ("Maker", "(c) Somebody")
        camera = exif.get_ifd(0x8769)
        assert (camera[0x9003], camera[0x829A], camera[0x927C]) == ("2024:01:02 03:04:05", (1, 250), b"makernote" * 9)
        assert (camera[0xA002], camera[0xA003]) == (40, 60)
        assert dict(exif.get_ifd(0x8825)) == {1: "N", 2: (47.0, 30.0, 12.5)}
        if source == ".jpg":
            assert (exif[0x011A], exif[0x011B]) == pytest.approx((150, 300), rel=1e-4)


def test_a_picture_without_metadata_gets_none(tmp_path):
    Image.fromarray(smooth()).save(tmp_path / "in.png")
    picture = read_picture(tmp_path / "in.png")
    assert (picture.exif, picture.xmp) == (None, None)


def test_the_thumbnail_of_the_source_is_not_that_of_the_result(tmp_path):
    thumbnail = io.BytesIO()
    Image.fromarray(smooth(8, 8)).save(thumbnail, "JPEG")
    head = b"II*\0" + struct.pack("<I", 8)
    first = struct.pack("<H", 1) + struct.pack("<HHII", 0x0112, 3, 1, 1) + struct.pack("<I", 26)
    start = 26 + 2 + 2 * 12 + 4
    second = struct.pack("<H", 2) + struct.pack("<HHII", 0x0201, 4, 1, start) + struct.pack("<HHII", 0x0202, 4, 1, thumbnail.tell())
    exif = b"Exif\0\0" + head + first + second + struct.pack("<I", 0) + thumbnail.getvalue()
    Image.fromarray(smooth()).save(tmp_path / "in.jpg", exif=exif)
    assert thumbnail.getvalue() in (tmp_path / "in.jpg").read_bytes()
    write_picture(tmp_path / "out.jpg", read_picture(tmp_path / "in.jpg"))
    assert thumbnail.getvalue() not in (tmp_path / "out.jpg").read_bytes()


def test_the_recipe_of_a_motif_is_not_that_of_what_is_made_of_it(tmp_path):
    recipe = to_xmp({"recipe": {}})
    write_picture(tmp_path / "motif.png", Picture(pixels=smooth(), xmp=recipe))
    assert pyvips.Image.new_from_file(str(tmp_path / "motif.png")).get("xmp-data") == recipe
    assert read_picture(tmp_path / "motif.png").xmp is None


@pytest.mark.parametrize("target", [".jpg", ".png", ".webp", ".tif"])
def test_metadata_too_large_or_damaged_for_a_format_does_not_stop_it(tmp_path, target, capfd):
    for index, block in enumerate([b"", b"nonsense" * 20_000, PACKET.replace(b"attic", b"attic" * 40_000)]):
        path = tmp_path / f"{index}{target}"
        write_picture(path, Picture(pixels=smooth(), xmp=block))
        with Image.open(path) as image:
            image.load()
        assert np.abs(read_picture(path).pixels.astype(int) - smooth()).mean() < 3
    for index, block in enumerate([b"", b"II*\0\xff\xff\xff\xff", b"II*\0\x08\0\0\0\xff\xff", b"nonsense" * 7000]):
        Image.fromarray(smooth()).save(tmp_path / "in.jpg", exif=b"Exif\0\0" + block)
        write_picture(tmp_path / f"again{index}{target}", read_picture(tmp_path / "in.jpg"))
    large = b"Exif\0\0II*\0\x08\0\0\0" + struct.pack("<H", 1) + struct.pack("<HHII", 0x9286, 7, 80_000, 26) + bytes(4 + 80_000)
    Image.fromarray(smooth()).save(tmp_path / "in.png", exif=large)
    write_picture(tmp_path / f"large{target}", read_picture(tmp_path / "in.png"))
    assert capfd.readouterr().err == ""


def test_a_resolution_that_is_not_stated_is_not_made_up(tmp_path):
    exif = Image.Exif()
    exif[0x010F] = "Maker"
    Image.fromarray(smooth()).save(tmp_path / "in.webp", exif=exif)
    assert read_picture(tmp_path / "in.webp").resolution is None
