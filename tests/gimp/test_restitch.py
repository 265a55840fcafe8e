"""Re-stitch from Paths in a real GIMP."""

import numpy as np
import pytest
from inside import cli, covers_once, refused, shown, succeeded
from pictures import crops, photograph
from running import needs_gimp

needs_gimp()

RESTITCH = "plug-in-toposeam-restitch"


@pytest.fixture
def stitched(gimp, image, samples):
    """Two pictures side by side, 130 px of overlap over the whole height of 500, stitched; the group's layer
    too.
    """
    loaded = image(
        [samples / "still_life_left.png", samples / "still_life_right.png"], offsets=[(0, 0), (310, 0)]
    )
    return {**loaded, "group": succeeded(gimp.stitch(loaded))["layer"]}


def restitch(gimp, stitched):
    return gimp.run(procedure=RESTITCH, image=stitched["image"], layers=[stitched["group"]])


def masks(gimp, image):
    group = gimp.tree(image=image)["layers"][0]
    return shown(gimp, [child["id"] for child in reversed(group["children"])])


def redraw(gimp, image, controls, closed=False, keep=False):
    """Replace the strokes of the only path by one of the given control points, six numbers per anchor."""
    code = """
path = image_of(number).get_paths()[0]
for stroke in () if keep else path.get_strokes():
    path.remove_stroke(stroke)
if controls:
    path.stroke_new_from_points(Gimp.PathStrokeType.BEZIER, controls, closed)
"""
    gimp.python(
        code=code, number=image, controls=[float(value) for value in controls], closed=closed, keep=keep
    )


def straight(*points):
    return [value for point in points for value in point * 3]


def test_a_path_that_nobody_touched_gives_the_same_masks(gimp, stitched):
    before = gimp.tree(image=stitched["image"])
    found = masks(gimp, stitched["image"])
    succeeded(restitch(gimp, stitched))
    for old, new in zip(found, masks(gimp, stitched["image"]), strict=True):
        np.testing.assert_array_equal(old, new)
    after = gimp.tree(image=stitched["image"])
    assert after == before


def test_masks_follow_a_straight_path(gimp, stitched):
    redraw(gimp, stitched["image"], straight((380, 0), (380, 500)))
    succeeded(restitch(gimp, stitched))
    low, high = masks(gimp, stitched["image"])
    assert (low[:, :380] == 255).all()
    assert (low[:, 380:] == 0).all()
    assert covers_once(low, high, 310, 0)


def test_a_curve_is_followed_and_short_ends_are_extended(gimp, stitched):
    # A Bézier curve from (340, 100) to (340, 400) that bulges to the right by 3/4 of its handles' reach of 80
    # px.
    redraw(gimp, stitched["image"], [340, 100, 340, 100, 420, 100, 420, 400, 340, 400, 340, 400])
    succeeded(restitch(gimp, stitched))
    low, high = masks(gimp, stitched["image"])
    assert covers_once(low, high, 310, 0)
    widths = (low == 255).sum(axis=1)
    assert abs(int(widths[250]) - 400) <= 1
    assert widths[250] > widths[150] > widths[105] > 335


def test_the_path_to_bend_is_smooth_and_has_few_anchors(gimp, stitched):
    (smooth,) = gimp.tree(image=stitched["image"])["paths"]
    assert smooth["name"] == "Seam Background : still_life_right.png"
    assert smooth["visible"]
    assert 2 < len(gimp.strokes(path=smooth["id"])[0]["points"]) // 6 <= 15
    selected = "answer = [path.get_id() for path in image_of(number).get_selected_paths()]"
    assert gimp.python(code=selected, number=stitched["image"]) == [smooth["id"]]


def test_moving_one_anchor_changes_the_mask_only_there(gimp, stitched):
    path = gimp.tree(image=stitched["image"])["paths"][0]["id"]
    (stroke,) = gimp.strokes(path=path)
    anchors = np.array(stroke["points"]).reshape(-1, 3, 2)
    middle = int(np.argmin(np.abs(anchors[:, 1, 1] - 250)))
    old, _ = masks(gimp, stitched["image"])
    anchors[middle, :, 0] += 12
    low, high = (anchors[middle + step, 1, 1] for step in (-1, 1))
    redraw(gimp, stitched["image"], anchors.ravel().tolist())
    succeeded(restitch(gimp, stitched))
    new, upper = masks(gimp, stitched["image"])
    assert covers_once(new, upper, 310, 0)
    moved = np.argwhere(old != new)
    assert len(moved)
    top, bottom = sorted((low, high))
    # The two curves that meet at the anchor, and what their handles reach; elsewhere the exact seam.
    assert (moved[:, 0] >= top - 8).all()
    assert (moved[:, 0] <= bottom + 8).all()


def test_moved_and_renamed_groups_are_stitched_again(gimp, stitched):
    found = masks(gimp, stitched["image"])
    code = """
image, group = image_of(number), item(group)
image.reorder_item(group, None, 2)
group.set_name("panorama")
"""
    gimp.python(code=code, number=stitched["image"], group=stitched["group"])
    child = gimp.tree(image=stitched["image"])["layers"][2]["children"][0]["id"]
    succeeded(gimp.run(procedure=RESTITCH, image=stitched["image"], layers=[child]))
    children = gimp.tree(image=stitched["image"])["layers"][2]["children"]
    new = shown(gimp, [one["id"] for one in reversed(children)])
    for old, now in zip(found, new, strict=True):
        np.testing.assert_array_equal(old, now)


def test_a_saved_and_reopened_file_can_be_stitched_again(gimp, stitched, tmp_path):
    found = masks(gimp, stitched["image"])
    assert gimp.export(image=stitched["image"], file=str(tmp_path / "joined.xcf"))
    code = "answer = Gimp.file_load(Gimp.RunMode.NONINTERACTIVE, Gio.File.new_for_path(file)).get_id()"
    number = gimp.python(code=code, file=str(tmp_path / "joined.xcf"))
    group = gimp.tree(image=number)["layers"][0]["id"]
    succeeded(gimp.run(procedure=RESTITCH, image=number, layers=[group]))
    for old, new in zip(found, masks(gimp, number), strict=True):
        np.testing.assert_array_equal(old, new)
    gimp.delete(image=number)


def test_a_copy_of_a_group_does_not_change_the_group(gimp, stitched):
    found = masks(gimp, stitched["image"])
    code = """
image, group = image_of(number), item(group)
copy = group.copy()
image.insert_layer(copy, None, 0)
answer = copy.get_id()
"""
    copy = gimp.python(code=code, number=stitched["image"], group=stitched["group"])
    refused(gimp, {**stitched, "layers": [copy]}, "This is a copy of a stitched group", RESTITCH)
    gimp.python(code="image_of(number).remove_layer(item(copy))", number=stitched["image"], copy=copy)
    for old, new in zip(found, masks(gimp, stitched["image"]), strict=True):
        np.testing.assert_array_equal(old, new)


def test_four_layers_again(gimp, image, tmp_path):
    files, offsets = crops(
        tmp_path, photograph(300, 340), [(0, 0), (150, 10), (20, 130), (140, 120)], 180, 160
    )
    loaded = image(files, offsets=offsets)
    group = succeeded(gimp.stitch(loaded))["layer"]
    found = masks(gimp, loaded["image"])
    succeeded(gimp.run(procedure=RESTITCH, image=loaded["image"], layers=[group]))
    for old, new in zip(found, masks(gimp, loaded["image"]), strict=True):
        np.testing.assert_array_equal(old, new)


def test_the_blended_layer_follows(gimp, image, samples):
    loaded = image(
        [samples / "still_life_left.png", samples / "still_life_right.png"], offsets=[(0, 0), (310, 0)]
    )
    group = succeeded(gimp.stitch(loaded, {"blend": "feather", "blend-width": 10.0}))["layer"]
    redraw(gimp, loaded["image"], straight((380, 0), (380, 500)))
    for _ in range(2):
        succeeded(gimp.run(procedure=RESTITCH, image=loaded["image"], layers=[group]))
        children = gimp.tree(image=loaded["image"])["layers"][0]["children"]
        assert [child["name"] for child in children][:1] == ["Blended seams"]
        assert len(children) == 3
        opacity, (x, _) = gimp.pixels(children[0]["id"], "R'G'B'A u8")
        columns = x + np.flatnonzero((opacity[:, :, 3] > 0).any(axis=0))
        assert columns.min() >= 370
        assert columns.max() <= 390


def test_only_two_of_four_layers_change_with_a_bent_path(gimp, image, tmp_path):
    # Four different pictures, so that seams run through the overlaps and not along their borders.
    offsets = [[0, 0], [130, 10], [20, 110], [140, 100]]
    files = [
        crops(tmp_path, photograph(160, 180, seed), [(0, 0)], 180, 160)[0][0].rename(tmp_path / f"{seed}.png")
        for seed in range(4)
    ]
    loaded = image(files, offsets=offsets)
    group = succeeded(gimp.stitch(loaded))["layer"]
    before = masks(gimp, loaded["image"])
    paths = gimp.tree(image=loaded["image"])["paths"]
    strokes = {path["id"]: gimp.strokes(path=path["id"])[0] for path in paths}
    chosen, stroke = max(strokes.items(), key=lambda entry: len(entry[1]["points"]))
    anchors = np.array(stroke["points"]).reshape(-1, 3, 2)
    anchors[len(anchors) // 2] += 3
    code = """
path = item(number)
path.remove_stroke(path.get_strokes()[0])
path.stroke_new_from_points(Gimp.PathStrokeType.BEZIER, points, False)
"""
    gimp.python(code=code, number=chosen, points=anchors.ravel().tolist())
    succeeded(gimp.run(procedure=RESTITCH, image=loaded["image"], layers=[group]))
    after = masks(gimp, loaded["image"])
    changed = [bool((old != new).any()) for old, new in zip(before, after, strict=True)]
    assert sum(changed) == 2
    canvas = np.zeros((340, 400), int)
    for (x, y), mask in zip(offsets, after, strict=True):
        canvas[y : y + mask.shape[0], x : x + mask.shape[1]] += mask
    assert set(np.unique(canvas)) == {0, 255}


def test_a_path_that_does_not_part_the_layers(gimp, stitched):
    # A loop in the middle of the overlap parts nothing.
    redraw(gimp, stitched["image"], straight((360, 200), (390, 200), (390, 230)), closed=True)
    refused(gimp, {**stitched, "layers": [stitched["group"]]}, "does not separate", RESTITCH)


def test_an_empty_path(gimp, stitched):
    redraw(gimp, stitched["image"], [])
    refused(gimp, {**stitched, "layers": [stitched["group"]]}, "is empty", RESTITCH)


def test_a_deleted_path(gimp, stitched):
    remove = "image_of(number).remove_path(image_of(number).get_paths()[0])"
    gimp.python(code=remove, number=stitched["image"])
    refused(gimp, {**stitched, "layers": [stitched["group"]]}, "is gone", RESTITCH)


def import_path(gimp, image, file):
    code = """
image = image_of(number)
imported = image.import_paths_from_file(Gio.File.new_for_path(file), False, False)
paths = [path for path in image.get_paths() if path.get_id() not in before]
answer = [path.get_id() for path in paths]
"""
    before = [path["id"] for path in gimp.tree(image=image)["paths"]]
    return gimp.python(code=code, number=image, file=str(file), before=before)


def test_an_imported_command_line_seam_gives_the_same_pixels(gimp, stitched, tmp_path, samples):
    for side, layer in zip("ab", stitched["layers"], strict=True):
        assert gimp.export_layer(layer=layer, file=str(tmp_path / f"{side}.png"))
    command = ["stitch", tmp_path / "a.png", tmp_path / "b.png", "--offset", "310,0", "--method", "dp"]
    cli(*command, "-o", tmp_path / "joined.png", "--seam", tmp_path / "seam.svg")
    assert import_path(gimp, stitched["image"], tmp_path / "seam.svg")
    succeeded(restitch(gimp, stitched))
    joined, _ = gimp.pixels(gimp.load(files=[str(tmp_path / "joined.png")])["layers"][0], "R'G'B'A u8")
    np.testing.assert_array_equal(gimp.projection(stitched["image"], "R'G'B'A u8"), joined)


def test_an_exported_path_gives_nearly_the_same_pixels(gimp, stitched, tmp_path):
    for side, layer in zip("ab", stitched["layers"], strict=True):
        assert gimp.export_layer(layer=layer, file=str(tmp_path / f"{side}.png"))
    code = """
image = image_of(number)
image.export_path_to_file(Gio.File.new_for_path(file), image.get_paths()[0])
"""
    seam = tmp_path / "seam.svg"
    gimp.python(code=code, number=stitched["image"], file=str(seam))
    files = tmp_path / "a.png", tmp_path / "b.png"
    cli("stitch", *files, "--offset", "310,0", "-o", tmp_path / "joined.png", "--use-seam", seam)
    joined, _ = gimp.pixels(gimp.load(files=[str(tmp_path / "joined.png")])["layers"][0], "R'G'B'A u8")
    differs = (gimp.projection(stitched["image"], "R'G'B'A u8") != joined).any(axis=2)
    assert differs.sum() < 2 * 500  # the smooth path lies within 2 px of the seam of 500 px


def test_a_path_beside_the_groups_own_is_not_ignored(gimp, stitched):
    code = """
image = image_of(number)
path = Gimp.Path.new(image, "Background : still_life_right.png")
image.insert_path(path, None, 0)
path.stroke_new_from_points(Gimp.PathStrokeType.BEZIER, controls, False)
"""
    found, _ = masks(gimp, stitched["image"])
    controls = [float(value) for value in straight((380, 0), (380, 500))]
    gimp.python(code=code, number=stitched["image"], controls=controls)
    select = "image = image_of(number); image.set_selected_paths(image.get_paths()[start:end])"
    gimp.python(code=select, number=stitched["image"], start=0, end=2)
    refused(gimp, {**stitched, "layers": [stitched["group"]]}, "Select one of them", RESTITCH)
    gimp.python(code=select, number=stitched["image"], start=0, end=1)
    succeeded(restitch(gimp, stitched))
    low, _high = masks(gimp, stitched["image"])
    assert (low[:, :380] == 255).all()
    assert (low[:, 380:] == 0).all()
    gimp.python(code=select, number=stitched["image"], start=1, end=2)
    succeeded(restitch(gimp, stitched))
    np.testing.assert_array_equal(masks(gimp, stitched["image"])[0], found)


def test_a_selected_path_of_the_group_precedes_a_newer_one(gimp, stitched, tmp_path, samples):
    for side, layer in zip("ab", stitched["layers"], strict=True):
        assert gimp.export_layer(layer=layer, file=str(tmp_path / f"{side}.png"))
    command = ["stitch", tmp_path / "a.png", tmp_path / "b.png", "--offset", "310,0", "--method", "dp"]
    cli(*command, "-o", tmp_path / "joined.png", "--seam", tmp_path / "seam.svg")
    found = masks(gimp, stitched["image"])
    assert import_path(gimp, stitched["image"], tmp_path / "seam.svg")
    select = "image = image_of(number); image.set_selected_paths(image.get_paths()[start:end])"
    gimp.python(code=select, number=stitched["image"], start=1, end=2)  # the smooth one of the group
    succeeded(restitch(gimp, stitched))
    np.testing.assert_array_equal(masks(gimp, stitched["image"])[0], found[0])


def test_a_layer_that_was_never_stitched(gimp, stitched):
    refused(gimp, stitched, "Select a group that Panorama from Layers", RESTITCH)
