"""What a user does with ``toposeam stitch``, ``compare`` and ``completion``, option by option."""

import json
import os
import pty
import re
import subprocess
import sys

import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms

import toposeam as ts
from toposeam_cli.picture import Picture, match_pictures, read_picture, write_picture

PROFILE = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
STRIP = ("a.png", "b.png", "--overlap", "20")

#: Placements of B, which has the size of A, and what they make of the overlap.
PLACEMENTS = {"strip": "36,0", "L": "30,9", "upwards": "-21,-13", "left": "-36,0", "cross": "17,-25", "beneath": "0,22"}


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def shown(path):
    """The mask that --labels wrote: True where B shows."""
    values = read_picture(path).pixels
    assert values.ndim == 2
    assert set(np.unique(values)) <= {0, 255}
    return values == 255


def assert_joined(path, labels, first, second, offset):
    """Every pixel of a written picture is, bit for bit, that of the layer that shows there; nothing is lost and nothing made up."""
    a, b = match_pictures([read_picture(first), read_picture(second)])
    result = read_picture(path)
    left, top = min(0, offset[0]), min(0, offset[1])
    shape = [max(a.pixels.shape[axis], offset[1 - axis] + b.pixels.shape[axis]) - (top, left)[axis] for axis in (0, 1)]
    assert list(result.pixels.shape[:2]) == shape
    expected = np.zeros(result.pixels.shape, a.pixels.dtype)
    opacity = np.zeros(shape, a.pixels.dtype)
    b_shows = shown(labels)
    for picture, (x, y), shows in ((a, (0, 0), ~b_shows), (b, offset, b_shows)):
        height, width = picture.pixels.shape[:2]
        place = np.s_[y - top : y - top + height, x - left : x - left + width]
        full = np.ones(1, a.pixels.dtype) if a.pixels.dtype == np.float32 else np.iinfo(a.pixels.dtype).max
        alpha = np.full((height, width), full, a.pixels.dtype) if picture.alpha is None else picture.alpha
        here = shows[place] & picture.covered()
        expected[place][here] = picture.pixels[here]
        opacity[place][here] = alpha[here]
    assert result.pixels.dtype == expected.dtype
    np.testing.assert_array_equal(result.pixels, expected)
    if result.alpha is None:
        assert (opacity == full).all()
    else:
        np.testing.assert_array_equal(result.alpha, opacity)


# Where B lies


@pytest.mark.parametrize("where", PLACEMENTS.values(), ids=PLACEMENTS)
def test_an_offset_places_b_anywhere(folder, toposeam, where):
    ran = toposeam("stitch", "a.png", "b.png", f"--offset={where}", "-o", "joined.png", "--labels", "labels.png")
    assert (ran.code, ran.err) == (0, "")
    assert_joined("joined.png", "labels.png", "a.png", "b.png", tuple(map(int, where.split(","))))
    assert 0 < shown("labels.png").mean() < 1


@pytest.mark.parametrize(
    ("side", "overlap", "offset"),
    [
        ("right", "20", "36,0"),
        ("right", "20px", "36,0"),
        ("right", "25%", "42,0"),
        ("left", "20", "-36,0"),
        ("left", "12.5 %", "-49,0"),
        ("bottom", "10", "0,30"),
        ("bottom", "50%", "0,20"),
        ("top", "10", "0,-30"),
    ],
)
def test_an_overlap_is_an_offset_at_one_side(folder, toposeam, side, overlap, offset):
    assert toposeam("stitch", "a.png", "b.png", "--overlap", overlap, "--side", side, "-o", "overlap.tif").code == 0
    assert toposeam("stitch", "a.png", "b.png", "--offset", offset, "-o", "offset.tif").code == 0
    assert (folder / "overlap.tif").read_bytes() == (folder / "offset.tif").read_bytes()


def test_pictures_of_unlike_sizes_are_aligned_at_the_top(folder, toposeam, photographs):
    write_picture("short.png", Picture(pixels=photographs[1][:17, :31]))
    assert toposeam("stitch", "a.png", "short.png", "--overlap", "9", "-o", "out.png", "--labels", "labels.png").code == 0
    assert_joined("out.png", "labels.png", "a.png", "short.png", (47, 0))
    assert read_picture("out.png").alpha is not None  # below the short one there is nothing


def test_a_picture_inside_the_other_shows_more_the_smaller_the_core(folder, toposeam, photographs):
    write_picture("inner.png", Picture(pixels=photographs[0][5:29, 3:40][::-1]))
    areas = []
    for core in ("0.9", "0.5", "0.1"):
        line = ("stitch", "a.png", "inner.png", "--offset", "9,8", "--core", core, "-o", "out.png", "--labels", "labels.png", "--force")
        assert toposeam(*line).code == 0
        assert_joined("out.png", "labels.png", "a.png", "inner.png", (9, 8))
        areas.append(shown("labels.png").sum())
    assert 0 < areas[0] <= areas[1] <= areas[2]
    assert areas[0] < areas[2]


@pytest.mark.parametrize("overlap", [1, 2, 3])
def test_the_narrowest_overlaps_are_joined(folder, toposeam, overlap):
    line = ("stitch", "a.png", "b.png", "--overlap", overlap, "-o", "out.png", "--labels", "labels.png", "--history", "history.png")
    assert toposeam(*line, "--overlay", "overlay.png").code == 0
    assert_joined("out.png", "labels.png", "a.png", "b.png", (56 - overlap, 0))


def test_pictures_of_one_row_are_joined(folder, toposeam, photographs):
    for name, pixels in zip("cd", photographs, strict=True):
        write_picture(f"{name}.png", Picture(pixels=pixels[:1]))
    line = ("stitch", "c.png", "d.png", "--overlap", "20", "-o", "out.png", "--labels", "labels.png", "--seam", "seam.svg")
    assert toposeam(*line).code == 0
    assert_joined("out.png", "labels.png", "c.png", "d.png", (36, 0))
    assert ts.read_svg("seam.svg").polylines[0].length == 1


# How the seam is found


@pytest.mark.parametrize("method", ts.METHODS)
def test_every_method_joins(folder, toposeam, method):
    if method == "graph-cut":
        pytest.importorskip("maxflow")
    ran = toposeam("stitch", *STRIP, "--method", method, "-o", "out.png", "--labels", "labels.png", "--json")
    assert (ran.code, ran.err) == (0, "")
    assert json.loads(ran.out)["method"] == method
    assert_joined("out.png", "labels.png", "a.png", "b.png", (36, 0))


def test_the_thesis_has_two_formulations(folder, toposeam):
    for formulation in (1, 2):
        line = ("stitch", *STRIP, "--method", "thesis", "--formulation", formulation, "-o", f"{formulation}.png", "--labels", "labels.png")
        assert toposeam(*line, "--force").code == 0
        assert_joined(f"{formulation}.png", "labels.png", "a.png", "b.png", (36, 0))


@pytest.mark.parametrize("gradient", [True, False])
def test_no_gradient_changes_the_cost_and_nothing_else_of_it(folder, toposeam, photographs, gradient):
    ran = toposeam("stitch", *STRIP, "-o", "out.png", "--json", *([] if gradient else ["--no-gradient"]))
    layers = [ts.Layer(image=photographs[0]), ts.Layer(image=photographs[1], offset=(36, 0))]
    stitched = ts.stitch(layers, gradient=gradient)
    assert json.loads(ran.out)["cost"] == stitched.seams[0].cost
    np.testing.assert_array_equal(read_picture("out.png").pixels, stitched.image)


def test_the_seam_avoids_what_the_mask_shows_white(folder, toposeam):
    assert toposeam("stitch", *STRIP, "-o", "free.png", "--labels", "free-labels.png").code == 0
    free = shown("free-labels.png")
    crossing = int(np.flatnonzero(free[20])[0])
    avoid = np.zeros(free.shape, np.uint8)
    avoid[14:27, crossing - 3 : crossing + 3] = 255
    Image.fromarray(avoid).save("mask.png")
    assert toposeam("stitch", *STRIP, "-o", "out.png", "--labels", "labels.png", "--mask", "mask.png").code == 0
    labels = shown("labels.png")
    white = avoid > 0
    assert not ((labels[:, 1:] != labels[:, :-1]) & (white[:, 1:] | white[:, :-1])).any()
    assert not ((labels[1:] != labels[:-1]) & (white[1:] | white[:-1])).any()
    assert (labels != free).any()
    assert_joined("out.png", "labels.png", "a.png", "b.png", (36, 0))


@pytest.mark.parametrize("kind", ["colour", "transparent", "sixteen bit", "single bit"])
def test_any_picture_is_a_mask(folder, toposeam, kind):
    avoid = np.zeros((40, 92), bool)
    avoid[10:30, 40:45] = True
    gray = Image.fromarray(avoid.astype(np.uint8) * 255)
    if kind == "colour":
        gray.convert("RGB").save("mask.png")
    elif kind == "transparent":
        white = Image.new("L", (92, 40), 255)
        Image.merge("LA", (white, gray)).save("mask.png")
    elif kind == "sixteen bit":
        tifffile.imwrite("mask.png", avoid.astype(np.uint16) * 40000)
    else:
        gray.convert("1").save("mask.png")
    assert toposeam("stitch", *STRIP, "-o", "out.png", "--labels", "labels.png", "--mask", "mask.png").code == 0
    labels = shown("labels.png")
    touched = (labels[:, 1:] != labels[:, :-1]) & (avoid[:, 1:] | avoid[:, :-1])
    assert not touched.any()


# The seam as a path


@pytest.mark.parametrize("where", PLACEMENTS.values(), ids=PLACEMENTS)
def test_a_seam_that_is_written_and_used_again_gives_the_same_bytes(folder, toposeam, where):
    line = ("stitch", "a.png", "b.png", f"--offset={where}")
    assert toposeam(*line, "-o", "first.png", "--seam", "first.svg").code == 0
    ran = toposeam(*line, "-o", "again.png", "--use-seam", "first.svg", "--seam", "again.svg")
    assert ran.code == 0
    assert "by path" in ran.out
    assert (folder / "first.png").read_bytes() == (folder / "again.png").read_bytes()
    first, again = ts.read_svg("first.svg"), ts.read_svg("again.svg")
    assert [line.points.tolist() for line in first.polylines] == [line.points.tolist() for line in again.polylines]
    assert first.metadata["method"] == "heat"


def test_a_closed_seam_survives_the_round_trip(folder, toposeam, photographs):
    write_picture("inner.png", Picture(pixels=photographs[0][5:29, 3:40][::-1]))
    line = ("stitch", "a.png", "inner.png", "--offset", "9,8")
    assert toposeam(*line, "-o", "first.png", "--seam", "seam.svg").code == 0
    assert ts.read_svg("seam.svg").polylines[0].closed
    assert toposeam(*line, "-o", "again.png", "--use-seam", "seam.svg").code == 0
    assert (folder / "first.png").read_bytes() == (folder / "again.png").read_bytes()


def test_a_hand_drawn_line_is_followed(folder, toposeam):
    (folder / "hand.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="92" height="40"><path d="M44 -3 V20 H50 V43" fill="none"/></svg>'
    )
    line = ("stitch", *STRIP, "-o", "out.png", "--use-seam", "hand.svg", "--labels", "labels.png", "--json")
    facts = json.loads(toposeam(*line).out)
    expected = np.zeros((40, 92), bool)
    expected[:20, 44:] = expected[20:, 50:] = True
    np.testing.assert_array_equal(shown("labels.png"), expected)
    assert (facts["method"], facts["termination"], facts["length_px"]) == ("path", "given", 46)
    assert facts["ratio"] > 1
    assert_joined("out.png", "labels.png", "a.png", "b.png", (36, 0))


def test_one_command_may_write_back_to_the_path_it_uses(folder, toposeam):
    assert toposeam("stitch", *STRIP, "-o", "first.png", "--seam", "seam.svg").code == 0
    assert toposeam("stitch", *STRIP, "-o", "again.png", "--use-seam", "seam.svg", "--seam", "seam.svg", "--force").code == 0
    assert ts.read_svg("seam.svg").metadata["method"] == "path"


# What else is written


def test_the_overlay_marks_the_seam_and_nothing_else(folder, toposeam):
    assert toposeam("stitch", *STRIP, "-o", "out.png", "--overlay", "overlay.png", "--labels", "labels.png").code == 0
    drawn, joined = read_picture("overlay.png").pixels, read_picture("out.png").pixels
    labels = shown("labels.png")
    red = (drawn == (230, 30, 40)).all(axis=2)
    assert red.any(axis=1).all()  # in every row
    beside = labels[:, 1:] != labels[:, :-1]
    far = np.ones(labels.shape, bool)
    for row, column in zip(*np.nonzero(beside), strict=True):
        far[:, max(column - 4, 0) : column + 6] &= np.abs(np.arange(40) - row)[:, np.newaxis] > 4
    assert not red[far].any()
    np.testing.assert_array_equal(drawn[far], joined[far])


@pytest.mark.parametrize("kind", ["sixteen bit gray", "float", "transparent"])
def test_an_overlay_of_any_picture_is_eight_bit_colour(folder, toposeam, photographs, kind):
    for name, pixels in zip("cd", photographs, strict=True):
        alpha = None
        if kind == "sixteen bit gray":
            pixels = pixels[..., 1].astype(np.uint16) * 257
        elif kind == "float":
            pixels = pixels.astype(np.float32) / 200
        else:
            alpha = np.full(pixels.shape[:2], 255, np.uint8)
            alpha[:5] = 0
        write_picture(f"{name}.tif", Picture(pixels=pixels, alpha=alpha))
    line = ("stitch", "c.tif", "d.tif", "--overlap", "20", "-o", "out.tif", "--overlay", "overlay.png", "--labels", "labels.png")
    assert toposeam(*line).code == 0
    assert_joined("out.tif", "labels.png", "c.tif", "d.tif", (36, 0))
    drawn = read_picture("overlay.png").pixels
    assert drawn.dtype == np.uint8
    assert drawn.shape == (40, 92, 3)


@pytest.mark.parametrize(("suffix", "magic"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF"), (".PNG", b"\x89PNG")])
def test_the_history_is_a_figure(folder, toposeam, suffix, magic):
    pytest.importorskip("matplotlib")
    assert toposeam("stitch", *STRIP, "-o", "out.png", "--history", f"history{suffix}").code == 0
    assert (folder / f"history{suffix}").read_bytes().startswith(magic)


@pytest.mark.parametrize("where", ["36,0", "30,9"])
def test_the_thesis_has_a_history_too(folder, toposeam, where):
    pytest.importorskip("matplotlib")
    line = ("stitch", "a.png", "b.png", f"--offset={where}", "--method", "thesis", "-o", "out.png", "--history", "history.png")
    assert toposeam(*line).code == 0
    height, width, _ = read_picture("history.png").pixels.shape
    assert width > 600
    assert height > 400


@pytest.mark.parametrize("method", ts.METHODS)
def test_json_tells_what_was_found(folder, toposeam, method):
    if method == "graph-cut":
        pytest.importorskip("maxflow")
    ran = toposeam("stitch", *STRIP, "--method", method, "-o", "out.png", "--json")
    facts = json.loads(ran.out)
    assert set(facts) == {
        "method", "cost", "optimum", "ratio", "stages", "iterations", "termination", "paths", "length_px", "seconds",
    }  # fmt: skip
    assert facts["ratio"] == pytest.approx(facts["cost"] / facts["optimum"])
    assert facts["ratio"] >= 1 - 1e-6  # single precision costs, added up in another order
    assert facts["seconds"] > 0
    assert (facts["paths"], facts["length_px"]) >= (1, 40)
    iterates = method in ("heat", "thesis")
    assert (facts["iterations"] > 0, facts["stages"] > 0, facts["termination"] == "direct") == (iterates, iterates, not iterates)
    if method in ("shortest-path", "graph-cut"):
        assert facts["ratio"] == pytest.approx(1)


def test_one_line_tells_a_person_what_was_made(folder, toposeam):
    ran = toposeam("stitch", *STRIP, "-o", "out.png")
    assert re.fullmatch(r"out\.png: 92 × 40 px, seam of \d+ px by heat in \d+ iterations, cost [\d.]+, \d\.\d\d s\n", ran.out)
    assert ran.err == ""


def test_a_seam_that_did_not_settle_says_so(folder, toposeam, monkeypatch):
    monkeypatch.setitem(ts.ThesisOptions.__init__.__kwdefaults__, "max_iterations", 2)
    ran = toposeam("stitch", *STRIP, "--method", "thesis", "-o", "out.png", "--labels", "labels.png")
    assert ran.code == 0
    assert "did not settle" in ran.out
    assert_joined("out.png", "labels.png", "a.png", "b.png", (36, 0))


def test_force_replaces_and_only_what_was_named(folder, toposeam):
    outputs = ["out.png", "seam.svg", "labels.png", "overlay.png", "history.png"]
    options = [value for pair in zip(["-o", "--seam", "--labels", "--overlay", "--history"], outputs, strict=True) for value in pair]
    assert toposeam("stitch", *STRIP, *options).code == 0
    assert names(folder) == sorted(["a.png", "b.png", *outputs])
    before = {name: (folder / name).read_bytes() for name in names(folder)}
    (folder / "bystander.txt").write_text("precious")
    assert toposeam("stitch", *STRIP, *options, "--force", "--side", "left").code == 0
    assert names(folder) == sorted(["a.png", "b.png", "bystander.txt", *outputs])
    assert all((folder / name).read_bytes() != before[name] for name in outputs)
    assert all((folder / name).read_bytes() == before[name] for name in ("a.png", "b.png"))
    assert (folder / "bystander.txt").read_text() == "precious"


def test_an_input_is_replaced_only_when_asked(folder, toposeam):
    before = (folder / "a.png").read_bytes()
    toposeam("stitch", *STRIP, "-o", "a.png").fails("--force")
    assert (folder / "a.png").read_bytes() == before
    assert toposeam("stitch", *STRIP, "-o", "a.png", "--force").code == 0
    assert read_picture("a.png").pixels.shape == (40, 92, 3)


def test_the_same_pictures_give_the_same_bytes(folder, toposeam):
    for name in ("first", "again"):
        assert toposeam("stitch", *STRIP, "-o", f"{name}.png", "--seam", f"{name}.svg").code == 0
    for suffix in ("png", "svg"):
        assert (folder / f"first.{suffix}").read_bytes() == (folder / f"again.{suffix}").read_bytes()


# What a picture is made of survives


@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("kind", ["gray", "gray and alpha", "RGB", "RGB and alpha"])
def test_sixteen_bits_stay_sixteen_bits(folder, toposeam, kind, suffix):
    rng = np.random.default_rng(2)
    for name in "cd":
        pixels = rng.integers(0, 65536, (30, 41, 3) if "RGB" in kind else (30, 41), np.uint16)
        alpha = rng.integers(1, 65536, (30, 41), np.uint16) if "alpha" in kind else None
        write_picture(f"{name}{suffix}", Picture(pixels=pixels, alpha=alpha))
    line = ("stitch", f"c{suffix}", f"d{suffix}", "--overlap", "13", "-o", f"out{suffix}", "--labels", "labels.png")
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
    assert toposeam("stitch", "c.tif", "d.tif", "--overlap", "6", "-o", "out.tif", "--labels", "labels.png").code == 0
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


# Unlike pictures


def test_gray_beside_colour_is_widened(folder, toposeam, photographs):
    write_picture("gray.png", Picture(pixels=photographs[0][..., 1]))
    assert toposeam("stitch", "gray.png", "b.png", "--overlap", "20", "-o", "out.png", "--labels", "labels.png").code == 0
    assert_joined("out.png", "labels.png", "gray.png", "b.png", (36, 0))
    result = read_picture("out.png").pixels
    np.testing.assert_array_equal(result[:, :36], np.repeat(photographs[0][:, :36, 1:2], 3, axis=2))


def test_the_deeper_picture_decides_the_depth(folder, toposeam, photographs):
    write_picture("deep.tif", Picture(pixels=photographs[1].astype(np.uint16) * 257 + 3))
    assert toposeam("stitch", "a.png", "deep.tif", "--overlap", "20", "-o", "out.tif", "--labels", "labels.png").code == 0
    assert read_picture("out.tif").pixels.dtype == np.uint16
    assert_joined("out.tif", "labels.png", "a.png", "deep.tif", (36, 0))


@pytest.mark.parametrize("name", ["cmyk.jpg", "cmyk.tif", "palette.png", "palette.gif", "animated.gif", "bit.png", "wrong.png"])
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
    assert toposeam("stitch", "a.png", name, "--overlap", "20", "-o", "out.png", "--labels", "labels.png").code == 0
    assert_joined("out.png", "labels.png", "a.png", name, (36, 0))
    result = read_picture("out.png").pixels
    assert result.shape == (40, 92, 3)
    if name != "bit.png":  # colours are those of the photograph, as far as the format goes
        assert np.abs(result[:, 56:].astype(int) - photographs[1][:, 20:]).mean() < 40


# Alpha says where a picture has pixels


def test_a_hole_in_one_picture_is_filled_from_the_other(folder, toposeam, photographs):
    alpha = np.full((40, 56), 255, np.uint8)
    alpha[10:20, 44:] = 0
    write_picture("holed.png", Picture(pixels=photographs[0], alpha=alpha))
    assert toposeam("stitch", "holed.png", "b.png", "--overlap", "20", "-o", "out.png", "--labels", "labels.png").code == 0
    assert shown("labels.png")[10:20, 44:56].all()
    assert read_picture("out.png").alpha is None
    assert_joined("out.png", "labels.png", "holed.png", "b.png", (36, 0))


def test_where_nobody_has_pixels_the_result_is_transparent_and_black(folder, toposeam, photographs):
    alpha = np.full((40, 56), 255, np.uint8)
    alpha[:12, 40:] = 0
    for name, pixels, mask in zip("cd", photographs, (alpha, alpha[:, ::-1]), strict=True):
        write_picture(f"{name}.png", Picture(pixels=pixels, alpha=np.ascontiguousarray(mask)))
    assert toposeam("stitch", "c.png", "d.png", "--overlap", "20", "-o", "out.png", "--labels", "labels.png").code == 0
    result = read_picture("out.png")
    assert (result.alpha[:12, 40:52] == 0).all()
    assert (result.pixels[:12, 40:52] == 0).all()  # what was hidden in the inputs does not travel on
    assert_joined("out.png", "labels.png", "c.png", "d.png", (36, 0))


def test_soft_edges_keep_their_alpha(folder, toposeam, photographs):
    rng = np.random.default_rng(5)
    for name, pixels in zip("cd", photographs, strict=True):
        write_picture(f"{name}.tif", Picture(pixels=pixels, alpha=rng.integers(0, 256, (40, 56), np.uint8)))
    assert toposeam("stitch", "c.tif", "d.tif", "--overlap", "20", "-o", "out.tif", "--labels", "labels.png").code == 0
    assert_joined("out.tif", "labels.png", "c.tif", "d.tif", (36, 0))


def test_a_palette_with_transparency_has_pixels_where_it_is_opaque(folder, toposeam, photographs):
    palette = Image.fromarray(photographs[1]).quantize(16)
    indices = np.array(palette)
    palette.save("palette.png", transparency=3)
    assert toposeam("stitch", "a.png", "palette.png", "--overlap", "20", "-o", "out.png", "--labels", "labels.png").code == 0
    transparent = indices == 3
    assert transparent.any()
    assert not shown("labels.png")[:, 36:][transparent].any()
    assert (read_picture("out.png").alpha[:, 56:] == np.where(transparent[:, 20:], 0, 255)).all()
    assert_joined("out.png", "labels.png", "a.png", "palette.png", (36, 0))


# Names


@pytest.mark.parametrize("name", ["with space.png", "이미지 é ☃.png", "a'b\"c$(d)*?.png", "x" * 200 + ".png", ".hidden.png", "n%d.%%.png"])
def test_any_name_is_just_a_name(folder, toposeam, name):
    (folder / "b.png").rename(folder / name)
    assert toposeam("stitch", "a.png", name, "--overlap", "20", "-o", f"out {name[:150]}.png", "--seam", f"{name[:150]}.svg").code == 0
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


# compare


def test_compare_tells_every_method(folder, toposeam):
    pytest.importorskip("maxflow")
    ran = toposeam("compare", *STRIP)
    assert (ran.code, ran.err) == (0, "")
    head, *rows = ran.out.splitlines()
    assert head.split() == ["method", "cost", "÷", "optimum", "seconds", "iterations"]
    assert [row.split()[0] for row in rows] == list(ts.METHODS)
    assert names(folder) == ["a.png", "b.png"]


def test_compare_as_json(folder, toposeam):
    ran = toposeam("compare", *STRIP, "--method", "dp", "--method", "heat", "--json")
    rows = json.loads(ran.out)
    assert [row["method"] for row in rows] == ["dp", "heat"]
    assert all(row["ratio"] >= 1 - 1e-6 and row["seconds"] > 0 for row in rows)
    joined = json.loads(toposeam("stitch", *STRIP, "-o", "out.png", "--json").out)
    assert rows[1]["cost"] == joined["cost"]


def test_compare_says_which_method_cannot_and_why(folder, toposeam, monkeypatch):
    monkeypatch.setitem(sys.modules, "maxflow", None)
    ran = toposeam("compare", "a.png", "b.png", "--offset", "30,9", "--method", "dp", "--method", "graph-cut", "--method", "shortest-path")
    assert ran.code == 0
    _, dp, graph_cut, shortest = ran.out.splitlines()
    assert "rectangular" in dp
    assert "pip install 'toposeam[graphcut]'" in graph_cut
    assert "1.00000" in shortest
    rows = json.loads(toposeam("compare", "a.png", "b.png", "--offset", "30,9", "--method", "dp", "--json").out)
    assert set(rows[0]) == {"method", "note"}


# completion, help and version


@pytest.mark.parametrize(("shell", "sign"), [("bash", "complete -o nosort"), ("zsh", "#compdef toposeam"), ("fish", "complete --no-files")])
def test_completion_prints_the_script_of_a_shell(toposeam, shell, sign):
    ran = toposeam("completion", shell)
    assert ran.code == 0
    assert sign in ran.out
    assert "_TOPOSEAM_COMPLETE" in ran.out


def test_the_shell_is_told_commands_options_and_choices(started):
    told = {}
    for words in ("toposeam ", "toposeam stitch --me", "toposeam stitch --method h"):
        env = {"_TOPOSEAM_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": str(len(words.split(" ")) - 1)}
        # Completion goes by the name of the program.
        code = "import sys; sys.argv = ['toposeam']; from toposeam_cli.main import main; main()"
        done = subprocess.run([sys.executable, "-c", code], env=os.environ | env, capture_output=True, text=True, check=False)
        told[words] = done.stdout.split()
    assert {"plain,compare", "plain,completion", "plain,stitch"} <= set(told["toposeam "])
    assert told["toposeam stitch --me"] == ["plain,--method"]
    assert told["toposeam stitch --method h"] == ["plain,heat"]


@pytest.mark.parametrize("command", ["stitch", "compare", "completion"])
@pytest.mark.parametrize("flag", ["-h", "--help"])
def test_help_shows_an_example(toposeam, command, flag):
    ran = toposeam(command, flag)
    assert ran.code == 0
    assert f"toposeam {command} " in ran.out
    assert command in toposeam("--help").out


def test_the_version_is_the_package_s(toposeam):
    assert toposeam("--version").out == f"toposeam, version {ts.__version__}\n"


# On a terminal, and off


def on_terminal(process, *arguments, env=None):
    """Run with stderr on a terminal; what it wrote there, and on stdout."""
    ours, theirs = pty.openpty()
    with process(
        *arguments, stdout=subprocess.PIPE, stderr=theirs, env=os.environ | {"TERM": "xterm", "COLUMNS": "80"} | (env or {})
    ) as child:
        os.close(theirs)
        seen = b""
        while True:
            try:
                part = os.read(ours, 4096)
            except OSError:  # Linux: the other end was closed
                break
            if not part:
                break
            seen += part
        out = child.stdout.read()
    os.close(ours)
    assert child.returncode == 0
    return seen.decode(), out.decode()


def test_a_bar_on_a_terminal_runs_to_the_end(folder, process):
    seen, out = on_terminal(process, "stitch", *STRIP, "-o", "out.png")
    assert "joining a.png and b.png" in seen
    assert "100%" in seen
    assert out.startswith("out.png: ")


def test_a_direct_method_ends_at_all_of_its_bar_too(folder, process):
    seen, _ = on_terminal(process, "stitch", *STRIP, "-o", "out.png", "--method", "dp")
    assert "100%" in seen


def test_no_bar_in_a_pipe_and_silence_when_quiet(folder, process, started):
    ran = started("stitch", *STRIP, "-o", "out.png")
    assert (ran.code, ran.err) == (0, "")
    assert "joining" not in ran.out
    ran = started("stitch", *STRIP, "-o", "out.png", "--force", "--quiet", "--overlay", "overlay.png", "--history", "history.pdf")
    assert ran == type(ran)(0, "", "")
    assert on_terminal(process, "stitch", *STRIP, "-o", "out.png", "--force", "-q") == ("", "")


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp949"])
def test_a_terminal_that_lacks_a_character_does_not_stop_the_work(folder, started, encoding):
    (folder / "b.png").rename(folder / "☃.png")
    env = {"PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    ran = started("stitch", "a.png", "☃.png", "--overlap", "20", "-o", "☃ out.png", env=env)
    assert (ran.code, ran.err) == (0, "")
    assert "92" in ran.out
    ran = started("compare", "a.png", "☃.png", "--overlap", "20", "--method", "dp", env=env)
    assert (ran.code, ran.err) == (0, "")


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_closed_stream_does_not_stop_the_work(folder, stream):
    number = {"stdout": 1, "stderr": 2}[stream]
    script = f'exec "$0" -m toposeam_cli.main stitch a.png b.png --overlap 20 -o out.png {number}>&-'
    done = subprocess.run(["sh", "-c", script, sys.executable], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert names(folder) == ["a.png", "b.png", "out.png"]
