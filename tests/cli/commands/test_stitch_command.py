"""``toposeam stitch``: where B lies, how the seam is found, and the seam as a path."""

import dataclasses

import numpy as np
import pytest
import tifffile
from PIL import Image

import toposeam as ts
from stitching import STRIP, assert_joined, shown, told
from toposeam_cli.commands.stitch import stitch
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.stitching.search_options import SeamOptions

#: Placements of B, which has the size of A, and what they make of the overlap.
PLACEMENTS = {
    "strip": "36,0",
    "L": "30,9",
    "upwards": "-21,-13",
    "left": "-36,0",
    "cross": "17,-25",
    "beneath": "0,22",
}


@pytest.mark.parametrize("where", PLACEMENTS.values(), ids=PLACEMENTS)
def test_an_offset_places_b_anywhere(folder, toposeam, where):
    ran = toposeam(
        "stitch", "a.png", "b.png", f"--offset={where}", "-o", "joined.png", "--labels", "labels.png"
    )
    assert ran.code == 0
    assert not ran.err or ran.err.startswith("warning: a.png and b.png show little in common")
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
    assert (
        toposeam("stitch", "a.png", "b.png", "--overlap", overlap, "--side", side, "-o", "overlap.tif").code
        == 0
    )
    assert toposeam("stitch", "a.png", "b.png", "--offset", offset, "-o", "offset.tif").code == 0
    assert (folder / "overlap.tif").read_bytes() == (folder / "offset.tif").read_bytes()


def test_pictures_of_unlike_sizes_are_aligned_at_the_top(folder, toposeam, photographs):
    write_picture("short.png", Picture(pixels=photographs[1][:17, :31]))
    assert (
        toposeam(
            "stitch", "a.png", "short.png", "--overlap", "9", "-o", "out.png", "--labels", "labels.png"
        ).code
        == 0
    )
    assert_joined("out.png", "labels.png", "a.png", "short.png", (47, 0))
    assert read_picture("out.png").alpha is not None  # below the short one there is nothing


def test_a_larger_core_shows_more_of_an_inner_picture(folder, toposeam, photographs):
    write_picture("inner.png", Picture(pixels=photographs[0][5:29, 3:40][::-1]))
    areas = []
    for core in ("0.1", "0.5", "0.9"):
        line = (
            "stitch",
            "a.png",
            "inner.png",
            "--offset",
            "9,8",
            "--core",
            core,
            "-o",
            "out.png",
            "--labels",
            "labels.png",
            "--force",
        )
        assert toposeam(*line).code == 0
        assert_joined("out.png", "labels.png", "a.png", "inner.png", (9, 8))
        areas.append(shown("labels.png").sum())
    assert 0 < areas[0] <= areas[1] <= areas[2]
    assert areas[0] < areas[2]


@pytest.mark.parametrize(("speck", "seen"), [("0", True), ("9", True), ("10", False), (None, False)])
def test_a_speck_of_an_inner_picture_shows_on_request(folder, toposeam, photographs, speck, seen):
    opaque = np.zeros((24, 37), np.uint8)
    opaque[2:22, 2:20] = opaque[8:13, 28:33] = 255
    inner = photographs[0][5:29, 3:40][::-1]
    write_picture("inner.png", Picture(pixels=np.ascontiguousarray(inner), alpha=opaque))
    option = () if speck is None else ("--speck", speck)
    line = ("stitch", "a.png", "inner.png", "--offset", "9,8", *option, "-o", "out.png")
    assert toposeam(*line, "--labels", "labels.png").code == 0
    labels = shown("labels.png")[8:32, 9:46]
    assert labels[12, 11]
    assert labels[8:13, 28:33].any() == seen


@pytest.mark.medium
@pytest.mark.parametrize("overlap", [1, 2, 3])
def test_the_narrowest_overlaps_are_joined(folder, toposeam, overlap):
    line = (
        "stitch",
        "a.png",
        "b.png",
        "--overlap",
        overlap,
        "-o",
        "out.png",
        "--labels",
        "labels.png",
        "--history",
        "history.png",
    )
    assert toposeam(*line, "--overlay", "overlay.png").code == 0
    assert_joined("out.png", "labels.png", "a.png", "b.png", (56 - overlap, 0))


def test_pictures_of_one_row_are_joined(folder, toposeam, photographs):
    for name, pixels in zip("cd", photographs, strict=True):
        write_picture(f"{name}.png", Picture(pixels=pixels[:1]))
    line = (
        "stitch",
        "c.png",
        "d.png",
        "--overlap",
        "20",
        "-o",
        "out.png",
        "--labels",
        "labels.png",
        "--seam",
        "seam.svg",
    )
    assert toposeam(*line).code == 0
    assert_joined("out.png", "labels.png", "c.png", "d.png", (36, 0))
    assert ts.vector.read_svg("seam.svg").polylines[0].length == 1


@pytest.mark.parametrize("method", ts.seam.METHODS)
def test_every_method_joins(folder, toposeam, method):
    if method == "graph-cut":
        pytest.importorskip("maxflow")
    ran = toposeam("stitch", *STRIP, "--method", method, "-o", "out.png", "--labels", "labels.png", "--json")
    assert (ran.code, ran.err) == (0, "")
    assert told(ran)["seams"][0]["method"] == ("shortest-path" if method == "auto" else method)
    assert_joined("out.png", "labels.png", "a.png", "b.png", (36, 0))


def test_the_thesis_as_it_is_written(folder, toposeam):
    line = ("stitch", *STRIP, "--method", "thesis", "-o", "out.png", "--seam", "seam.svg", "--force")
    found = {}
    for plain in ((), ("--plain",)):
        ran = toposeam(*line, *plain)
        assert (ran.code, ran.err) == (0, "")
        (found[plain],) = ts.vector.read_svg("seam.svg").metadata["seams"]
    assert found[()]["asymptotes"] == "curvature"
    assert found["--plain",]["asymptotes"] == "moving"
    assert found["--plain",]["first_penalty"] == 3
    ran = toposeam("stitch", *STRIP, "--plain", "-o", "other.png")
    assert ran.code != 0
    assert "--plain belongs to --method thesis" in ran.err


def test_the_thesis_has_two_formulations(folder, toposeam):
    for formulation in (1, 2):
        line = (
            "stitch",
            *STRIP,
            "--method",
            "thesis",
            "--formulation",
            formulation,
            "-o",
            f"{formulation}.png",
            "--labels",
            "labels.png",
        )
        assert toposeam(*line, "--force").code == 0
        assert_joined(f"{formulation}.png", "labels.png", "a.png", "b.png", (36, 0))


@pytest.mark.parametrize("law", [None, *ts.seam.LAWS])
def test_cost_chooses_the_law(folder, toposeam, photographs, law):
    ran = toposeam("stitch", *STRIP, "-o", "out.png", "--json", *([] if law is None else ["--cost", law]))
    layers = [ts.Layer(image=photographs[0]), ts.Layer(image=photographs[1], at=(36, 0))]
    stitched = ts.stitch(layers, cost=ts.seam.MatchCost(law=law or "natural"))
    facts = told(ran)
    assert facts["cost"] == facts["seams"][0]["cost"] == stitched.seams[0].cost
    np.testing.assert_array_equal(read_picture("out.png").pixels, stitched.image)


def test_the_seam_avoids_what_the_mask_shows_white(folder, toposeam):
    assert toposeam("stitch", *STRIP, "-o", "free.png", "--labels", "free-labels.png").code == 0
    free = shown("free-labels.png")
    crossing = int(np.flatnonzero(free[20])[0])
    avoid = np.zeros(free.shape, np.uint8)
    avoid[14:27, crossing - 3 : crossing + 3] = 255
    Image.fromarray(avoid).save("mask.png")
    assert (
        toposeam("stitch", *STRIP, "-o", "out.png", "--labels", "labels.png", "--avoid", "mask.png").code == 0
    )
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
    assert (
        toposeam("stitch", *STRIP, "-o", "out.png", "--labels", "labels.png", "--avoid", "mask.png").code == 0
    )
    labels = shown("labels.png")
    touched = (labels[:, 1:] != labels[:, :-1]) & (avoid[:, 1:] | avoid[:, :-1])
    assert not touched.any()


@pytest.mark.parametrize("where", PLACEMENTS.values(), ids=PLACEMENTS)
def test_a_written_seam_used_again_gives_the_same_bytes(folder, toposeam, where):
    line = ("stitch", "a.png", "b.png", f"--offset={where}")
    assert toposeam(*line, "-o", "first.png", "--seam", "first.svg").code == 0
    ran = toposeam(*line, "-o", "again.png", "--use-seam", "first.svg", "--seam", "again.svg", "-v")
    assert ran.code == 0
    assert "by path" in ran.out
    assert (folder / "first.png").read_bytes() == (folder / "again.png").read_bytes()
    first, again = ts.vector.read_svg("first.svg"), ts.vector.read_svg("again.svg")
    assert [line.points.tolist() for line in first.polylines] == [
        line.points.tolist() for line in again.polylines
    ]
    assert first.metadata["seams"][0]["method"] == "shortest-path"


def test_a_closed_seam_survives_the_round_trip(folder, toposeam, photographs):
    write_picture("inner.png", Picture(pixels=photographs[0][5:29, 3:40][::-1]))
    line = ("stitch", "a.png", "inner.png", "--offset", "9,8")
    assert toposeam(*line, "-o", "first.png", "--seam", "seam.svg").code == 0
    assert ts.vector.read_svg("seam.svg").polylines[0].closed
    assert toposeam(*line, "-o", "again.png", "--use-seam", "seam.svg").code == 0
    assert (folder / "first.png").read_bytes() == (folder / "again.png").read_bytes()


def test_a_hand_drawn_line_is_followed(folder, toposeam):
    (folder / "hand.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="92" height="40"><path d="M44 -3 V20 H50 V43" '
        'fill="none"/></svg>'
    )
    line = ("stitch", *STRIP, "-o", "out.png", "--use-seam", "hand.svg", "--labels", "labels.png", "--json")
    (facts,) = told(toposeam(*line))["seams"]
    expected = np.zeros((40, 92), bool)
    expected[:20, 44:] = expected[20:, 50:] = True
    np.testing.assert_array_equal(shown("labels.png"), expected)
    assert (facts["method"], facts["termination"], facts["length_px"]) == ("path", "given", 46)
    assert facts["ratio"] > 1
    assert_joined("out.png", "labels.png", "a.png", "b.png", (36, 0))


def test_one_command_may_write_back_to_the_path_it_uses(folder, toposeam):
    assert toposeam("stitch", *STRIP, "-o", "first.png", "--seam", "seam.svg").code == 0
    assert (
        toposeam(
            "stitch", *STRIP, "-o", "again.png", "--use-seam", "seam.svg", "--seam", "seam.svg", "--force"
        ).code
        == 0
    )
    assert ts.vector.read_svg("seam.svg").metadata["seams"][0]["method"] == "path"


def test_what_is_handed_on_by_name_is_an_option_of_stitch():
    """Of the command's options those that core has are handed on, none is lost, and none has two homes."""
    own, there = (
        {field.name for field in dataclasses.fields(kind)} for kind in (SeamOptions, ts.layers.StitchOptions)
    )
    own.remove("stitch")
    assert not own & there
    given = {parameter.name: parameter.name for parameter in stitch.params}
    options = set(given)
    found = SeamOptions.taken(given)
    assert set(found.stitch) == (options & there) - own
    known = {"method", "effort", "blend", "blend_width", "match_tones", "give", "core", "wrap"}
    assert known <= set(found.stitch)
    assert own <= options
    assert set(given) == options - own - there
    assert found.with_stitch(wrap=9).of_stitch("wrap") == 9
    assert found.of_stitch("nothing") is None
