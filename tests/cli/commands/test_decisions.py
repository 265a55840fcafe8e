"""Where a cropped picture begins, and what is counted from there; what a name or a number means."""

import json
import re

import numpy as np
import pytest
from three_pictures import AT, FILES, PLACES

from toposeam.layers.canvas import largest_full
from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture
from toposeam_cli.stitching import inputs

#: Columns and rows of the first picture that are transparent: there the crop begins.
LEFT, TOP = 12, 3


@pytest.fixture(params=[False, True], ids=["in memory", "by windows"])
def rimmed(folder, photographs, request, monkeypatch):
    """The first picture has a transparent rim at its left and its top, the second one is a negative."""
    if request.param:
        monkeypatch.setattr(inputs, "STORED_PIXELS", 0)
        monkeypatch.setattr("toposeam_cli.jobs.crew.processes_of", lambda _: 1)
    first, second = photographs
    alpha = np.full(first.shape[:2], 255, np.uint8)
    alpha[:TOP] = alpha[:, :LEFT] = 0
    write_picture("rim.png", Picture(pixels=first, alpha=alpha))
    write_picture("negative.png", Picture(pixels=255 - second))
    return "stitch", "rim.png", "negative.png", "--offset", "36,0"


def test_a_crop_begins_where_it_says(rimmed, toposeam):
    for crop in ("outside", "inside"):
        outputs = "-o", f"{crop}.png", "--overlay", f"{crop}-seam.png"
        ran = toposeam(*rimmed, *outputs, "--crop", crop, "--json")
        assert ran.code == 0, ran
    assert json.loads(ran.out)["crop"][:2] == [LEFT, TOP]
    for name in ("", "-seam"):
        whole, part = (read_picture(f"{crop}{name}.png").pixels for crop in ("outside", "inside"))
        np.testing.assert_array_equal(part, whole[TOP:, LEFT:])


def test_places_to_look_at_are_counted_from_the_crop(rimmed, toposeam):
    places = {}
    for crop in ("outside", "inside"):
        ran = toposeam(*rimmed, "-o", f"{crop}.png", "--crop", crop, "--json")
        places[crop] = json.loads(ran.out)["look_at"]
        said = toposeam(*rimmed, "-o", f"{crop}.png", "--crop", crop, "--force").out
        assert f"look at {places[crop][0]},{places[crop][1]}" in said
    assert np.subtract(places["outside"], places["inside"]) == pytest.approx([LEFT, TOP], abs=1)


def test_places_in_a_saved_layout_do_not_know_of_the_crop(rimmed, toposeam):
    assert toposeam(*rimmed, "-o", "one.png", "--crop", "inside", "--save-layout", "l.toml").code == 0
    assert toposeam("stitch", "l.toml", "-o", "all.png", "--crop", "outside").code == 0
    assert read_picture("all.png").pixels.shape == (40, 92, 3)
    assert toposeam("stitch", "l.toml", "-o", "again.png").code == 0
    np.testing.assert_array_equal(read_picture("again.png").pixels, read_picture("one.png").pixels)


def test_what_is_left_is_told_where_the_crop_shows_it(rimmed, toposeam, tmp_path):
    """One of the points that somebody marked is 6 px off."""
    points = [(x, y, x - 36, y) for x in (38, 46, 54) for y in (6, 20, 34)]
    points[4] = (46, 20, 46 - 36 + 6, 20)
    lines = [f"rim.png,{x},{y},negative.png,{u},{v}" for x, y, u, v in points]
    (tmp_path / "points.csv").write_text("\n".join(lines))
    for crop, near in (("outside", (46, 20)), ("inside", (46 - LEFT, 20 - TOP))):
        line = *rimmed[:3], "--points", "points.csv", "--model", "shift", "-o", f"{crop}.png"
        ran = toposeam(*line, "--crop", crop)
        assert f"rim.png and negative.png passes what is 6 px apart near {near[0]},{near[1]};" in ran.err


@pytest.mark.parametrize(("key", "columns", "shows"), [("1", slice(36, 56), 0), ("0", slice(20), 255)])
def test_a_name_counts_before_a_number(folder, toposeam, key, columns, shows):
    """Of two pictures, the first one may be called 1 and the second one 0."""
    layers = (("a.png", "1", "0, 0"), ("b.png", "0", "36, 0"))
    lines = [f'[[layer]]\nfile = "{file}"\nname = "{name}"\nat = [{at}]\n' for file, name, at in layers]
    (folder / "two.toml").write_text("\n".join(lines))
    keep = np.zeros((40, 56), np.uint8)
    keep[:20, columns] = 255
    write_picture("keep.png", Picture(pixels=keep))
    line = "stitch", "two.toml", "-o", "out.png", "--labels", "labels.png", "--keep", f"{key}=keep.png"
    assert toposeam(*line).code == 0
    assert (read_picture("labels.png").pixels[:20, 36:56] == shows).all()


def test_the_worst_seam_speaks_for_all(three, toposeam):
    """The last picture is a negative: its seams are seen, that between the others is not."""
    picture = read_picture("c.png")
    write_picture("c.png", Picture(pixels=255 - picture.pixels), True)
    ran = toposeam("stitch", *FILES, *AT, "-o", "out.png", "--json")
    facts = json.loads(ran.out)
    *others, worst = sorted(facts["seams"], key=lambda seam: seam["step"])
    assert others[0]["step"] < 1 < worst["step"]
    assert facts["step"] == worst["step"]
    assert facts["look_at"] == worst["look_at"]


def test_the_pair_farthest_apart_is_told(three, toposeam):
    """One point of each pair is off, 6 px in the first pair and 12 px in the last one."""
    lines = []
    for first, second, off in (("a", "b", 6), ("a", "c", 9), ("b", "c", 12)):
        shift = np.subtract(PLACES[second], PLACES[first])
        points = [np.array([x, y]) for x in (42, 48, 54) for y in (34, 40, 46)]
        for number, point in enumerate(point - PLACES[first] for point in points):
            u, v = point - shift + ([off, 0] if number == 4 else [0, 0])
            lines.append(f"{first}.png,{point[0]},{point[1]},{second}.png,{u},{v}")
    (three / "points.csv").write_text("\n".join(lines))
    write_picture("c.png", Picture(pixels=255 - read_picture("c.png").pixels), True)
    ran = toposeam("stitch", *FILES, "--points", "points.csv", "--model", "shift", "-o", "out.png")
    named = re.findall(r"between (\w)\.png and (\w)\.png passes what is (\d+) px apart near", ran.err)
    assert named == [("b", "c", "12")]
    assert "(1 more such seam); toposeam edit moves it" in ran.err


def test_of_equal_rectangles_the_upper_left_one_is_kept():
    mask = np.zeros((40, 50), bool)
    mask[2:12, 3:13] = mask[2:12, 20:30] = mask[20:30, 5:15] = True
    assert largest_full(mask) == (2, 3, 12, 13)
    mask[20:31, 5:15] = True
    assert largest_full(mask) == (20, 5, 31, 15)


def test_a_saved_project_holds_what_lies_on_one_side(folder, toposeam):
    """Both pictures lie to the left of the middle and above it, where Hugin's canvas has its origin."""
    views = 'i w56 h40 f0 v30 y-60 p20 n"a.png"\ni w56 h40 f0 v30 y-42 p20 n"b.png"\n'
    (folder / "in.pto").write_text(f"p f2 w720 h360 v360\nm i0\n{views}")
    assert toposeam("stitch", "in.pto", "-o", "one.png", "--save-layout", "out.pto").code == 0
    written = re.search(r"^p f2 w(\d+) h(\d+) ", (folder / "out.pto").read_text(), re.MULTILINE)
    width, height = map(int, written.groups())
    assert width >= 2 * 2 * (60 + 13)  # 2 px per degree, on either side of the middle
    assert height >= 2 * 2 * (20 + 8)
    assert toposeam("stitch", "out.pto", "-o", "again.png").code == 0
    np.testing.assert_array_equal(read_picture("again.png").pixels, read_picture("one.png").pixels)
