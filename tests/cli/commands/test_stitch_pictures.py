"""``toposeam stitch``: what a picture is made of survives, whatever it is and whatever its name."""

import numpy as np
import pytest
import tifffile
from PIL import Image

from stitching import PROFILE, STRIP, assert_joined, names, shown
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture


@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("kind", ["gray", "gray and alpha", "RGB", "RGB and alpha"])
def test_sixteen_bits_stay_sixteen_bits(folder, toposeam, kind, suffix):
    rng = np.random.default_rng(2)
    for name in "cd":
        pixels = rng.integers(0, 65536, (30, 41, 3) if "RGB" in kind else (30, 41), np.uint16)
        alpha = rng.integers(1, 65536, (30, 41), np.uint16) if "alpha" in kind else None
        write_picture(f"{name}{suffix}", Picture(pixels=pixels, alpha=alpha))
    line = (
        "stitch",
        f"c{suffix}",
        f"d{suffix}",
        "--overlap",
        "13",
        "-o",
        f"out{suffix}",
        "--labels",
        "labels.png",
    )
    assert toposeam(*line).code == 0
    result = read_picture(f"out{suffix}")
    assert result.pixels.dtype == np.uint16
    assert (result.pixels.ndim == 3) == ("RGB" in kind)
    assert (result.alpha is not None) == ("alpha" in kind)
    assert_joined(f"out{suffix}", "labels.png", f"c{suffix}", f"d{suffix}", (28, 0))


def test_other_programs_see_sixteen_bit_rgb(folder, toposeam):
    rng = np.random.default_rng(3)
    values = {name: rng.integers(0, 65536, (12, 20, 3), np.uint16) for name in "cd"}
    for name, pixels in values.items():
        tifffile.imwrite(f"{name}.tif", pixels, photometric="rgb")
    assert toposeam("stitch", "c.tif", "d.tif", "--overlap", "6", "-o", "out.tif").code == 0
    stored = tifffile.imread("out.tif")
    np.testing.assert_array_equal(stored[:, :14], values["c"][:, :14])
    np.testing.assert_array_equal(stored[:, 20:], values["d"][:, 6:])


def test_floats_stay_floats_beyond_white(folder, toposeam):
    rng = np.random.default_rng(4)
    values = {name: (rng.random((12, 20, 3)) * 3 - 0.5).astype(np.float32) for name in "cd"}
    for name, pixels in values.items():
        tifffile.imwrite(f"{name}.tif", pixels, photometric="rgb")
    assert (
        toposeam("stitch", "c.tif", "d.tif", "--overlap", "6", "-o", "out.tif", "--labels", "labels.png").code
        == 0
    )
    stored = tifffile.imread("out.tif")
    assert stored.dtype == np.float32
    np.testing.assert_array_equal(stored[:, 20:], values["d"][:, 6:])
    assert_joined("out.tif", "labels.png", "c.tif", "d.tif", (14, 0))


@pytest.mark.parametrize("suffix", [".png", ".tif", ".jpg", ".webp"])
def test_profile_and_resolution_survive(folder, toposeam, photographs, suffix):
    for name, pixels in zip("cd", photographs, strict=True):
        write_picture(f"{name}.tif", Picture(pixels=pixels, icc=PROFILE, resolution=(11.811, 11.811)))
    assert toposeam("stitch", "c.tif", "d.tif", "--overlap", "20", "-o", f"out{suffix}").code == 0
    with Image.open(f"out{suffix}") as stored:
        assert stored.info["icc_profile"] == PROFILE
    # PNG counts whole pixels per metre, JPEG whole ones per inch.
    assert read_picture(f"out{suffix}").resolution == pytest.approx((11.811, 11.811), rel=5e-3)


def test_the_orientation_of_a_camera_is_applied(folder, toposeam, photographs):
    exif = Image.Exif()
    exif[0x0112] = 6  # the camera was held upright: turn by 90 degrees clockwise
    Image.fromarray(np.rot90(photographs[0])).save("turned.png", exif=exif)
    assert toposeam("stitch", "turned.png", "b.png", "--overlap", "20", "-o", "out.png").code == 0
    assert toposeam("stitch", "a.png", "b.png", "--overlap", "20", "-o", "expected.png").code == 0
    np.testing.assert_array_equal(read_picture("out.png").pixels, read_picture("expected.png").pixels)


@pytest.mark.parametrize("suffix", [".jpg", ".jpeg", ".webp", ".TIFF", ".Png"])
def test_every_format_is_written(folder, toposeam, suffix):
    assert toposeam("stitch", *STRIP, "-o", f"out{suffix}").code == 0
    assert toposeam("stitch", *STRIP, "-o", "exact.png").code == 0
    stored, exact = read_picture(f"out{suffix}").pixels, read_picture("exact.png").pixels
    assert stored.shape == exact.shape
    assert np.abs(stored.astype(int) - exact).mean() <= (3 if "jp" in suffix else 0)


def test_gray_beside_colour_is_widened(folder, toposeam, photographs):
    write_picture("gray.png", Picture(pixels=photographs[0][..., 1]))
    assert (
        toposeam(
            "stitch", "gray.png", "b.png", "--overlap", "20", "-o", "out.png", "--labels", "labels.png"
        ).code
        == 0
    )
    assert_joined("out.png", "labels.png", "gray.png", "b.png", (36, 0))
    result = read_picture("out.png").pixels
    np.testing.assert_array_equal(result[:, :36], np.repeat(photographs[0][:, :36, 1:2], 3, axis=2))


def test_the_deeper_picture_decides_the_depth(folder, toposeam, photographs):
    write_picture("deep.tif", Picture(pixels=photographs[1].astype(np.uint16) * 257 + 3))
    assert (
        toposeam(
            "stitch", "a.png", "deep.tif", "--overlap", "20", "-o", "out.tif", "--labels", "labels.png"
        ).code
        == 0
    )
    assert read_picture("out.tif").pixels.dtype == np.uint16
    assert_joined("out.tif", "labels.png", "a.png", "deep.tif", (36, 0))


@pytest.mark.parametrize(
    "name", ["cmyk.jpg", "cmyk.tif", "palette.png", "palette.gif", "animated.gif", "bit.png", "wrong.png"]
)
def test_what_is_not_rgb_is_converted(folder, toposeam, photographs, name):
    image = Image.fromarray(photographs[1])
    if name.startswith("cmyk"):
        image.convert("CMYK").save(name)
    elif name == "palette.png":
        image.quantize(32).save(name)
    elif name == "animated.gif":
        image.save(name, save_all=True, append_images=[Image.new("RGB", image.size, "red")])
    elif name == "bit.png":
        image.convert("1").save(name)
    elif name == "wrong.png":
        image.save(name, format="JPEG")
    else:
        image.save(name)
    assert (
        toposeam("stitch", "a.png", name, "--overlap", "20", "-o", "out.png", "--labels", "labels.png").code
        == 0
    )
    assert_joined("out.png", "labels.png", "a.png", name, (36, 0))
    result = read_picture("out.png").pixels
    assert result.shape == (40, 92, 3)
    if name != "bit.png":  # colours are those of the photograph, as far as the format goes
        assert np.abs(result[:, 56:].astype(int) - photographs[1][:, 20:]).mean() < 40


def test_a_hole_in_one_picture_is_filled_from_the_other(folder, toposeam, photographs):
    alpha = np.full((40, 56), 255, np.uint8)
    alpha[10:20, 44:] = 0
    write_picture("holed.png", Picture(pixels=photographs[0], alpha=alpha))
    assert (
        toposeam(
            "stitch", "holed.png", "b.png", "--overlap", "20", "-o", "out.png", "--labels", "labels.png"
        ).code
        == 0
    )
    assert shown("labels.png")[10:20, 44:56].all()
    assert read_picture("out.png").alpha is None
    assert_joined("out.png", "labels.png", "holed.png", "b.png", (36, 0))


def test_pixels_without_any_source_are_transparent_black(folder, toposeam, photographs):
    alpha = np.full((40, 56), 255, np.uint8)
    alpha[:12, 40:] = 0
    for name, pixels, mask in zip("cd", photographs, (alpha, alpha[:, ::-1]), strict=True):
        write_picture(f"{name}.png", Picture(pixels=pixels, alpha=np.ascontiguousarray(mask)))
    assert (
        toposeam(
            "stitch", "c.png", "d.png", "--overlap", "20", "-o", "out.png", "--labels", "labels.png"
        ).code
        == 0
    )
    result = read_picture("out.png")
    assert (result.alpha[:12, 40:52] == 0).all()
    assert (result.pixels[:12, 40:52] == 0).all()  # what was hidden in the inputs does not travel on
    assert_joined("out.png", "labels.png", "c.png", "d.png", (36, 0))


def test_soft_edges_keep_their_alpha(folder, toposeam, photographs):
    rng = np.random.default_rng(5)
    for name, pixels in zip("cd", photographs, strict=True):
        write_picture(f"{name}.tif", Picture(pixels=pixels, alpha=rng.integers(0, 256, (40, 56), np.uint8)))
    assert (
        toposeam(
            "stitch", "c.tif", "d.tif", "--overlap", "20", "-o", "out.tif", "--labels", "labels.png"
        ).code
        == 0
    )
    assert_joined("out.tif", "labels.png", "c.tif", "d.tif", (36, 0))


def test_a_transparent_palette_has_pixels_where_it_is_opaque(folder, toposeam, photographs):
    palette = Image.fromarray(photographs[1]).quantize(16)
    indices = np.array(palette)
    palette.save("palette.png", transparency=3)
    assert (
        toposeam(
            "stitch", "a.png", "palette.png", "--overlap", "20", "-o", "out.png", "--labels", "labels.png"
        ).code
        == 0
    )
    transparent = indices == 3
    assert transparent.any()
    assert not shown("labels.png")[:, 36:][transparent].any()
    assert (read_picture("out.png").alpha[:, 56:] == np.where(transparent[:, 20:], 0, 255)).all()
    assert_joined("out.png", "labels.png", "a.png", "palette.png", (36, 0))


@pytest.mark.parametrize(
    "name",
    ["with space.png", "이미지 é ☃.png", "a'b\"c$(d)*?.png", "x" * 200 + ".png", ".hidden.png", "n%d.%%.png"],
)
def test_any_name_is_just_a_name(folder, toposeam, name):
    (folder / "b.png").rename(folder / name)
    assert (
        toposeam(
            "stitch",
            "a.png",
            name,
            "--overlap",
            "20",
            "-o",
            f"out {name[:150]}.png",
            "--seam",
            f"{name[:150]}.svg",
        ).code
        == 0
    )
    assert len(names(folder)) == 4


def test_names_may_begin_with_a_dash(folder, toposeam):
    (folder / "b.png").rename(folder / "-b.png")
    assert toposeam("stitch", "-o", "-out.png", "--overlap", "20", "--", "a.png", "-b.png").code == 0
    assert toposeam("stitch", "a.png", "./-b.png", "--overlap", "20", "-o", "./-second.png").code == 0
    assert names(folder) == ["-b.png", "-out.png", "-second.png", "a.png"]


def test_links_are_followed(folder, toposeam):
    (folder / "there").mkdir()
    (folder / "link.png").symlink_to(folder / "b.png")
    (folder / "out.png").symlink_to(folder / "there" / "real.png")
    assert toposeam("stitch", "a.png", "link.png", "--overlap", "20", "-o", "out.png").code == 0
    assert (folder / "out.png").is_symlink()
    assert names(folder / "there") == ["real.png"]
