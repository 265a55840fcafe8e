"""Photographs of one scene, joined from nothing but their names."""

import json
import math
import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import tifffile
from click.testing import CliRunner
from PIL import Image, ImageFilter
from skimage import data

from rendered_views import DENSITY, Scene, farthest_off, view
from toposeam.layers.canvas import reach
from toposeam_cli.app.main import main
from toposeam_cli.media.layouts.layout import read_layout
from toposeam_cli.media.pictures.lens import equivalent_mm
from toposeam_cli.media.pictures.openraster import read_ora
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.stitching import inputs as placing

#: px; where the cameras look, degrees.
SIZE, FOCAL = (260, 200), 230.0
ANGLES = {"a.png": (-20, 1, -1), "b.png": (0, -2, 1), "c.png": (21, 2, 0.5)}
THREE = tuple(ANGLES)
TWO = THREE[:2]
ROUND_SIZE, ROUND_FOCAL = (180, 180), 150.0
ROUND = {
    f"r{k}.png": (40 * k + (k * 7 % 5 - 2) * 0.5, k * 3 % 5 - 2.0, (k * 2 % 5 - 2) * 0.5) for k in range(9)
}
#: Scans: crops that are only moved.
CROPS = {"s.png": (0, 0), "t.png": (130, 24)}
CROP_SIZE = 220, 170


def crop(name):
    (x, y), (width, height) = CROPS[name], CROP_SIZE
    return np.ascontiguousarray(data.coffee()[100 + y : 100 + y + height, 150 + x : 150 + x + width])


@pytest.fixture(scope="session")
def scene():
    return Scene(round(2 * math.pi * FOCAL * DENSITY), 700)


@pytest.fixture(scope="session")
def around():
    return Scene(round(2 * math.pi * ROUND_FOCAL * DENSITY), 560)


@pytest.fixture(scope="session")
def rendered(tmp_path_factory, scene):
    """Three views, two scans, and where the first two views were found."""
    folder = tmp_path_factory.mktemp("rendered")
    for name, angles in ANGLES.items():
        pixels = view(scene, scene.camera(SIZE, FOCAL, *angles), SIZE)
        write_picture(folder / name, Picture(pixels=pixels))
    for name in CROPS:
        write_picture(folder / name, Picture(pixels=crop(name)))
    words = [*(folder / name for name in TWO), "--save-layout", folder / "two.toml", "-o", folder / "two.png"]
    ran = CliRunner().invoke(main, ["stitch", *map(str, words)])
    assert ran.exit_code == 0, ran.output
    return folder


@pytest.fixture
def views(rendered, tmp_path, monkeypatch):
    """The working folder: a copy of what was rendered."""
    shutil.copytree(rendered, tmp_path / "views")
    monkeypatch.chdir(tmp_path / "views")
    return tmp_path / "views"


@pytest.fixture
def sole(toposeam, views):
    """Run ``stitch``, which is to end in one sentence, and to write nothing."""

    def run(phrase, *words, code=1):
        before = everything(views)
        toposeam("stitch", *words, *(() if "-o" in words else ("-o", "out.png"))).fails(phrase, code)
        assert everything(views) == before

    return run


def everything(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def joined(toposeam, *words):
    ran = toposeam("stitch", *words)
    assert ran.code == 0, ran
    assert "Traceback" not in ran.err
    return ran


def told(toposeam, *words):
    """What ``--json`` says of the placement."""
    return json.loads(joined(toposeam, *words, "--json").out)["placement"]


def pixels(path="out.png"):
    """(H, W, C) uint8, with alpha where the picture has it."""
    picture = read_picture(path)
    return picture.pixels if picture.alpha is None else np.dstack([picture.pixels, picture.alpha])


def layout_of(path, size):
    """Transforms of a layout, and the first pixel of its canvas."""
    transforms = {layer.name: layer.transform for layer in read_layout(Path(path)).layers}
    reached = np.array([reach(transform, size) for transform in transforms.values()])
    return transforms, np.floor(reached[:, 0].min(axis=0)).astype(int)


def assert_placed(scene, layout="out.toml", output="out.png"):
    """What is joined is the scene, as the second view sees it, to half a pixel; cropped to nothing."""
    transforms, origin = layout_of(layout, SIZE)
    true = scene.camera(SIZE, FOCAL, *ANGLES["b.png"])
    off = farthest_off(scene, pixels(output), origin, transforms["b.png"], true)
    assert len(off) >= 6
    assert max(off) < 0.5


# Three views from one point


@pytest.mark.medium
def test_three_views_are_placed_warped_and_joined(views, toposeam, scene):
    words = *THREE, "-o", "out.png", "--crop", "outside", "--save-layout", "out.toml"
    ran = joined(toposeam, *words, "-v")
    placed, _, last = ran.out.splitlines()
    assert ran.err == ""
    found = re.fullmatch(
        r"3 pictures of a camera that turned, by (2|3) pairs, at most 0\.\d\d px left in the median of one; "
        r"focal length (\d+) mm of 24 × 36, projection cylinder",
        placed,
    )
    assert int(found[2]) == round(equivalent_mm(FOCAL, SIZE))
    assert last.startswith("out.png: ")
    assert_placed(scene)


@pytest.mark.medium
def test_json_says_how_three_views_were_placed(views, toposeam):
    (views / "white.png").write_bytes(white())
    placement = told(toposeam, *THREE, "white.png", "-o", "out.png")
    assert placement["model"] == "rotation"
    assert placement["focal_px"] == pytest.approx(FOCAL, rel=0.01)
    assert placement["focal_mm"] == pytest.approx(equivalent_mm(FOCAL, SIZE), rel=0.01)
    assert placement["projection"] == "cylinder"
    assert placement["wrap"] is None
    assert abs(placement["distortion"]) < 0.005
    assert placement["misfit_px"] < 0.3
    assert placement["used"] == 3
    assert placement["left_out"] == ["white.png shows too little detail to be placed"]
    between = [pair["between"] for pair in placement["pairs"]]
    assert ["a.png", "b.png"] in between
    assert ["b.png", "c.png"] in between
    for pair in placement["pairs"]:
        assert pair["points"] >= 8
        assert pair["median_px"] <= min(pair["farthest_px"], placement["misfit_px"])
        assert 0.8 < pair["correlation"] <= 1


def white():
    """A picture that is white all over, as PNG."""
    path = Path("all-white.png")
    Image.new("RGB", SIZE, "white").save(path)
    content = path.read_bytes()
    path.unlink()
    return content


# What follows for photographs, and for scans


@pytest.mark.medium
@pytest.mark.parametrize("output", ["out.png", "out.jpg", "out.tif"])
def test_warped_pictures_are_fitted_to_a_rectangle(views, toposeam, output):
    ran = joined(toposeam, "two.toml", "-o", output)
    share = int(re.search(r" px, (\d+) % kept, ", ran.out)[1])
    assert pixels(output).shape[2] == 3
    inside = json.loads(joined(toposeam, "two.toml", "-o", "in.png", "--crop", "inside", "--json").out)
    assert 100 * inside["kept"] < share <= 100
    whole = json.loads(joined(toposeam, "two.toml", "-o", "all.png", "--crop", "outside", "--json").out)
    assert whole["kept"] == 1


@pytest.mark.medium
def test_warped_pictures_are_kept_whole_where_asked(views, toposeam):
    for words in (("out.png", "--crop", "outside"), ("filled.png", "--background", "#ff00ff")):
        assert "cropped" not in joined(toposeam, "two.toml", "-o", *words).out
    whole, filled = pixels("out.png"), pixels("filled.png")
    holes = whole[..., 3] == 0
    assert 0.05 < holes.mean() < 0.5
    assert filled.shape == (*whole.shape[:2], 3)
    np.testing.assert_array_equal(filled[holes], np.broadcast_to([255, 0, 255], (holes.sum(), 3)))


@pytest.mark.medium
def test_an_openraster_file_holds_the_warped_layers(views, toposeam):
    ran = joined(toposeam, "two.toml", "-o", "out.ora")
    assert "cropped" not in ran.out
    transforms, origin = layout_of("two.toml", SIZE)
    layers = {layer.name: layer for layer in read_ora(Path("out.ora"), 10**6)}
    assert layers.keys() == set(TWO)
    cover = np.zeros(pixels_shape(ran.out), bool)
    for name, layer in layers.items():
        first, last = reach(transforms[name], SIZE)
        box = [*np.floor(first) - origin, *np.ceil(last) + 1 - origin]
        x, y = layer.at
        height, width = layer.picture.pixels.shape[:2]
        assert box[0] <= x < x + width <= box[2]
        assert box[1] <= y < y + height <= box[3]
        cover[y : y + height, x : x + width] |= layer.picture.alpha > 0
    joined(toposeam, "two.toml", "-o", "out.png", "--crop", "outside")
    np.testing.assert_array_equal(cover, pixels()[..., 3] > 0)


def pixels_shape(out):
    """Height and width that a report tells."""
    width, height = map(int, re.search(r": (\d+) × (\d+) px", out).groups())
    return height, width


def darkened(views, name, factor):
    """The same picture, exposed otherwise."""
    picture = read_picture(views / name)
    dark = np.rint(picture.pixels * factor).astype(np.uint8)
    write_picture(views / name, Picture(pixels=dark), force=True)


@pytest.mark.medium
def test_as_scans_leaves_the_pixels_of_warped_pictures(views, toposeam):
    joined(toposeam, "two.toml", "--crop", "outside", "-o", "even.png")
    darkened(views, "b.png", 0.7)
    ran = joined(toposeam, "two.toml", "--as", "scans", "-o", "scans.png")
    assert "cropped" not in ran.out
    plain = "--no-match-shading", "--blend", "none", "--crop", "outside"
    joined(toposeam, "two.toml", *plain, "-o", "plain.png")
    assert Path("scans.png").read_bytes() == Path("plain.png").read_bytes()
    joined(toposeam, "two.toml", "--crop", "outside", "-o", "usual.png")
    assert darker_on_the_right("scans.png") == pytest.approx(0.7, abs=0.03)
    assert darker_on_the_right("usual.png") == pytest.approx(1, abs=0.08)


def darker_on_the_right(path):
    """By which factor the right edge is darker than the left one, beside an even picture."""
    even, picture = (pixels(name).astype(float) for name in ("even.png", path))
    assert even.shape == picture.shape
    sides = []
    for part in (np.s_[:, :60], np.s_[:, -60:]):
        shown = (even[part][..., 3] == 255) & (picture[part][..., 3] == 255)
        sides.append(picture[part][shown].mean(axis=0)[:3].sum() / even[part][shown].mean(axis=0)[:3].sum())
    return sides[1] / sides[0]


@pytest.mark.medium
def test_scans_keep_their_pixels_and_their_holes(views, toposeam):
    ran = joined(toposeam, *CROPS, "-o", "out.png", "--labels", "labels.png", "-v")
    assert "kept" not in ran.out
    assert "t.png: found at 130.0,24.0 (correlation 1.00)" in ran.out
    assert_untouched(pixels(), pixels("labels.png"), (194, 350))


def assert_untouched(picture, labels, shape):
    assert picture.shape == (*shape, 4)
    for name, value in zip(CROPS, (0, 255), strict=True):
        (x, y), (width, height) = CROPS[name], CROP_SIZE
        place = np.s_[y : y + height, x : x + width]
        shown = (labels[place] == value) & (picture[place][..., 3] == 255)
        assert shown.sum() > 5000
        np.testing.assert_array_equal(picture[place][..., :3][shown], crop(name)[shown])


@pytest.mark.medium
def test_scans_as_photographs_are_matched_blended_cropped(views, toposeam):
    darkened(views, "t.png", 0.7)
    place = "--offset", "130,24"
    photographs = *CROPS, *place, "--as", "photographs"
    assert "% kept" in joined(toposeam, *photographs, "-o", "out.png").out
    explicit = "--match-shading", "--blend", "multiband", "--crop", "fit"
    joined(toposeam, *CROPS, *place, *explicit, "-o", "explicit.png")
    assert Path("out.png").read_bytes() == Path("explicit.png").read_bytes()
    joined(toposeam, *photographs, "--blend", "none", "-o", "hard.png")
    joined(toposeam, *CROPS, *place, "--match-shading", "--crop", "fit", "-o", "shaded.png")
    assert Path("hard.png").read_bytes() == Path("shaded.png").read_bytes()
    joined(toposeam, *photographs, "--no-match-shading", "--crop", "outside", "-o", "stepped.png")
    joined(toposeam, *CROPS, *place, "--blend", "multiband", "-o", "blended.png")
    assert Path("stepped.png").read_bytes() == Path("blended.png").read_bytes()
    assert Path("stepped.png").read_bytes() != Path("out.png").read_bytes()


# Options that say how


@pytest.mark.medium
@pytest.mark.parametrize("projection", ["flat", "cylinder", "sphere", "panini"])
def test_each_projection_shows_the_scene(views, toposeam, scene, projection):
    words = *TWO, "--crop", "outside", "--save-layout", "out.toml", "-o", "out.png"
    assert f"projection {projection}\n" in joined(toposeam, *words, "--projection", projection, "-v").out
    transforms, _ = layout_of("out.toml", SIZE)
    assert {one.projection for one in transforms.values()} == {projection}
    assert_placed(scene)


@pytest.mark.medium
def test_a_plane_where_it_is_asked_for(views, toposeam, scene):
    words = *TWO, "--model", "plane", "--crop", "outside"
    plane = told(toposeam, *words, "--save-layout", "out.toml", "-o", "out.png")
    assert plane["model"] == "plane"
    assert plane["focal_px"] is None
    assert plane["misfit_px"] < 0.3
    assert "matrix = " in Path("out.toml").read_text()
    assert_placed(scene)
    joined(toposeam, "out.toml", "--crop", "outside", "-o", "again.png")
    assert Path("again.png").read_bytes() == Path("out.png").read_bytes()
    toposeam("stitch", "out.toml", "--save-layout", "plane.pto", "-o", "third.png").fails(
        "a Hugin project is of pictures that one camera took from one place"
    )
    assert not Path("third.png").exists()
    toposeam("stitch", *words, "--save-layout", "plane.pto", "-o", "third.png").fails(
        "a Hugin project is of pictures that one camera took from one place"
    )
    assert not Path("third.png").exists()


@pytest.mark.medium
def test_a_layout_that_is_impossible_costs_no_picture(views, toposeam):
    ran = joined(toposeam, *CROPS, "--save-layout", "crops.pto", "-o", "out.png")
    assert "crops.pto was not written: a Hugin project is of pictures that one camera took" in ran.err
    assert Path("out.png").exists()
    assert not Path("crops.pto").exists()


@pytest.mark.medium
def test_moves_and_turns_where_they_are_asked_for(views, toposeam):
    assert told(toposeam, *CROPS, "--model", "shift", "-o", "shift.png")["model"] == "shift"
    Image.fromarray(data.coffee()).rotate(2, Image.Resampling.BICUBIC, center=(390, 210)).crop(
        (280, 124, 500, 294)
    ).save("turned.png")
    words = "s.png", "turned.png", "-o", "similar.png", "--json"
    found = json.loads(joined(toposeam, *words, "--model", "similarity").out)
    assert found["placement"]["model"] == "similarity"
    turns = [layer["turn"] for layer in found["layers"]]
    assert abs(turns[1] - turns[0]) == pytest.approx(2, abs=0.2)


@pytest.mark.medium
@pytest.mark.parametrize("words", [("--model", "shift"), ("--model", "similarity"), ("--exact",)])
def test_views_from_one_point_are_no_scans(sole, words):
    sole("a.png and b.png cannot be placed: ", *TWO, *words)


@pytest.mark.medium
def test_the_picture_in_the_middle_by_number_and_name(views, toposeam):
    for words in (("0", "number"), ("a.png", "name")):
        ends = "--save-layout", f"{words[1]}.toml", "-o", f"{words[1]}.png"
        joined(toposeam, *TWO, "--centre", words[0], *ends)
    assert Path("number.png").read_bytes() == Path("name.png").read_bytes()
    a, b = looks("name.toml")
    assert a == pytest.approx((0, 0), abs=1e-6)
    assert b == pytest.approx((19.9, 3.3), abs=1)
    a, b = looks("two.toml")
    assert a[0] == pytest.approx(-b[0], abs=2)


def looks(layout):
    """Yaw to the right and pitch upwards of each view of a layout, degrees."""
    transforms, _ = layout_of(layout, SIZE)
    turns = [transform.rotation for transform in transforms.values()]
    return [tuple(np.degrees([math.atan2(turn[0, 2], turn[2, 2]), math.asin(-turn[1, 2])])) for turn in turns]


@pytest.mark.medium
def test_without_a_level_horizon_the_middle_is_upright(views, toposeam):
    joined(toposeam, *TWO, "--no-level", "--centre", "1", "--save-layout", "out.toml", "-o", "out.png")
    transforms, _ = layout_of("out.toml", SIZE)
    np.testing.assert_allclose(transforms["b.png"].rotation, np.eye(3), atol=1e-6)
    assert abs(transforms["a.png"].rotation[1, 0]) > 0.02  # it was held otherwise
    level = "--projection", "cylinder", "--save-layout", "level.toml", "-o", "level.png"
    joined(toposeam, *TWO, "--centre", "1", *level)
    transforms, _ = layout_of("level.toml", SIZE)
    assert np.abs(transforms["b.png"].rotation - np.eye(3)).max() > 0.01


@pytest.mark.medium
def test_a_horizon_lies_level(views, toposeam):
    line = np.array([[10.0, 30.0], [80.0, 48.0]])
    words = "--horizon", "b.png=10,30,80,48"
    joined(toposeam, *TWO, *words, "--save-layout", "out.toml", "-o", "out.png")
    transforms, _ = layout_of("out.toml", SIZE)
    across, down = np.diff(transforms["b.png"].to_canvas(line), axis=0)[0]
    assert across > 60
    assert abs(down) < 0.02
    joined(toposeam, "two.toml", *words, "-o", "again.png")
    assert Path("again.png").read_bytes() == Path("out.png").read_bytes()


@pytest.mark.medium
def test_scans_are_straightened(views, toposeam):
    rng = np.random.default_rng(0)
    page = np.full((360, 520), 245, np.uint8)
    for top in range(30, 330, 18):
        letters = rng.random((8, 440)) < 0.4
        page[top : top + 8, 40:480][letters] = 30
    turned = Image.fromarray(page).rotate(-2.5, Image.Resampling.BICUBIC, fillcolor=245)
    for name, left in (("u.png", 0), ("v.png", 200)):
        turned.crop((left, 0, left + 320, 360)).save(name)
    joined(toposeam, "u.png", "v.png", "--straighten", "--save-layout", "level.toml", "-o", "out.png")
    transforms, _ = layout_of("level.toml", (320, 360))
    turns = [np.degrees(np.arctan2(*one.matrix[[1, 0], 0])) for one in transforms.values()]
    assert turns == pytest.approx([-2.5, -2.5], abs=0.1)
    assert 'as = "scans"' in Path("level.toml").read_text()
    joined(toposeam, "level.toml", "-o", "again.png")
    assert Path("again.png").read_bytes() == Path("out.png").read_bytes()
    placed = "--row", "--overlap", "120", "--straighten"
    joined(toposeam, "u.png", "v.png", *placed, "--save-layout", "row.toml", "-o", "row.png")
    transforms, _ = layout_of("row.toml", (320, 360))
    assert np.degrees(np.arctan2(*transforms["u.png"].matrix[[1, 0], 0])) == pytest.approx(-2.5, abs=0.1)


@pytest.mark.medium
def test_focal_length_and_lens_are_kept_as_given(views, toposeam):
    mm = round(equivalent_mm(FOCAL, SIZE)) + 0.5
    given = told(toposeam, *TWO, "--model", "rotation", "--focal", mm, "--lens", "0", "-o", "out.png")
    assert given["focal_mm"] == pytest.approx(mm)
    assert given["distortion"] == 0
    bent = told(toposeam, *TWO, "--model", "rotation", "--lens", "0.02", "-o", "bent.png")
    assert bent["distortion"] == 0.02


@pytest.mark.parametrize(
    ("words", "phrase"),
    [
        (("--exact", "--model", "rotation"), "--exact is for moves, turns and scales, not for --model rot"),
        (("--exact", "--model", "plane"), "--exact is for moves, turns and scales, not for --model plane"),
        (("--exact", "--focal", "28"), "--focal is for a camera that turns, not for --exact"),
        (
            ("--model", "plane", "--projection", "flat"),
            "--projection is for a camera that turns, not for --m",
        ),
        (("--model", "shift", "--lens", "0"), "--lens is for a camera that turns, not for --model shift"),
        (("--model", "plane", "--no-level"), "--no-level is for a camera that turns"),
        (("--centre", "2"), "--centre 2 is none of the pictures; give a number from 0 to 1, or a name, like"),
        (("--centre", "c.png"), "--centre c.png is none of the pictures"),
        (("--horizon", "c.png=1,2,3,4"), "'c.png' is no picture of this job"),
        (("--horizon", "1=1,2,1,2"), "whose ends the canvas does not show apart"),
        (("--straighten", "--focal", "28"), "--straighten is for scans, not for --focal; leave one of them"),
        (("--straighten", "--model", "rotation"), "--straighten is for scans, not for --model rotation"),
        (("--straighten", "--horizon", "1=1,2,9,2"), "--straighten and --horizon both turn the picture"),
        (("--centre", "-1"), "--centre -1 is none of the pictures"),
        (("--exact", "--fov", "60"), "--fov is for a camera that turns, not for --exact"),
        (("--offset", "9,9", "--model", "plane"), "--model is for places that are found"),
        (("--overlap", "40", "--centre", "0"), "--centre is for places that are found, and here they are"),
        (("--blend-width", "8", "--as", "scans"), "blend none has no width, but 8 px was given"),
    ],
)
def test_options_that_contradict_each_other(sole, words, phrase):
    sole(phrase, *CROPS, *words)


@pytest.mark.parametrize(
    "words",
    [
        ("--model", "lens"),
        ("--projection", "fisheye"),
        ("--focal", "0"),
        ("--focal", "nan"),
        ("--lens", "0.6"),
        ("--lens", "b"),
        ("--fov", "0"),
        ("--fov", "361"),
        ("--horizon", "1=1,2,3"),
        ("--horizon", "1=1,2,3,nan"),
        ("--horizon", "1,2,3,4"),
        ("--as", "paintings"),
    ],
)
def test_values_that_options_do_not_have(sole, words):
    sole(f"Invalid value for '{words[0]}'", *CROPS, *words, code=2)


@pytest.mark.parametrize(
    "words", [("--focal", "28"), ("--exact",), ("--centre", "0"), ("--model", "plane"), ("--no-level",)]
)
def test_a_layout_leaves_nothing_to_be_found(sole, words):
    sole(
        f"{words[0]} is for places that are found, and here they are given; leave it out", "two.toml", *words
    )


# Layouts


@pytest.mark.medium
def test_a_saved_layout_gives_the_same_picture(views, toposeam):
    joined(toposeam, *THREE, "--save-layout", "pano.toml", "-o", "out.png")
    joined(toposeam, "pano.toml", "--save-layout", "pano.pto", "-o", "again.png")
    assert Path("again.png").read_bytes() == Path("out.png").read_bytes()
    joined(toposeam, "pano.pto", "-o", "third.png")
    np.testing.assert_array_equal(pixels("third.png"), pixels())


@pytest.mark.medium
def test_the_field_of_view_is_as_wide_as_asked(views, toposeam):
    view = "--fov", "40", "--projection", "cylinder", "--crop", "outside"
    joined(toposeam, *THREE, *view, "--save-layout", "pano.toml", "-o", "out.png")
    layout = read_layout(Path("pano.toml"))
    assert {layer.transform.fov for layer in layout.layers} == {40.0}
    radius = layout.layers[0].transform.radius
    assert pixels().shape[1] == pytest.approx(radius * math.radians(40), abs=2)
    joined(toposeam, "pano.toml", "--crop", "outside", "-o", "again.png")
    assert Path("again.png").read_bytes() == Path("out.png").read_bytes()


@pytest.mark.medium
def test_layouts_name_pictures_from_where_they_are_saved(views, toposeam):
    joined(toposeam, "two.toml", "--save-layout", "two.pto", "-o", "out.png")
    text = Path("two.pto").read_text()
    assert re.findall(r'n"([abc]\.png)"', text) == list(TWO)
    (views / "deep").mkdir()
    joined(toposeam, "two.pto", "--save-layout", "deep/two.toml", "-o", "again.png")
    assert 'file = "../a.png"' in Path("deep/two.toml").read_text()
    joined(toposeam, "deep/two.toml", "-o", "third.png")
    np.testing.assert_array_equal(pixels("third.png"), pixels())


CAMERAS = """
[view]
projection = "cylinder"
radius = {radius}
{wrap}
[[layer]]
file = "a.png"
size = [260, 200]
focal = 230
yaw = -20
pitch = -1
roll = -1
{more}
[[layer]]
file = "b.png"
size = [260, 200]
focal = 230.0
pitch = 2
roll = 1
"""


def cameras(radius="230", wrap="", more=""):
    return CAMERAS.format(radius=radius, wrap=wrap, more=more)


def test_a_layout_of_cameras_that_is_written_by_hand(views, toposeam, scene):
    (views / "hand.toml").write_text(cameras())
    ran = joined(toposeam, "hand.toml", "--crop", "outside", "-o", "out.png")
    assert ran.err == ""
    assert_placed(scene, "hand.toml")


def matrices(first, second="at = [100, 0]"):
    return f'[[layer]]\nfile = "s.png"\n{first}\n[[layer]]\nfile = "t.png"\n{second}\n'


@pytest.mark.parametrize("factor", [1, 2, -1])
def test_a_matrix_that_moves_leaves_the_pixels(views, toposeam, factor):
    rows = (np.array([[1, 0, 130], [0, 1, 24], [0, 0, 1]]) * factor).tolist()
    (views / "moved.toml").write_text(matrices("at = [0, 0]", f"matrix = {rows}"))
    joined(toposeam, "moved.toml", "-o", "out.png", "--labels", "labels.png")
    assert_untouched(pixels(), pixels("labels.png"), (194, 350))


@pytest.mark.medium
def test_a_matrix_that_enlarges_makes_photographs_larger(views, toposeam):
    twice = "matrix = [[2.0, 0.0, -10.0], [0.0, 2.0, 4.0], [0.0, 0.0, 1.0]]"
    (views / "large.toml").write_text(matrices("at = [0, 0]", twice))
    joined(toposeam, "large.toml", "-o", "out.ora")
    layers = {layer.name: layer for layer in read_ora(Path("out.ora"), 10**6)}
    whole = joined(toposeam, "large.toml", "-o", "out.png").out
    assert pixels_shape(whole) == (4 + 339, 10 - 10 + 449 - 20 + 10)
    assert layers["t.png"].picture.pixels.shape[1] > 220


WRONG = {
    "wrap of -1": (cameras(wrap="wrap = -1"), "view: wrap is -1; write a whole number of pixels"),
    "wrap of a text": (cameras(wrap='wrap = "all"'), "wrap is 'all'; write a whole number of pixels"),
    "wrap of another turn": (cameras(wrap="wrap = 300"), "whose whole turn is 1445 px wide, and wrap is 300"),
    "wrap of a flat canvas": (
        cameras(wrap="wrap = 1445").replace("cylinder", "flat"),
        "view: projection flat does not go all the way round",
    ),
    "no such projection": (
        cameras().replace("cylinder", "mercator"),
        "view: projection is 'mercator'; write one of flat, cylinder, sphere, panini",
    ),
    "radius of nothing": (cameras(radius="0"), "view: radius is 0; write a number from 0.001 to 1e+09"),
    "radius beyond memory": (cameras(radius="1e8"), "more than 16 megapixels; check where they lie"),
    "no radius": (cameras().replace("radius", "wide"), "write projection, radius and perhaps wrap"),
    "no view": (
        cameras()[cameras().index("[[layer]]") :],
        "layer 1 is seen by a camera; add [view] with its projection and radius",
    ),
    "no focal length": (cameras().replace("focal = 230\n", ""), "layer 1 has no focal"),
    "no size": (cameras().replace("size = [260, 200]", "", 1), "layer 1 has no size"),
    "another size": (
        cameras().replace("[260, 200]", "[200, 260]", 1),
        "a.png is 260 × 200 px, and its layout speaks of 200 × 260",
    ),
    "two of three of a lens": (cameras(more="lens = [0, 0]"), "layer 1: lens is [0, 0]; write 3 numbers"),
    "all round, and not": (
        cameras(more="").replace("[view]", "[view]\nfov = 90\nwrap = 1445"),
        "a canvas with fov does not go all the way round; leave wrap or fov out",
    ),
    "no field of view": (
        cameras(more="").replace("[view]", "[view]\nfov = 0"),
        "view: fov is 0; write a number from 0.001 to 360",
    ),
    "a camera at a place": (cameras(more="at = [0, 0]"), "says twice where it lies, by at and by size"),
    "behind": (
        cameras(more="").replace("yaw = -20", "yaw = 180").replace("cylinder", "flat"),
        "the canvas shows nothing of a.png; choose another projection",
    ),
    "two rows": (matrices("matrix = [[1, 0, 0], [0, 1, 0]]"), "layer 1: matrix is [[1, 0, 0], [0, 1, 0]]"),
    "two columns": (matrices("matrix = [[1, 0], [0, 1], [0, 0]]"), "layer 1: matrix is [1, 0]; write 3 num"),
    "singular": (
        matrices("matrix = [[1, 0, 0], [2, 0, 0], [0, 0, 1]]"),
        "layer 1: matrix has no inverse; write that of a homography",
    ),
    "no numbers": (matrices('matrix = [[1, 0, "x"], [0, 1, 0], [0, 0, 1]]'), "matrix is 'x'; write a number"),
    "infinite": (matrices("matrix = [[1, 0, inf], [0, 1, 0], [0, 0, 1]]"), "matrix is inf; write a number"),
    "two ways": (
        matrices("at = [0, 0]\nmatrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]"),
        "layer 1 says twice where it lies, by at and by matrix; leave one of them out",
    ),
    "enlarged beyond memory": (
        matrices("matrix = [[1000, 0, 0], [0, 1000, 0], [0, 0, 1]]"),
        "more than 16 megapixels; check where they lie",
    ),
    "all behind": (matrices("matrix = [[1, 0, 0], [0, 1, 0], [-9, -9, 1e-6]]"), "shows nothing of s.png"),
}


@pytest.mark.parametrize(("text", "phrase"), WRONG.values(), ids=WRONG)
def test_a_layout_that_makes_no_sense_is_refused(sole, views, text, phrase):
    (views / "wrong.toml").write_text(text)
    sole(phrase, "wrong.toml")


# All the way round


@pytest.fixture(scope="session")
def turn(tmp_path_factory, around):
    """Nine views all the way round, joined; what was told."""
    folder = tmp_path_factory.mktemp("turn")
    for name, angles in ROUND.items():
        camera = around.camera(ROUND_SIZE, ROUND_FOCAL, *angles)
        write_picture(folder / name, Picture(pixels=view(around, camera, ROUND_SIZE)))
    before = Path.cwd()
    os.chdir(folder)
    try:
        words = *ROUND, "--crop", "outside", "--save-layout", "turn.toml", "-o", "turn.png", "-v"
        ran = CliRunner().invoke(main, ["stitch", *words])
    finally:
        os.chdir(before)
    assert ran.exit_code == 0, ran.output
    return folder, ran.stdout


@pytest.mark.slow
def test_a_whole_turn_is_as_wide_as_it_wraps(turn, around):
    folder, out = turn
    assert ", all the way round\n" in out
    layout = read_layout(folder / "turn.toml")
    whole = pixels(folder / "turn.png")
    assert whole.shape[1] == layout.wrap == pytest.approx(2 * math.pi * ROUND_FOCAL, rel=0.01)
    assert (whole[whole.shape[0] // 2, :, 3] == 255).all()
    transforms, origin = layout_of(folder / "turn.toml", ROUND_SIZE)
    behind = max(transforms, key=lambda name: abs(math.atan2(*transforms[name].rotation[[0, 2], 2])))
    for roll in (0, layout.wrap // 2):  # where it begins and ends lies in the middle, then
        off = farthest_off(
            around,
            np.roll(whole, -roll, axis=1),
            origin + np.array([roll, 0]),
            transforms[behind],
            around.camera(ROUND_SIZE, ROUND_FOCAL, *ROUND[behind]),
        )
        assert len(off) >= 6
        assert max(off) < 0.6


@pytest.mark.slow
def test_the_edges_of_a_whole_turn_join(turn):
    whole = pixels(turn[0] / "turn.png").astype(float)
    rows = np.flatnonzero((whole[..., 3] == 255).all(axis=1))
    steps = np.abs(np.roll(whole, -1, axis=1) - whole)[rows][..., :3].mean(axis=(0, 2))
    assert steps[-1] <= 1.5 * max(*steps[-4:-1], *steps[:3])
    far = np.abs(whole[rows, 0] - whole[rows, whole.shape[1] // 2]).mean()
    assert steps[-1] < far / 2


@pytest.mark.slow
@pytest.mark.parametrize("layout", ["turn.toml", "turn.pto"])
def test_a_saved_whole_turn_gives_the_same_picture(turn, toposeam, tmp_path, monkeypatch, layout):
    shutil.copytree(turn[0], tmp_path / "turn")
    monkeypatch.chdir(tmp_path / "turn")
    if layout == "turn.pto":
        joined(toposeam, "turn.toml", "--save-layout", layout, "-o", "once.jpg")
        assert pixels("once.jpg").shape[1] == pixels("turn.png").shape[1]
    joined(toposeam, layout, "--crop", "outside", "-o", "again.png")
    np.testing.assert_array_equal(pixels("again.png"), pixels("turn.png"))


# Pictures that do not go together


@pytest.fixture
def other(views):
    """Write a picture of some kind beside the views; its name."""

    def write(kind):
        second = Image.fromarray(read_picture("b.png").pixels)
        if kind == "stranger":
            Image.fromarray(data.immunohistochemistry()[:130, :160]).save("stranger.png")
        elif kind == "white":
            (views / "white.png").write_bytes(white())
        elif kind == "dot":
            Image.new("RGB", (1, 1), "red").save("dot.png")
        elif kind == "again":
            second.save("again.png")
        elif kind == "blurred":
            second.filter(ImageFilter.GaussianBlur(6)).save("blurred.png")
        elif kind == "gray":
            second.convert("L").save("gray.png")
        elif kind == "alpha":
            cover = np.full(SIZE[::-1], 255, np.uint8)
            cover[:60] = 0
            Image.fromarray(np.dstack([np.asarray(second), cover])).save("alpha.png")
        else:
            tifffile.imwrite("deep.tif", np.asarray(second).astype(np.uint16) * 257, photometric="rgb")
        return "deep.tif" if kind == "deep" else f"{kind}.png"

    return write


@pytest.mark.medium
@pytest.mark.parametrize(
    ("kind", "why"),
    [
        ("stranger", "shares"),
        ("white", "shows too little"),
        ("dot", "shows too little"),
        ("blurred", "shares"),
    ],
)
def test_what_does_not_belong_is_left_out(views, toposeam, other, kind, why):
    ran = joined(toposeam, other(kind), *TWO, "-o", "out.png")
    assert re.fullmatch(rf"left out: {kind}\.png {why}[^\n]+\n", ran.err)
    assert Path("out.png").read_bytes() == Path("two.png").read_bytes()


@pytest.mark.medium
@pytest.mark.parametrize("kind", ["stranger", "white", "dot", "blurred"])
def test_one_picture_and_what_does_not_belong_are_refused(sole, other, kind):
    name = other(kind)
    sole(f"a.png and {name} cannot be placed: ", "a.png", name)


@pytest.mark.medium
def test_the_same_picture_twice(views, toposeam, other, sole):
    again = other("again")
    sole("both cover the same ground, so that there is nothing to join", "b.png", again)
    ran = joined(toposeam, "a.png", "b.png", again, "-o", "out.png", "--save-layout", "out.toml")
    assert re.fullmatch(r"warning: (b|again)\.png does not show, as others cover it[^\n]+\n", ran.err)
    transforms, _ = layout_of("out.toml", SIZE)
    corner = np.array([[0.0, 0.0], [259, 199]])
    np.testing.assert_allclose(
        transforms["again.png"].to_canvas(corner), transforms["b.png"].to_canvas(corner), atol=0.1
    )


@pytest.mark.medium
@pytest.mark.parametrize("kind", ["gray", "alpha", "deep"])
def test_pictures_of_other_kinds_are_placed_alike(views, toposeam, scene, other, kind):
    name = other(kind)
    ends = "--crop", "outside", "--save-layout", "out.toml", "-o", "out.tif"
    assert joined(toposeam, "a.png", name, *ends).err == ""
    text = Path("out.toml").read_text().replace(name, "b.png")
    Path("out.toml").write_text(text)
    whole = read_picture("out.tif")
    assert whole.pixels.dtype == (np.uint16 if kind == "deep" else np.uint8)
    level = 257 if kind == "deep" else 1
    picture = np.dstack([whole.pixels // level, whole.alpha // level]).astype(np.uint8)
    write_picture("out.png", Picture(pixels=picture[..., :3], alpha=picture[..., 3]))
    assert_placed(scene)
    joined(toposeam, "two.toml", "--crop", "outside", "-o", "usual.png")
    covered, usual = (np.count_nonzero(one[..., 3]) for one in (picture, pixels("usual.png")))
    assert covered < 0.97 * usual if kind == "alpha" else covered == pytest.approx(usual, rel=0.01)


@pytest.mark.medium
def test_portrait_beside_landscape_as_cameras_note_them(views, toposeam, scene):
    size = SIZE[1], SIZE[0]
    upright = view(scene, scene.camera(size, FOCAL, *ANGLES["b.png"]), size)
    noted = Image.Exif()
    noted[0x0112] = 6  # the picture lies on its left side
    noted.get_ifd(0x8769)[0xA405] = round(equivalent_mm(FOCAL, SIZE))
    lying = Image.fromarray(upright).transpose(Image.Transpose.ROTATE_90)
    lying.save("portrait.jpg", quality=97, exif=noted)
    ends = "--crop", "outside", "--save-layout", "out.toml", "-o", "out.png"
    placement = told(toposeam, "a.png", "portrait.jpg", *ends)
    assert placement["model"] == "rotation"
    assert placement["focal_px"] == pytest.approx(FOCAL, rel=0.02)
    transforms, _ = layout_of("out.toml", SIZE)
    assert transforms["portrait.jpg"].size == size
    true = scene.camera(size, FOCAL, *ANGLES["b.png"])
    reached = [reach(one, one.size)[0] for one in transforms.values()]
    origin = np.floor(np.min(reached, axis=0)).astype(int)
    off = farthest_off(scene, pixels(), origin, transforms["portrait.jpg"], true)
    assert len(off) >= 5
    assert max(off) < 0.5
    joined(toposeam, "out.toml", "--crop", "outside", "-o", "again.png")
    np.testing.assert_array_equal(pixels("again.png"), pixels())


@pytest.mark.medium
def test_a_corrupt_picture_counts_but_is_left_out(views, toposeam, sole):
    (views / "bad.jpg").write_bytes(b"\xff\xd8\xff broken")
    sole("bad.jpg", "bad.jpg", *TWO)
    skipped = "bad.jpg", *TWO, "--skip-bad"
    ran = joined(toposeam, *skipped, "--centre", "1", "--save-layout", "out.toml", "-o", "out.png")
    assert re.fullmatch(r"left out: cannot read 'bad\.jpg'[^\n]+\n", ran.err)
    a, _ = looks("out.toml")
    assert a == pytest.approx((0, 0), abs=1e-6)
    mm = round(equivalent_mm(FOCAL, SIZE)) + 0.5
    assert told(toposeam, *skipped, "--focal", mm, "-o", "own.png")["focal_mm"] == pytest.approx(mm)
    joined(toposeam, *skipped, "--centre", "0", "-o", "usual.png")  # the one that is left out
    assert Path("usual.png").read_bytes() == Path("two.png").read_bytes()


# Larger than memory


@pytest.mark.medium
@pytest.mark.parametrize("output", ["out.tif", "out.jpg"])
def test_windows_of_a_layout_are_the_picture_in_memory(views, toposeam, monkeypatch, output):
    joined(toposeam, "two.toml", "-o", f"memory-{output}")
    monkeypatch.setattr(placing, "STORED_PIXELS", 0)
    ran = joined(toposeam, "two.toml", "-o", output, "-j", "1")
    assert "% kept" in ran.out
    assert_alike(pixels(output), pixels(f"memory-{output}"))


@pytest.mark.slow
def test_windows_by_two_processes_are_the_picture_in_memory(views, toposeam, monkeypatch):
    monkeypatch.setattr(placing, "STORED_PIXELS", 0)
    before = set(views.iterdir())
    words = *TWO, "-o", "out.png", "--save-layout", "out.toml", "-j", "2", "--json"
    assert told(toposeam, *words)["model"] == "rotation"
    assert_alike(pixels("out.png"), pixels("two.png"))
    assert Path("out.toml").read_text() == Path("two.toml").read_text()
    assert {path.name for path in set(views.iterdir()) - before} == {"out.png", "out.toml"}


def assert_alike(picture, expected):
    assert picture.shape == expected.shape
    assert np.abs(picture.astype(int) - expected).max() <= 1


def test_a_fisheye_is_named_where_nothing_can_be_placed(views, sole, tmp_path):
    y, x = np.mgrid[:120, :160] - np.array([60, 80])[:, np.newaxis, np.newaxis]
    seen = np.where(np.hypot(x, y) < 60, np.random.default_rng(0).integers(60, 255, x.shape), 0)
    for name in ("one.png", "two.png"):
        Image.fromarray(seen.astype(np.uint8)).save(name)
        seen = seen[::-1, ::-1].T[: len(seen)] if name == "one.png" else seen
    sole("one.png seems to be taken with a fisheye: make such pictures flat first", "one.png", "two.png")


@pytest.mark.medium
def test_groups_are_joined_into_files_of_their_own(views, toposeam, sole):
    for number, left in enumerate((0, 150)):
        own = data.astronaut()[200:400, 100 + left : 350 + left]
        write_picture(f"s{number}.png", Picture(pixels=np.ascontiguousarray(own)))
    words = *THREE, "s0.png", "s1.png", "--groups"
    sole("leave it or --groups out", *words, "--keep", "0=a.png")
    Path("out-2.png").write_bytes(b"kept")
    sole("'out-2.png' exists already", *words)
    sole("--contact shows pictures in one file, not .ora", *words, "-o", "all.ora", "--contact", "sheet.png")
    sole("two outputs have the same name", *words, "-o", "n.png", "--contact", "n.png")
    files = "-o", "all.png", "--save-layout", "all.toml", "--contact", "sheet.png"
    ran = joined(toposeam, *words, *files, "--centre", "b.png", "--json")
    assert ran.err == ""
    assert read_picture("all-2.png").pixels.shape == (200, 400, 3)
    assert [layer.name for layer in read_layout(Path("all-2.toml")).layers] == ["s0.png", "s1.png"]
    sheet = np.asarray(Image.open("sheet.png"))
    assert sheet.shape[1] == 1600
    for name in ("all.png", "all-2.png"):  # both are there, as large as they are
        corner = read_picture(name).pixels[20:28, 20:28]
        rows, columns = np.nonzero((sheet == corner[0, 0]).all(axis=2))
        assert any(
            np.array_equal(sheet[y : y + 8, x : x + 8], corner) for y, x in zip(rows, columns, strict=True)
        )
    found = json.loads(ran.out)
    assert [part["placement"]["used"] for part in (found, *found["groups"])] == [3, 2]


def test_points_are_read_from_a_table(views, toposeam, sole):
    for name in ("left.png", "right.png"):
        write_picture(name, Picture(pixels=np.full((60, 80, 3), 120, np.uint8)))
    points = [(50, 5), (75, 20), (60, 50), (72, 40)]
    lines = ["# marked by hand", *(f"0, {x}, {y}, right.png, {x - 40}, {y - 3}" for x, y in points)]
    Path("points.csv").write_text("\n".join(lines))
    words = "left.png", "right.png", "--points", "points.csv", "-v"
    ran = joined(toposeam, *words, "-o", "all.png")
    assert "right.png: found at 40.0,3.0 (by given points)" in ran.out
    turned = [f"right.png, {x - 40}, {y - 3}, left.png, {x}, {y}" for x, y in points[::2]]
    Path("points.csv").write_text("\n".join([*lines[:1], *turned, *lines[2::2]]))
    ran = joined(toposeam, *words, "-o", "all.png", "--force")
    assert "right.png: found at 40.0,3.0 (by given points)" in ran.out
    for line, phrase in (
        ("left.png,1,2,right.png,3", "line 6 is not picture, x, y, picture, x, y, like left.png,812,340,"),
        ("left.png,1,2,right.png,3,many", "line 6 is not picture"),
        ("up.png,1,2,right.png,3,4", "line 6: up.png is none of the pictures; give a number from 0 to 1"),
        ("0,99,2,1,3,4", "a point of pictures 0 and 1 lies outside of them"),
        ("0,9,2,0,3,4", "points of (0, 0) are of no pair"),
    ):
        Path("points.csv").write_text("\n".join([*lines, line]))
        sole(phrase, *words)
    sole("--points is for places that are found, and here they are given", *words, "--offset", "40,3")
    Path("points.csv").write_bytes(b"\xff\xfe\0")
    sole("'points.csv' is not UTF-8", *words)


@pytest.mark.medium
def test_edges_are_filled_as_far_as_asked(views, toposeam, sole):
    words = *TWO, "--json", "-o"
    plain = json.loads(joined(toposeam, *words, "plain.png", "--crop", "inside").out)
    ran = json.loads(joined(toposeam, *words, "filled.png", "--fill-edges", "12").out)
    small, large = pixels("plain.png"), pixels("filled.png")
    left, top = np.subtract(plain["crop"], ran["crop"])[:2]
    assert min(left, top) >= 0
    assert large.shape[0] > small.shape[0]
    assert large.shape[1] >= small.shape[1]
    assert 0 < ran["filled"] < 0.15
    inner = large[top : top + small.shape[0], left : left + small.shape[1]]
    assert (inner[9:-9, 9:-9] == small[9:-9, 9:-9]).mean() > 0.98  # but for a band round what was filled
    assert (large.max(axis=2) == 0).mean() < 0.001  # nothing is left black
    for words in (("--crop", "outside"), ("--background", "white"), ("-o", "out.ora")):
        sole("--fill-edges leaves no holes", *TWO, "--fill-edges", "12", *words)


def test_pictures_give_way_by_a_few_px(views, toposeam, sole):
    whole = data.astronaut()[:120, 100:340]
    rows = np.arange(120)
    off = np.rint(2.5 * np.sin(rows / 25)).astype(int)
    other = np.stack([np.roll(row, -by, axis=0) for row, by in zip(whole, off, strict=True)])
    write_picture("p.png", Picture(pixels=np.ascontiguousarray(whole[:, :150])))
    write_picture("q.png", Picture(pixels=np.ascontiguousarray(other[:, 90:230])))
    words = "p.png", "q.png", "--offset", "90,0"
    plain = json.loads(joined(toposeam, *words, "-o", "plain.png", "--json").out)
    found = json.loads(joined(toposeam, *words, "-o", "bent.png", "--give", "4", "--json").out)
    assert found["cost"] < 0.8 * plain["cost"]
    assert 1 < found["bent_px"] <= 4.5
    assert plain["bent_px"] == 0
    ran = joined(toposeam, *words, "-o", "bent.png", "--give", "4", "--force")
    assert re.search(r", bent by up to \d\.\d px: ", ran.out)
    sole("--give bends pictures, and an .ora file keeps them", *words, "--give", "4", "-o", "out.ora")


@pytest.mark.medium
def test_a_picture_that_is_left_out_is_no_middle(sole, other):
    name = other("white")
    sole(f"{name} is to lie in the middle, but {name} shows too little detail", *TWO, name, "--centre", name)
