"""More than two pictures on the command line."""

import json
from pathlib import Path

import numpy as np
import pytest
from three_pictures import AT, FILES, assert_joined, crop, shown

import toposeam as ts
from toposeam.layers.composite import options
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.stitching import inputs as placing


def test_three_pictures_at_given_places(three, toposeam):
    ran = toposeam(
        "stitch",
        *FILES,
        *AT,
        "-o",
        "out.png",
        "--labels",
        "labels.png",
        "--overlay",
        "o.png",
        "--seam",
        "s.svg",
        "-v",
    )
    assert ran.code == 0, ran
    assert "3 layers, 3 seams" in ran.out
    assert_joined()
    assert set(ts.vector.read_svg("s.svg").names) == {"a.png : b.png", "a.png : c.png", "b.png : c.png"}
    assert read_picture("o.png").pixels.shape == (80, 100, 3)


def test_all_seams_of_a_file_are_applied_again(three, toposeam):
    assert (
        toposeam("stitch", *FILES, *AT, "-o", "out.png", "--labels", "labels.png", "--seam", "s.svg").code
        == 0
    )
    before = assert_joined()
    assert (
        toposeam(
            "stitch", *FILES, *AT, "-o", "out.png", "--labels", "labels.png", "--use-seam", "s.svg", "--force"
        ).code
        == 0
    )
    assert (before == assert_joined()).mean() > 0.99


@pytest.mark.parametrize("key", ["0:1", "1:0", "a.png:b.png"])
def test_a_seam_for_one_pair(three, toposeam, key):
    (three / "given.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="100" height="80"><path d="M50 0 V80"/></svg>'
    )
    ran = toposeam(
        "stitch",
        *FILES,
        *AT,
        "-o",
        "out.png",
        "--labels",
        "labels.png",
        "--use-seam",
        f"{key}=given.svg",
        "--json",
    )
    assert ran.code == 0, ran
    label_map = assert_joined()
    assert (label_map[6:29, 41:50] == 0).all()
    assert (label_map[6:29, 50:59] == 1).all()
    methods = {tuple(seam["between"]): seam["method"] for seam in json.loads(ran.out)["seams"]}
    assert methods["a.png", "b.png"] == "path"
    assert methods["a.png", "c.png"] in ("shortest-path", "graph-cut", "heat")


def test_masks_by_number_and_by_name(three, toposeam):
    mask = np.zeros((50, 60), np.uint8)
    mask[:, 30:] = 255
    write_picture(three / "right.png", Picture(pixels=mask))
    keep = np.zeros((50, 60), np.uint8)
    keep[5:15, 45:58] = 255
    write_picture(three / "keep.png", Picture(pixels=keep))
    line = [
        *FILES,
        *AT,
        "-o",
        "out.png",
        "--labels",
        "labels.png",
        "--mask-for",
        "c.png=right.png",
        "--keep",
        "0=keep.png",
    ]
    assert toposeam("stitch", *line).code == 0
    label_map = shown()
    assert not (label_map[30:, :50] == 2).any()
    assert (label_map[5:15, 45:58] == 0).all()


def test_alignment_says_what_it_did(three, toposeam):
    line = [
        *FILES,
        "--at",
        "0,0",
        "--at",
        "43,1",
        "--at",
        "18,32",
        "--align",
        "--align-radius",
        "8",
        "-o",
        "out.png",
        "--labels",
        "labels.png",
    ]
    ran = toposeam("stitch", *line, "-v")
    assert ran.code == 0, ran
    assert "b.png: at 40,4, moved by -3,3" in ran.out
    assert "c.png: at 20,30, moved by 2,-2" in ran.out
    assert_joined()
    places = json.loads(toposeam("stitch", *line, "--force", "--json").out)["layers"]
    assert [place["at"] for place in places] == [[0, 0], [40, 4], [20, 30]]
    assert places[1]["moved"] == [-3, 3]


@pytest.mark.parametrize("blend", ts.layers.BLENDS)
def test_every_blend(three, toposeam, blend):
    assert toposeam("stitch", *FILES, *AT, "-o", "out.png", "--blend", blend, "--match-tones").code == 0
    hard = toposeam("stitch", *FILES, *AT, "-o", "hard.png", "--match-tones")
    assert hard.code == 0
    difference = np.abs(read_picture("out.png").pixels.astype(int) - read_picture("hard.png").pixels)
    assert difference.any() == (blend != "none")
    assert difference.mean() < 3


def test_mixed_depths_and_gray_become_one(three, toposeam):
    write_picture(three / "b.tif", Picture(pixels=crop("b").astype(np.uint16) * 257))
    write_picture(three / "c.png", Picture(pixels=crop("c")[..., 1]), force=True)
    assert (
        toposeam("stitch", "a.png", "b.tif", "c.png", *AT, "-o", "out.tif", "--labels", "labels.png").code
        == 0
    )
    result = read_picture("out.tif")
    assert result.pixels.dtype == np.uint16
    assert result.pixels.shape == (80, 100, 3)
    place = np.s_[4:54, 40:100]
    mine = shown()[place] == 1
    np.testing.assert_array_equal(result.pixels[place][mine], crop("b")[mine].astype(np.uint16) * 257)


@pytest.fixture
def across(three):
    """Another picture across the joint of the first two; the files, and where all three lie."""
    write_picture("patch.png", Picture(pixels=crop("c")[::-1, ::-1][8:38, 10:50].copy()))
    return ["a.png", "b.png", "patch.png", "--at", "0,0", "--at", "40,4", "--at", "30,10"]


@pytest.mark.parametrize("windows", [False, True], ids=["in memory", "by windows"])
def test_a_hidden_picture_is_named_and_core_makes_it_show(across, toposeam, windows, monkeypatch):
    if windows:
        monkeypatch.setattr(placing, "STORED_PIXELS", 0)
        monkeypatch.setattr("toposeam_cli.jobs.crew.processes_of", lambda _: 1)
    ran = toposeam("stitch", *across, "-o", "out.tif", "--labels", "labels.png", "--report", "page.html")
    assert ran.code == 0, ran
    told = [line for line in ran.err.splitlines() if "does not show" in line]
    assert len(told) == 1
    assert told[0].startswith("warning: patch.png does not show")
    assert "--core 0.5" in told[0]
    assert "--keep" in told[0]
    assert not (shown() == 2).any()
    assert "<td>30,10</td><td>nowhere</td>" in Path("page.html").read_text()
    line = ["stitch", *across, "-o", "out.tif", "--labels", "labels.png", "--force"]
    ran = toposeam(*line, "--core", "0.5")
    assert "does not show" not in ran.err
    assert shown()[25, 50] == 2
    most = np.pad(np.full((20, 30), 255, np.uint8), 5)
    write_picture("most.png", Picture(pixels=most))
    ran = toposeam(*line, "--keep", "2=most.png")
    assert (ran.code, "does not show" in ran.err) == (0, False)
    assert (shown()[10:40, 30:70][most > 0] == 2).all()
    assert "does not show" not in toposeam(*line, "--quiet").err


@pytest.mark.parametrize(("words", "effort"), [((), None), (("--effort", "best"), "best")])
def test_effort_is_that_of_the_search(three, toposeam, monkeypatch, words, effort):
    asked, usual = [], options.search_options
    monkeypatch.setattr(options, "search_options", lambda *given: asked.append(given) or usual(*given))
    assert toposeam("stitch", *FILES, *AT, "-o", "out.png", *words).code == 0
    assert [given for given in asked if given[1]] == [(effort, 3)]  # without the check of options


def test_an_effort_that_is_none_is_refused(three, toposeam):
    toposeam("stitch", *FILES, *AT, "-o", "out.png", "--effort", "some").fails("--effort", code=2)
