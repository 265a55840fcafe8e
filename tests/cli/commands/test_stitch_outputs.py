"""``toposeam stitch``: what it writes besides the picture, and what it tells."""

import re

import numpy as np
import pytest

import toposeam as ts
from stitching import STRIP, assert_joined, names, shown, told
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture


def test_the_overlay_marks_the_seam_and_nothing_else(folder, toposeam):
    assert (
        toposeam(
            "stitch",
            *STRIP,
            "-o",
            "out.png",
            "--overlay",
            "overlay.png",
            "--labels",
            "labels.png",
            "--cost",
            "gradient",
        ).code
        == 0
    )
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


def test_a_crop_by_hand_is_a_box_of_the_whole(folder, toposeam):
    assert toposeam("stitch", *STRIP, "-o", "all.png", "--crop", "outside").code == 0
    ran = toposeam("stitch", *STRIP, "-o", "box.png", "--crop", " 7, 3,30,20", "--save-layout", "box.toml")
    assert ran.code == 0
    assert "only" not in ran.out
    np.testing.assert_array_equal(read_picture("box.png").pixels, read_picture("all.png").pixels[3:23, 7:37])
    assert toposeam("stitch", "box.toml", "-o", "again.png").code == 0
    assert (folder / "again.png").read_bytes() == (folder / "box.png").read_bytes()


@pytest.mark.parametrize(
    ("crop", "says"),
    [
        ("1,2,3", "'1,2,3' is no crop; write fit, inside, outside, or a box like"),
        ("1,2,0,4", "is no crop"),
        ("9000,0,5,5", "shows no pixel of the picture, which is"),
        ("0,0,9000,9000", None),
    ],
)
def test_a_crop_that_cannot_be_is_one_sentence(folder, toposeam, crop, says):
    ran = toposeam("stitch", *STRIP, "-o", "box.jpg", "--crop", crop)
    assert (ran.code == 0) == (says is None)
    assert says is None or says in ran.err
    assert (folder / "box.jpg").exists() == (says is None)


def test_a_crop_with_holes_needs_transparency(folder, toposeam):
    layout = '[[layer]]\nfile = "{}"\nat = [0, 0]\n\n[[layer]]\nfile = "{}"\nat = [20, 8]\n'
    (folder / "two.toml").write_text(layout.format(*STRIP[:2]))
    ran = toposeam("stitch", "two.toml", "-o", "box.jpg", "--crop", "0,0,60,30")
    assert ran.code == 1
    assert "box of --crop is partly transparent" in ran.err
    assert toposeam("stitch", "two.toml", "-o", "box.png", "--crop", "0,0,60,30").code == 0
    assert read_picture("box.png").alpha is not None


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
    line = (
        "stitch",
        "c.tif",
        "d.tif",
        "--overlap",
        "20",
        "-o",
        "out.tif",
        "--overlay",
        "overlay.png",
        "--labels",
        "labels.png",
    )
    assert toposeam(*line).code == 0
    assert_joined("out.tif", "labels.png", "c.tif", "d.tif", (36, 0))
    drawn = read_picture("overlay.png").pixels
    assert drawn.dtype == np.uint8
    assert drawn.shape == (40, 92, 3)


@pytest.mark.medium
@pytest.mark.parametrize(
    ("suffix", "magic"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF"), (".PNG", b"\x89PNG")]
)
def test_the_history_is_a_figure(folder, toposeam, suffix, magic):
    pytest.importorskip("matplotlib")
    assert toposeam("stitch", *STRIP, "-o", "out.png", "--history", f"history{suffix}").code == 0
    assert (folder / f"history{suffix}").read_bytes().startswith(magic)


@pytest.mark.medium
@pytest.mark.parametrize("where", ["36,0", "30,9"])
def test_the_thesis_has_a_history_too(folder, toposeam, where):
    pytest.importorskip("matplotlib")
    line = (
        "stitch",
        "a.png",
        "b.png",
        f"--offset={where}",
        "--method",
        "thesis",
        "-o",
        "out.png",
        "--history",
        "history.png",
    )
    assert toposeam(*line).code == 0
    height, width, _ = read_picture("history.png").pixels.shape
    assert width > 600
    assert height > 400


@pytest.mark.parametrize("method", ts.seam.METHODS)
def test_json_tells_what_was_found(folder, toposeam, method):
    if method == "graph-cut":
        pytest.importorskip("maxflow")
    ran = toposeam("stitch", *STRIP, "--method", method, "-o", "out.png", "--json")
    (facts,) = told(ran)["seams"]
    assert set(facts) == {
        "between",
        "method",
        "cost",
        "bound",
        "optimum",
        "ratio",
        "stages",
        "iterations",
        "termination",
        "paths",
        "length_px",
        "seconds",
        "likeness",
        "worst_likeness",
        "step",
        "look_at",
    }
    assert facts["between"] == ["a.png", "b.png"]
    judged = [facts[name] is not None for name in ("likeness", "worst_likeness")]
    assert judged == [method != "thesis"] * 2
    assert facts["ratio"] == pytest.approx(facts["cost"] / facts["optimum"])
    assert facts["ratio"] >= 1 - 1e-6  # single precision costs, added up in another order
    assert facts["seconds"] > 0
    assert (facts["paths"], facts["length_px"]) >= (1, 40)
    iterates = method in ("heat", "thesis")
    assert (facts["iterations"] > 0, facts["stages"] > 0, facts["termination"] == "direct") == (
        iterates,
        iterates,
        not iterates,
    )
    assert facts["method"] == ("shortest-path" if method == "auto" else method)
    if method in ("auto", "shortest-path", "graph-cut"):
        assert facts["ratio"] == pytest.approx(1)


def test_one_line_tells_a_person_what_was_made(folder, toposeam):
    last = r"out\.png: 92 × 40 px: (no visible seam|look at \d+,\d+)\n"
    ran = toposeam("stitch", *STRIP, "-o", "out.png")
    assert re.fullmatch(last, ran.out)
    assert ran.err == ""
    ran = toposeam("stitch", *STRIP, "-o", "out.png", "--force", "-v")
    seam = r"seam of \d+ px by shortest-path, cost [\d.]+, \d\.\d\d s\n"
    assert re.fullmatch(seam + last, ran.out)


def test_a_seam_that_did_not_settle_says_so(folder, toposeam, monkeypatch):
    monkeypatch.setitem(ts.seam.ThesisOptions.__init__.__kwdefaults__, "max_iterations", 2)
    ran = toposeam("stitch", *STRIP, "--method", "thesis", "-o", "out.png", "--labels", "labels.png")
    assert ran.code == 0
    assert "did not settle" in ran.out
    assert_joined("out.png", "labels.png", "a.png", "b.png", (36, 0))


@pytest.mark.medium
def test_force_replaces_and_only_what_was_named(folder, toposeam):
    outputs = ["out.png", "seam.svg", "labels.png", "overlay.png", "history.png"]
    options = [
        value
        for pair in zip(["-o", "--seam", "--labels", "--overlay", "--history"], outputs, strict=True)
        for value in pair
    ]
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


@pytest.mark.parametrize(
    ("output", "phrase"),
    [
        ("no such folder/x.png", "there is no folder"),
        ("x.gif", "is not supported"),
        ("a.png", "exists already"),
    ],
)
def test_where_nothing_can_be_written_nothing_is_read(folder, toposeam, output, phrase):
    """The output is judged first: the pictures are none, and that is not what is said."""
    (folder / "a.png").write_bytes(b"no picture")
    toposeam("stitch", "a.png", "b.png", "--overlap", "20", "-o", output).fails(phrase)


@pytest.mark.parametrize("kind", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("channels", [1, 3])
def test_a_contact_sheet_shows_every_depth(folder, toposeam, kind, channels):
    gray = np.full((60, 80) if channels == 1 else (60, 80, 3), 0.5) * {"uint8": 255, "uint16": 65535}.get(
        kind, 1
    )
    for name in ("one.tif", "two.tif"):
        write_picture(name, Picture(pixels=gray.astype(kind)))
    words = "one.tif", "two.tif", "--offset", "40,0", "-o", "all.tif", "--contact", "sheet.png"
    assert toposeam("stitch", *words).code == 0
    middle = read_picture("sheet.png").pixels[24 + 30, 24 + 60]
    assert len(set(middle.tolist())) == 1
    assert 100 < middle[0] < 200  # floats are linear light where they have three channels
