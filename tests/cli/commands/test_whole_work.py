"""A layout is the whole work: what it is saved from, and what is made of it again, are the same bytes."""

import hashlib
import json
import os
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image
from three_pictures import AT, FILES, PHOTOGRAPH, crop

from toposeam_cli.commands.stitch import stitch
from toposeam_cli.media.layouts.label_picture import labels_png, read_labels
from toposeam_cli.media.layouts.layout import LayoutStroke, layout_text, read_layout
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.stitching import inputs, saved_layout

#: Layouts that place the three pictures by turns, by perspective, and by a camera.
VIEW = "[view]\nprojection = 'cylinder'\nradius = 90.3\n"
CAMERAS = VIEW + "".join(
    f"[[layer]]\nfile = '{name}.png'\nsize = [60, 50]\nfocal = 88.1\nyaw = {yaw}\npitch = {pitch}\n"
    for name, yaw, pitch in (("a", -15.3, 1.234567), ("b", 9.1, 2.0), ("c", -2.7, -16))
)
#: Two larger ones of a camera that lie some px off.
VIEWED = VIEW.replace("90.3", "900") + "".join(
    f"[[layer]]\nfile = '{name}.png'\nsize = [120, 100]\nfocal = 900\nyaw = {yaw}\n"
    for name, yaw in (("d", 0), ("e", 4))
)
TURNED = "".join(
    f"[[layer]]\nfile = '{name}.png'\nat = [{x}, {y}]\nturn = {turn}\nscale = {scale}\n"
    for name, x, y, turn, scale in (
        ("a", 0.25, 0.1, 0, 1.001),
        ("b", 40.3, 4.123456789, 2.5, 1),
        ("c", 20, 30, -1.1, 0.98),
    )
)
TILTED = "".join(
    f"[[layer]]\nfile = '{name}.png'\nmatrix = [[1, 0.02, {x}], [0.01, 1.01, {y}], [0.0001, {w}, 1.02]]\n"
    for name, x, y, w in (("a", 0, 0, 0), ("b", 40.3, 4.2, 1e-4), ("c", 20, 30, -2e-4))
)


def made(path="out.png"):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def white(path, shape, *places):
    pixels = np.zeros(shape, np.uint8)
    for place in places:
        pixels[place] = 255
    write_picture(Path(path), Picture(pixels=pixels), force=True)


def test_areas_in_words_are_kept(three, toposeam):
    words = ["stitch", *FILES, *AT, "--keep", "1=box:10,10,9,9", "--avoid", "ellipse:50,2,4,4"]
    assert toposeam(*words, "-o", "out.png", "--save-layout", "out.toml").code == 0
    before = made()
    assert toposeam("stitch", "out.toml", "-o", "out.png", "--force").code == 0
    assert made() == before


@pytest.fixture
def work(three):
    """Three pictures, masks and seams beside them, and layouts that place them otherwise."""
    white("mask.png", (50, 60), np.s_[:, 3:])
    white("keep.png", (50, 60), np.s_[30:44, 10:30])
    white("faces.png", (80, 100), np.s_[32:40, 40:60])
    for name, left, top in (("d", 0, 0), ("e", 60, 4)):
        pixels = np.ascontiguousarray(PHOTOGRAPH[top : top + 100, left : left + 120])
        write_picture(three / f"{name}.png", Picture(pixels=pixels))
    for name, text in {"cameras": CAMERAS, "pair": VIEWED, "turned": TURNED, "tilted": TILTED}.items():
        (three / f"{name}.toml").write_text(text)
    return three


@pytest.fixture
def again(work, toposeam):
    """Save a stitch as a layout, and stitch that again from another folder."""

    def run(*words, end="png", ends=()):
        ran = toposeam("stitch", *words, "-o", f"out.{end}", "--save-layout", "saved.toml")
        assert ran.code == 0, ran
        # Its own options, but not those that only the command line has, are in the layout.
        Path("deep").mkdir()
        second = toposeam(
            "stitch", "saved.toml", *ends, "-o", f"deep/again.{end}", "--save-layout", "deep/again.toml"
        )
        assert second.code == 0, second
        third = toposeam("stitch", "deep/again.toml", "-o", f"third.{end}", "--save-layout", "third.toml")
        assert third.code == 0, third
        assert made(f"out.{end}") == made(f"deep/again.{end}") == made(f"third.{end}")
        text = Path("third.toml").read_text()
        assert text.replace("third.labels.png", "saved.labels.png") == Path("saved.toml").read_text()
        return Path("saved.toml").read_text()

    return run


PLACED = (*FILES, *AT)
PAIR = ("a.png", "b.png", "--offset", "40,4")
#: Words of a stitch, the ending of the picture, and what the layout has to hold.
WORKS = {
    "nothing": (PLACED, "png", ['as = "scans"']),
    "photographs": ((*PLACED, "--as", "photographs"), "png", ['as = "photographs"']),
    "seams": ((*PLACED, "--cost", "colour", "--effort", "best"), "png", ['cost = "colour"']),
    "pieces": ((*PLACED, "--core", "0.5", "--speck", "0"), "png", ["core = 0.5", "speck = 0"]),
    "tones": ((*PLACED, "--match-tones"), "png", ["match-tones = true"]),
    "no shading": (
        (*PLACED, "--as", "photographs", "--no-match-shading", "--blend", "feather", "--blend-width", "9"),
        "png",
        ["match-shading = false", 'blend = "feather"', "blend-width = 9.0"],
    ),
    "masks": (
        (*PLACED, "--mask-for", "1=mask.png", "--keep", "c.png=keep.png"),
        "png",
        ['mask = "mask.png"', 'keep = "keep.png"'],
    ),
    "level": ((*PLACED, "--horizon", "b.png=3,4,50,9"), "png", ["turn = -6"]),
    "level cameras": (("cameras.toml", "--horizon", "0=3,4,50,9"), "png", ["roll = -5.42"]),
    "faces": ((*PLACED, "--avoid", "faces.png", "--blend", "soft"), "png", ['avoid = "faces.png"']),
    "crop": ((*PLACED, "--crop", "inside"), "jpg", ['crop = "inside"']),
    "filled": ((*PLACED, "--fill-edges", "4"), "png", ["fill-edges = 4"]),
    "ground": (
        (*PLACED, "--background", "#20304a", "--quality", "70"),
        "jpg",
        ['background = "#20304a"', "quality = 70"],
    ),
    "tiled": (
        (*PLACED, "--pyramid", "--compression", "lzw"),
        "tif",
        ["pyramid = true", 'compression = "lzw"'],
    ),
    "bent": ((*PLACED, "--give", "3"), "png", ["give = 3"]),
    "round": ((*PLACED, "--wrap", "96"), "png", ["wrap = 96"]),
    "heat": ((*PAIR, "--method", "heat"), "png", ['method = "heat"']),
    "thesis": (
        (*PAIR, "--method", "thesis", "--formulation", "1", "--plain"),
        "png",
        ["formulation = 1", "plain = true"],
    ),
    "layers": ((*PLACED, "--blend", "feather"), "ora", ['blend = "feather"']),
    "aligned": (("d.png", "e.png", "--offset=62,5", "--align"), "png", ["at = [60, 4]"]),
    "turned": (("turned.toml", "--give", "2"), "png", ["turn = 2.5", "at = [40.3, 4.123457]"]),
    "tilted": (("tilted.toml", "--keep", "2=keep.png", "--blend", "multiband"), "png", ["matrix = "]),
    "cameras": (("cameras.toml", "--mask-for", "b.png=mask.png"), "jpg", ["yaw = -15.3\n"]),
    "cameras, aligned": (("pair.toml", "--align", "--align-radius", "9"), "png", ["align-radius = 9"]),
}


@pytest.mark.medium
@pytest.mark.parametrize(("words", "end", "phrases"), WORKS.values(), ids=WORKS)
def test_a_layout_makes_the_same_bytes_again(again, words, end, phrases):
    saved = again(*words, end=end)
    for phrase in phrases:
        assert phrase in saved


@pytest.mark.medium
@pytest.mark.parametrize("words", [PLACED, ("tilted.toml",)], ids=["moved", "warped"])
def test_by_windows_as_in_memory(work, again, monkeypatch, words):
    words = *words, "--match-shading", "--blend", "multiband", "--keep", "2=keep.png"
    saved = again(*words, end="tif")
    (in_memory := Path("out.tif")).rename("memory.tif")
    for name in ("saved.toml", "third.toml", "third.tif", "deep/again.toml", "deep/again.tif"):
        Path(name).unlink()
    Path("deep").rmdir()
    monkeypatch.setattr(inputs, "STORED_PIXELS", 0)
    assert again(*words, "-j", "1", end="tif") == saved
    assert in_memory.exists()


@pytest.mark.medium
def test_deep_pictures(work, again):
    for name in "abc":
        tifffile.imwrite(f"{name}.tif", crop(name).astype(np.uint16) * 257, photometric="rgb")
    again("a.tif", "b.tif", "c.tif", *AT, "--match-tones", "--blend", "multiband", end="tif")
    assert read_picture(Path("out.tif")).pixels.dtype == np.uint16


@pytest.mark.medium
def test_seams_that_are_given(work, again, toposeam):
    """Also where a picture was left out, so that the others have other numbers."""
    assert toposeam("stitch", *PLACED, "-o", "first.png", "--seam", "all.svg").code == 0
    saved = again(*PLACED, "--use-seam", "all.svg")
    assert 'use-seam = ["all.svg"]' in saved
    for name in ("saved.toml", "third.toml", "deep/again.toml", "out.png", "third.png", "deep/again.png"):
        Path(name).unlink()
    Path("deep").rmdir()
    toposeam("stitch", "b.png", "c.png", "--at=40,4", "--at=20,30", "-o", "two.png", "--seam", "one.svg")
    Path("bad.png").write_bytes(b"no picture")
    bad = "bad.png", "b.png", "c.png", "--at=0,0", "--at=40,4", "--at=20,30", "--skip-bad"
    assert 'use-seam = ["0:1=one.svg"]' in again(*bad, "--use-seam", "1:2=one.svg", "--keep", "2=keep.png")


def test_two_pictures_of_one_name(work, again):
    Path("other").mkdir()
    write_picture(Path("other/a.png"), Picture(pixels=crop("b")))
    assert 'name = "a.png 2"' in again("a.png", "other/a.png", "--offset", "40,4")


@pytest.mark.medium
def test_whatever_lies_beside_it_wins(work, toposeam):
    """A flag, and with it what the layout says instead."""
    words = *PLACED, "--as", "photographs", "--blend", "feather", "--blend-width", "9", "--fill-edges", "4"
    words = *words, "--match-shading", "--keep", "2=keep.png"
    write_picture(Path("b.png"), Picture(pixels=(crop("b") * 0.8).astype(np.uint8)), force=True)
    assert toposeam("stitch", *words, "-o", "out.png", "--save-layout", "saved.toml").code == 0
    for flags in (
        ("--blend", "none"),
        ("--crop", "outside"),
        ("--match-tones",),
        ("--no-match-shading",),
        ("--keep", "c.png=mask.png"),
        ("--as", "scans", "--blend", "multiband"),
    ):
        given = [flag for flag in flags if flag.startswith("--")]
        rest = list(words)
        for flag in given:
            for other in (flag, *{"--blend": ["--blend-width"], "--crop": ["--fill-edges"]}.get(flag, ())):
                if other in rest:
                    at = rest.index(other)
                    del rest[at : at + 2]
        if flags[0] in ("--match-tones", "--no-match-shading"):
            rest.remove("--match-shading")
        assert toposeam("stitch", "saved.toml", *flags, "-o", "one.png", "--force").code == 0
        assert toposeam("stitch", *rest, *flags, "-o", "two.png", "--force").code == 0
        assert made("one.png") == made("two.png"), flags
        assert made("one.png") != made("out.png") or "--match-tones" in flags
    assert (
        toposeam("stitch", "saved.toml", "--match-tones", "-o", "3.png", "--save-layout", "3.toml").code == 0
    )
    assert "match-tones = true" in Path("3.toml").read_text()
    assert "match-shading" not in Path("3.toml").read_text()


def test_what_a_format_has_no_use_for_is_left_out(work, toposeam):
    words = *PLACED, "--quality", "70", "--background", "white"
    assert toposeam("stitch", *words, "-o", "out.jpg", "--save-layout", "saved.toml").code == 0
    for end in ("png", "ora", "tif"):
        assert toposeam("stitch", "saved.toml", "-o", f"out.{end}").code == 0
    toposeam("stitch", "saved.toml", "--quality", "70", "-o", "two.png").fails("--quality is for .jpg")
    words = *PLACED, "--crop", "outside", "-o", "holes.png", "--save-layout", "holes.toml"
    assert toposeam("stitch", *words).code == 0
    assert toposeam("stitch", "holes.toml", "-o", "none.jpg").code == 0
    assert read_picture(Path("none.jpg")).pixels.size < read_picture(Path("holes.png")).pixels.size
    assert toposeam("stitch", "holes.toml", "--background", "white", "-o", "white.jpg").code == 0
    assert read_picture(Path("white.jpg")).pixels.shape == read_picture(Path("holes.png")).pixels.shape


def test_a_layout_of_before_is_read(work, toposeam):
    """Without a word about choices, those of the command line hold."""
    Path("old.toml").write_text(
        "".join(
            f"[[layer]]\nfile = '{name}.png'\nat = [{at}]\n" for name, at in zip("abc", AT[1::2], strict=True)
        )
    )
    assert toposeam("stitch", "old.toml", "-o", "one.png").code == 0
    assert toposeam("stitch", *PLACED, "-o", "two.png").code == 0
    assert made("one.png") == made("two.png")


@pytest.mark.medium
def test_found_photographs_are_made_again(tmp_path, monkeypatch, toposeam):
    monkeypatch.chdir(tmp_path)
    samples = Path(__file__).parents[3] / "samples"
    words = *(samples / f"portrait_{side}.jpg" for side in ("left", "right")), "--save-layout", "saved.toml"
    assert toposeam("stitch", *words, "-o", "one.jpg").code == 0
    assert toposeam("stitch", "saved.toml", "-o", "two.jpg", "--save-layout", "two.toml").code == 0
    assert made("one.jpg") == made("two.jpg")
    assert Path("two.toml").read_text() == Path("saved.toml").read_text()


def test_every_option_that_changes_pixels_is_kept():
    """Those that place pictures, name files or say how the command works are not."""
    kept = set(saved_layout._kept(stitch))
    assert {"as", "avoid", "blend", "crop", "give", "method", "use-seam", "wrap"} <= kept
    options = {max(each.opts, key=len).lstrip("-"): each for each in stitch.params if each.opts[0][0] == "-"}
    of_search = {name for name, each in options.items() if each.heading in ("Seam", "Tones and blend")}
    assert of_search - kept == {"mask-for", "keep"}  # which layers have
    assert not kept & {"output", "seam", "labels", "overlay", "report", "save-layout", "history"}
    assert not kept & {"force", "quiet", "json", "jobs", "dask", "max-megapixels", "skip-bad"}


STROKES = """
[[stroke]]
layer = "b.png"
kind = "show"
radius = 6.5
points = [[10.0, 20.0], [30.25, 22.5]]

[[stroke]]
layer = 0
kind = "away"
radius = 3
points = [[44, 12]]
"""
LABELS = '\n[labels]\nfile = "placed.labels.png"\nat = [-2.0, 0.5]\nscale = 4.0\n'


def placed_text(*more, hidden=""):
    layers = (
        f"[[layer]]\nfile = '{name}.png'\nat = [{at}]\nvisible = {str(name != hidden).lower()}\n"
        for name, at in zip("abc", AT[1::2], strict=True)
    )
    return "".join([*layers, *more])


def test_strokes_and_labels_are_read(work):
    Path("l.toml").write_text(placed_text(STROKES, LABELS))
    layout = read_layout(Path("l.toml"))
    assert layout.strokes == (
        LayoutStroke(layer=1, kind="show", radius=6.5, points=((10.0, 20.0), (30.25, 22.5))),
        LayoutStroke(layer=0, kind="away", radius=3.0, points=((44.0, 12.0),)),
    )
    assert (layout.labels.file, layout.labels.at, layout.labels.scale) == (
        Path("placed.labels.png"),
        (-2.0, 0.5),
        4.0,
    )
    Path("m.toml").write_text(layout_text(Path(), layout))
    text = layout_text(Path(), read_layout(Path("m.toml")))
    assert text == Path("m.toml").read_text()
    assert 'layer = "a.png"' in text


def test_numbers_count_layers_that_are_not_visible(work):
    Path("l.toml").write_text(placed_text(STROKES, LABELS, hidden="a"))
    layout = read_layout(Path("l.toml"))
    assert [(stroke.layer, stroke.kind) for stroke in layout.strokes] == [(0, "show")]
    assert (layout.numbers, layout.count) == ((1, 2), 3)
    labels = np.array([[0, 1], [2, -1]], np.int16)
    Path("placed.labels.png").write_bytes(labels_png(labels, 3))
    found = read_labels(layout.labels.file, layout.numbers, layout.count, 100)
    np.testing.assert_array_equal(found, [[-1, 0], [1, -1]])


@pytest.mark.parametrize(("count", "dtype"), [(254, np.uint8), (255, np.uint16), (1000, np.uint16)])
def test_labels_of_many_layers(tmp_path, count, dtype):
    labels = np.array([[0, count - 1, -1]], np.int16)
    path = tmp_path / "labels.png"
    path.write_bytes(labels_png(labels, count))
    assert read_picture(path).pixels.dtype == dtype
    np.testing.assert_array_equal(read_labels(path, tuple(range(count)), count, 100), labels)


#: What a layout of a stranger says beside its layers, and what is answered.
HOSTILE = {
    "stitch": ("stitch = 3\n", "stitch is 3; write [stitch]"),
    "unknown": ("[stitch]\ncolour = 3\n", "stitch has 'colour', which is none of align, align-radius, as"),
    "an output": ("[stitch]\nseam = 'x.svg'\n", "stitch has 'seam', which is none of"),
    "a limit": ("[stitch]\nmax-megapixels = 1e6\n", "stitch has 'max-megapixels', which is none of"),
    "force": ("[stitch]\nforce = true\n", "stitch has 'force', which is none of"),
    "twice": ("[stitch]\nblend-width = 3\nblend_width = 4\n", "blend_width is given twice"),
    "choice": ("[stitch]\nblend = 'mud'\n", "stitch, blend: 'mud' is not one of"),
    "range": ("[stitch]\ngive = 1000\n", "stitch, give: 1000 is not in the range"),
    "nan": ("[stitch]\nblend-width = nan\n", "stitch, blend-width: nan is not a finite number"),
    "flag": ("[stitch]\nmatch-tones = 'yes'\n", "stitch, match-tones: 'yes' is neither true nor false"),
    "true": ("[stitch]\ngive = true\n", "stitch, give: True is neither a text nor a number"),
    "list": ("[stitch]\nblend = ['none']\n", "is neither a text nor a number"),
    "table": ("[stitch.blend]\na = 1\n", "is neither a text nor a number"),
    "no name": ("[stitch]\navoid = ' '\n", "stitch, avoid: ' ' is not the name of a file"),
    "number for a file": ("[stitch]\navoid = 3\n", "stitch, avoid: 3 is not the name of a file"),
    "pipe": ("[stitch]\navoid = 'pipe'\n", "is not a regular file"),
    "seam of a pipe": ("[stitch]\nuse-seam = '0:1=pipe'\n", "is not a regular file"),
    "missing": ("[stitch]\navoid = 'none.png'\n", "none.png"),
    "conflict": ("[stitch]\ncrop = 'outside'\nfill-edges = 3\n", "leave one out"),
    "strokes": ("stroke = 7\n", "stroke is 7; write [[stroke]]"),
    "a stroke": ("stroke = [3]\n", "stroke 1 is 3; write layer, kind, radius, points"),
    "half a stroke": ("[[stroke]]\nlayer = 0\n", "write layer, kind, radius, points, and nothing else"),
    "labels": ("labels = 'a.png'\n", "labels is 'a.png'; write file, at, scale"),
    "scale": ("[labels]\nfile = 'a.png'\nat = [0, 0]\nscale = 0\n", "labels: scale is 0; write a number"),
    "corner": ("[labels]\nfile = 'a.png'\nat = [0, inf]\nscale = 2\n", "labels: at is inf; write a number"),
    "no file": ("[labels]\nfile = ''\nat = [0, 0]\nscale = 2\n", "labels: file is ''; write a text"),
    "colours": ("[labels]\nfile = 'a.png'\nat = [0, 0]\nscale = 2\n", "are no gray picture of 8 or 16 bits"),
    "a number": ("[labels]\nfile = 'mid.png'\nat = [0, 0]\nscale = 2\n", "have the number 9, and there are"),
    "a device": ("[labels]\nfile = 'pipe'\nat = [0, 0]\nscale = 2\n", "is not a regular file"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "phrase"), HOSTILE.values(), ids=HOSTILE)
def test_a_layout_of_a_stranger(work, toposeam, text, phrase):
    os.mkfifo("pipe")
    Image.fromarray(np.full((4, 5), 9, np.uint8)).save("mid.png")
    Path("l.toml").write_text(text + placed_text())
    toposeam("stitch", "l.toml", "-o", "out.png").fails(phrase)
    assert not Path("out.png").exists()


def test_labels_are_no_larger_than_memory(work, toposeam, monkeypatch):
    Path("large.png").write_bytes(labels_png(np.zeros((40, 30), np.int16), 3))
    Path("l.toml").write_text("[labels]\nfile = 'large.png'\nat = [0, 0]\nscale = 2\n" + placed_text())
    monkeypatch.setattr(saved_layout, "STORED_PIXELS", 1199)
    toposeam("stitch", "l.toml", "-o", "out.png").fails("'large.png' is 30 x 40 pixels, more than")


@pytest.mark.medium
def test_strokes_and_labels_make_the_same_bytes_again(work, toposeam, again):
    """Seen at half the size, and painted on there; saved with the picture, and saved again."""
    out = "-o", "plain.png", "--labels", "plain.labels.png"
    assert toposeam("stitch", *PLACED, *out).code == 0
    shown = np.rint(read_picture(Path("plain.labels.png")).pixels / 127.5).astype(np.int16)
    Path("half.png").write_bytes(labels_png(shown[::2, ::2], 3))
    stroke = "\n[[stroke]]\nlayer = 'b.png'\nkind = 'show'\nradius = 4\npoints = [[4, 9], [12, 20]]\n"
    labels = "\n[labels]\nfile = 'half.png'\nat = [0, 0]\nscale = 2\n"
    Path("l.toml").write_text(placed_text(stroke, labels))
    saved = again("l.toml")
    assert 'file = "saved.labels.png"' in saved
    assert made("saved.labels.png") == made("deep/again.labels.png") == made("half.png")
    painted = read_picture(Path("out.png")).pixels
    np.testing.assert_array_equal(painted[13, 44], crop("b")[9, 4])
    assert (read_picture(Path("plain.png")).pixels != painted).any()


@pytest.mark.medium
def test_strokes_that_change_nothing_are_told(work, toposeam):
    stroke = "\n[[stroke]]\nlayer = 'b.png'\nkind = 'show'\nradius = 3\npoints = [[500, 500]]\n"
    Path("l.toml").write_text(placed_text(stroke))
    ran = toposeam("stitch", "l.toml", "-o", "out.png")
    assert ran.code == 0
    assert "warning: 1 stroke on b.png changed nothing, as the picture has no pixels there" in ran.err


#: A stroke with one value changed.
STRANGE = {
    "layer": (3, "layer is 3; write the name of a layer, or its number from 0 to 2"),
    "a name": ("layer", "z.png", "layer is 'z.png'"),
    "no number": ("layer", True, "layer is True"),
    "kind": ("paint", "kind is 'paint'; write one of show, hide, away"),
    "radius": (0, "radius is 0; write a number from 0.001"),
    "points": ([], "points is []; write a list"),
    "a point": ("points", [[1, 2, 3]], "points is [1, 2, 3]; write 2 numbers"),
    "far": ("points", [[1, 1e300]], "points is 1e+300; write a number"),
}


@pytest.mark.parametrize("name", STRANGE)
def test_a_stroke_that_makes_no_sense(work, toposeam, name):
    key, value, phrase = STRANGE[name] if len(STRANGE[name]) == 3 else (name, *STRANGE[name])
    stroke = {"layer": 0, "kind": "show", "radius": 3.0, "points": [[1, 2]]} | {key: value}
    layers = [{"file": f"{one}.png", "at": [0, k]} for k, one in enumerate("abc")]
    Path("l.json").write_text(json.dumps({"layer": layers, "stroke": [stroke]}))
    toposeam("stitch", "l.json", "-o", "out.png").fails(f"stroke 1: {phrase}")


def test_a_layout_is_no_larger_than_strokes_of_an_hour(work, toposeam):
    Path("l.toml").write_text(placed_text() + "#" + " " * (4 << 20))
    toposeam("stitch", "l.toml", "-o", "out.png").fails("is larger than 4 MiB, so it is not a layout")
    Path("l.toml").write_text(placed_text(*["[[stroke]]\n"] * 10_001))
    toposeam("stitch", "l.toml", "-o", "out.png").fails("write [[stroke]] for each of 10000 at most")


@pytest.fixture
def idle(monkeypatch):
    """No seam may be searched."""

    def searched(*_, **__):
        raise AssertionError("a seam was searched")

    monkeypatch.setattr("toposeam.stitch", searched)


@pytest.mark.usefixtures("idle")
def test_what_cannot_be_saved_is_told_before_the_work(work, toposeam):
    saving = "-o", "out.png", "--save-layout"
    toposeam("stitch", *PLACED, *saving, "p.pto").fails("a Hugin project is of pictures that one camera took")
    toposeam("stitch", "tilted.toml", *saving, "p.pto").fails(
        "a Hugin project is of pictures that one camera"
    )
    toposeam("stitch", *FILES, "--model", "plane", *saving, "p.pto").fails("a Hugin project is of pictures")
    toposeam("stitch", *PLACED, *saving, "none/p.toml").fails("there is no folder")
    toposeam("stitch", *PLACED, *saving, "p.png").fails("use one of .toml, .pto")
    Path("pictures.ora").write_bytes(b"")
    toposeam("stitch", "pictures.ora", *saving, "p.toml").fails("layers of an .ora file have none")
    Path("a.png").rename(os.fsdecode(b"\xff.png"))
    toposeam("stitch", os.fsdecode(b"\xff.png"), *FILES[1:], *AT, *saving, "p.toml").fails("is not UTF-8")
    assert not list(work.glob("p.*"))


@pytest.mark.usefixtures("idle")
def test_labels_beside_a_layout_are_not_written_over(work, toposeam):
    Path("placed.labels.png").write_bytes(labels_png(np.zeros((3, 3), np.int16), 3))
    Path("l.toml").write_text(placed_text(LABELS))
    Path("saved.labels.png").write_bytes(b"kept")
    words = "stitch", "l.toml", "-o", "out.png", "--save-layout"
    toposeam(*words, "saved.toml").fails("'saved.labels.png' exists already")
    toposeam(*words, "two.toml", "--labels", "two.labels.png").fails(
        "is also where the labels of the layout go"
    )


@pytest.mark.medium
def test_a_project_says_what_it_cannot_hold(work, toposeam):
    words = "stitch", "cameras.toml", "--save-layout", "p.pto", "-o", "out.png", "--force"
    assert "project holds" not in toposeam(*words).err
    ran = toposeam(*words, "--blend", "none", "--keep", "0=keep.png")
    assert "warning: a Hugin project holds places, and not blend, keep; save a layout (.toml)" in ran.err
    assert ran.code == 0


@pytest.mark.medium
def test_a_batch_goes_on_unless_what_a_layout_names_has_changed(work, toposeam):
    words = *PLACED, "--avoid", "faces.png", "--keep", "2=keep.png", "--save-layout", "saved.toml"
    assert toposeam("stitch", *words, "-o", "first.png").code == 0
    Path("jobs.toml").write_text("[[stitch]]\npictures = ['saved.toml']\noutput = 'out.png'\n")
    assert toposeam("batch", "jobs.toml").code == 0
    assert made("out.png") == made("first.png")
    assert "1 done before" in toposeam("batch", "jobs.toml").out
    white("faces.png", (80, 100), np.s_[33:38, 44:56])
    assert "1 done in" in toposeam("batch", "jobs.toml", "--force").out
    assert made("out.png") != made("first.png")


@pytest.mark.medium
def test_cameras_are_shown_in_another_projection(work, toposeam):
    """Strokes go with the pictures; a label map is that of one view."""
    out = "-o", "out.png", "--force"
    for flags, view in (
        (("--projection", "sphere"), ("sphere", None)),
        (("--fov", "40"), ("cylinder", 40)),
        (("--projection", "flat", "--fov", "30"), ("flat", 30)),
    ):
        assert toposeam("stitch", "cameras.toml", *flags, *out, "--save-layout", "saved.toml").code == 0
        camera = read_layout(Path("saved.toml")).layers[0].transform
        assert (camera.projection, camera.fov, camera.radius) == (*view, 90.3)
        before = made()
        assert toposeam("stitch", "saved.toml", *out).code == 0
        assert made() == before
    refused = "is for places that are found, and here they are given; leave it out"
    toposeam("stitch", "cameras.toml", "--focal", "30", *out).fails(f"--focal {refused}")
    without = "shows anew what cameras saw, and here places without cameras are given; let them be found with"
    toposeam("stitch", "tilted.toml", "--projection", "sphere", *out).fails(f"--projection {without}")
    toposeam("stitch", "cameras.toml", "--fov", "0.1", *out).fails("the canvas shows nothing of")


def test_a_view_that_does_not_go_round_is_cut_open(work):
    asked = inputs.PlaceFinding(options=inputs.PlaceOptions(projection="panini"), named=("--projection",))
    layers = read_layout(Path("cameras.toml")).layers
    sources = [inputs._Source(picture=None, name=one.name, transform=one.transform) for one in layers]
    shown, wrap, left = inputs._viewed(sources, 567, asked)
    assert ({one.transform.projection for one in shown}, wrap, left.named) == ({"panini"}, None, ())
    around = inputs.PlaceFinding(options=inputs.PlaceOptions(projection="sphere"), named=("--projection",))
    assert inputs._viewed(sources, 567, around)[1] == 567
    assert inputs._viewed(sources, 567, inputs.PlaceFinding())[1] == 567
