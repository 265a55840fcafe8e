"""Paint Seam Hints, painted masks, and Re-stitch in a real GIMP."""

import numpy as np
import pytest
from inside import covers_once, mask_of, refused, shown, succeeded
from pictures import photograph, write_png
from running import CHECKOUT, needs_gimp

needs_gimp()

HINTS, RESTITCH = "plug-in-toposeam-hints", "plug-in-toposeam-restitch"


@pytest.fixture
def stitched(gimp, image, samples):
    """Two pictures side by side, 130 px of overlap over the whole height of 500, stitched."""
    files = [samples / f"still_life_{side}.png" for side in ("left", "right")]
    loaded = image(files, offsets=[(0, 0), (310, 0)])
    return {
        **loaded,
        "group": succeeded(gimp.stitch(loaded, {"blend": "feather", "blend-width": 4.0}))["layer"],
    }


def copies(gimp, stitched):
    """The stitched copies, the lowest first."""
    group = next(
        one for one in gimp.tree(image=stitched["image"])["layers"] if one["id"] == stitched["group"]
    )
    return [one["id"] for one in reversed(group["children"]) if not one["name"].startswith("Blended")]


def seen(gimp, stitched):
    return shown(gimp, copies(gimp, stitched))


def run(gimp, stitched, procedure, layer):
    return succeeded(gimp.run(procedure=procedure, image=stitched["image"], layers=[layer]))["layer"]


def fill(gimp, drawable, box, colour):
    code = """
drawable = item(number)
left, top, width, height = box
drawable.get_buffer().set(Gegl.Rectangle.new(*box), format_name, bytes(colour) * (width * height))
drawable.get_buffer().flush()
drawable.update(*box)
"""
    format_name = "Y u8" if len(colour) == 1 else "R'G'B'A u8"
    gimp.python(code=code, number=drawable, box=box, colour=colour, format_name=format_name)


def foreground(gimp):
    code = """
gi.require_version("Babl", "0.1")
from gi.repository import Babl
answer = list(Gimp.context_get_foreground().get_bytes(Babl.format("R'G'B'A u8")).get_data())
"""
    return gimp.python(code=f"import gi\n{code}")


def test_a_border_finds_itself_round_a_stroke(gimp, stitched):
    lower, upper = copies(gimp, stitched)
    before = seen(gimp, stitched)
    # Of the right picture, where the left one is seen now, in the colour that the entry chooses for it.
    ends = (before[0] > 0).sum(axis=1)[100:400]
    row = 100 + int(ends.argmax())
    column = int(ends.max()) - 25
    assert column > 320
    strokes = run(gimp, stitched, HINTS, upper)
    fill(gimp, strokes, [column, row - 10, 12, 20], foreground(gimp))
    run(gimp, stitched, RESTITCH, strokes)
    low, high = seen(gimp, stitched)
    assert covers_once(low, high, 310, 0)
    assert (high[row - 10 : row + 10, column - 310 : column - 298] == 255).all()
    differs = (low != before[0]).nonzero()[0]
    assert differs.size > 12 * 20  # a border, not the stroke cut out
    selected = "answer = [one.get_id() for one in image_of(number).get_selected_layers()]"
    assert gimp.python(code=selected, number=stitched["image"]) == [strokes]
    assert len(gimp.tree(image=stitched["image"])["paths"]) == 1
    # What obeys the strokes stays as it is; of the lower picture, the same again.
    run(gimp, stitched, RESTITCH, strokes)
    np.testing.assert_array_equal(seen(gimp, stitched)[0], low)
    assert run(gimp, stitched, HINTS, lower) == strokes
    fill(gimp, strokes, [column, row - 10, 12, 20], foreground(gimp))
    run(gimp, stitched, RESTITCH, strokes)
    assert (seen(gimp, stitched)[0][row - 10 : row + 10, column : column + 12] == 255).all()


def test_a_painted_mask_shows_the_layer_below_and_is_kept(gimp, stitched):
    lower, upper = copies(gimp, stitched)
    assert gimp.python(code="answer = item(number).get_mask() is None", number=lower)
    row = 300
    column = int((mask_of(gimp, upper)[row] > 0).nonzero()[0].min()) + 20
    mask = gimp.python(code="answer = item(number).get_mask().get_id()", number=upper)
    fill(gimp, mask, [column, row, 15, 15], [0])
    opaque = gimp.projection(stitched["image"], "R'G'B'A u8")[..., 3]
    assert (opaque == 255).all()  # no hole
    run(gimp, stitched, RESTITCH, stitched["group"])
    after = mask_of(gimp, upper)
    assert not after[row : row + 15, column : column + 15].any()
    tree = gimp.tree(image=stitched["image"])
    assert tree["layers"][0]["name"] == "Seam hints"
    run(gimp, stitched, RESTITCH, stitched["group"])
    np.testing.assert_array_equal(mask_of(gimp, upper), after)


def test_a_group_of_many_layers_has_no_colours(gimp, stitched):
    code = """
image, group = image_of(number), item(group)
import json
memory = json.loads(bytes(group.get_parasite("toposeam-seam").get_data()))
memory["layers"] = memory["layers"] * 5
group.attach_parasite(Gimp.Parasite.new("toposeam-seam", 3, list(json.dumps(memory).encode())))
"""
    gimp.python(code=code, number=stitched["image"], group=stitched["group"])
    refused(gimp, {**stitched, "layers": [stitched["group"]]}, "paint on the layers' masks", HINTS)


def test_a_selected_mask_stands_for_its_layer(gimp, stitched):
    _lower, upper = copies(gimp, stitched)
    row = 300
    column = int((mask_of(gimp, upper)[row] > 0).nonzero()[0].min()) + 20
    code = "answer = item(number).get_mask().get_id()"
    fill(gimp, gimp.python(code=code, number=upper), [column, row, 15, 15], [0])
    for _ in range(2):
        run(gimp, stitched, RESTITCH, gimp.python(code=code, number=upper))
        assert not mask_of(gimp, upper)[row : row + 15, column : column + 15].any()
        painting = (
            "answer = [image_of(number).get_selected_layers()[0].get_id(), item(layer).get_edit_mask()]"
        )
        assert gimp.python(code=painting, number=stitched["image"], layer=upper) == [upper, True]
        # another place, as somebody who goes on painting
        fill(gimp, gimp.python(code=code, number=upper), [column, row - 60, 15, 15], [0])
    tree = gimp.tree(image=stitched["image"])
    names = [one["name"] for one in tree["layers"]]
    assert names[:2] == ["Seam hints", "Stitched"]
    assert [one["name"] for one in tree["layers"][1]["children"][1:]] == [
        "still_life_right.png (stitched)",
        "Background (stitched)",
    ]
    assert [path["name"] for path in tree["paths"]] == ["Seam Background : still_life_right.png"]
    strokes = run(gimp, stitched, HINTS, gimp.python(code=code, number=upper))
    assert strokes == gimp.tree(image=stitched["image"])["layers"][1]["id"]


def test_strokes_and_outlines_show_only_while_somebody_paints(gimp, stitched):
    lower, upper = copies(gimp, stitched)
    select = "image_of(number).select_rectangle(Gimp.ChannelOps.REPLACE, 5, 6, 70, 80)"
    gimp.python(code=select, number=stitched["image"])
    strokes = run(gimp, stitched, HINTS, upper)
    outlines, hints = gimp.tree(image=stitched["image"])["layers"][:2]
    assert outlines["name"] == "How far layers reach"
    assert (hints["id"], hints["visible"], outlines["visible"]) == (strokes, True, True)
    bounds = "answer = list(Gimp.Selection.bounds(image_of(number)))[2:]"
    assert gimp.python(code=bounds, number=stitched["image"]) == [5, 6, 75, 86]
    pixels, _ = gimp.pixels(outlines["id"], "R'G'B'A u8")
    drawn = {tuple(colour) for colour in pixels[pixels[..., 3] > 0][:, :3].tolist()}
    assert drawn == {(51, 108, 222), (240, 140, 20)}
    # The left picture ends at x = 440, and the right one begins at 310.
    for colour, edges in (((51, 108, 222), {0, 439}), ((240, 140, 20), {310, 810})):
        columns = (pixels[250] == [*colour, 255]).all(axis=1).nonzero()[0]
        assert set(columns.tolist()) == edges
    run(gimp, stitched, RESTITCH, strokes)
    after = gimp.tree(image=stitched["image"])["layers"]
    assert (after[0]["id"], after[0]["visible"]) == (strokes, False)
    assert after[1]["id"] == stitched["group"]
    # Who has just painted keeps the colour.
    run(gimp, stitched, HINTS, lower)
    before = foreground(gimp)
    assert run(gimp, stitched, HINTS, strokes) == strokes
    assert foreground(gimp) == before
    assert [one["visible"] for one in gimp.tree(image=stitched["image"])["layers"][:3]] == [True] * 3


def test_a_stroke_where_a_layer_has_no_pixels_is_told(gimp, stitched):
    _lower, upper = copies(gimp, stitched)
    strokes = run(gimp, stitched, HINTS, upper)
    fill(gimp, strokes, [280, 100, 60, 30], foreground(gimp))
    assert said(gimp, stitched, strokes) == 1
    assert said(gimp, stitched, strokes) == 0  # it has been told
    run(gimp, stitched, HINTS, upper)
    fill(gimp, strokes, [340, 360, 20, 30], foreground(gimp))
    assert said(gimp, stitched, strokes) == 0


def said(gimp, stitched, strokes):
    """How often Re-stitch says that a layer has no pixels under a stroke."""
    phrase = "“still_life_right.png” has no pixels"
    before = gimp.log.read_text().count(phrase)
    succeeded(gimp.run(procedure=RESTITCH, image=stitched["image"], layers=[strokes], mode="INTERACTIVE"))
    return gimp.log.read_text().count(phrase) - before


@pytest.fixture
def wide(gimp, image, tmp_path):
    """Two pictures on a canvas so large that a stroke concerns a window of it, stitched; twice."""
    whole, offsets = photograph(1300, 2200), [(0, 0), (900, 40)]
    files = []
    for index, (x, y) in enumerate(offsets):
        files.append(tmp_path / f"part{index}.png")
        noise = np.random.default_rng(index).integers(0, 20, (1260, 1300, 3), np.uint8)
        write_png(files[-1], whole[y : y + 1260, x : x + 1300] // 2 + noise)
    made = []
    for _ in range(2):
        loaded = image(files, offsets=offsets)
        options = {"blend": "feather", "blend-width": 6.0}
        made.append({**loaded, "group": succeeded(gimp.stitch(loaded, options))["layer"]})
    return made


#: Forgets how far blending reaches, so that everything is sent.
FORGET = """
import json
memory = json.loads(bytes(item(number).get_parasite("toposeam-seam").get_data()))
memory["margin"] = None
item(number).attach_parasite(Gimp.Parasite.new("toposeam-seam", 3, list(json.dumps(memory).encode())))
"""
#: The label map that is kept, and what is known of masks.
KEPT = """
import json, zlib
memory = json.loads(bytes(item(number).get_parasite("toposeam-seam").get_data()))
labels = bytes(item(number).get_parasite("toposeam-shown").get_data())
memory["labels"].pop("file")
answer = [zlib.crc32(labels), memory["labels"], memory["masks"], memory["margin"]]
"""


@pytest.mark.medium
@pytest.mark.parametrize("on", ["hints", "mask"])
def test_a_window_gives_what_everything_gives(gimp, wide, on):
    found, row = [], 830
    for stitched in wide:
        lower, upper = copies(gimp, stitched)
        column = int((mask_of(gimp, upper)[row - 40] > 0).nonzero()[0].min()) + 900
        if on == "hints":
            painted = run(gimp, stitched, HINTS, lower)
            fill(gimp, painted, [column + 20, row, 30, 20], foreground(gimp))
        else:
            painted = gimp.python(code="answer = item(number).get_mask().get_id()", number=upper)
            fill(gimp, painted, [column + 20 - 900, row - 40, 30, 20], [0])
        # What lies far away in the layer of blended pixels stays if only a window is made anew.
        blended = gimp.tree(image=stitched["image"])["layers"][-3]["children"][0]
        assert blended["name"] == "Blended seams"
        (x, y), first = blended["offsets"], stitched is wide[0]
        fill(gimp, blended["id"], [0, 0, 3, 3], [9, 8, 7, 255])
        if not first:
            gimp.python(code=FORGET, number=stitched["group"])
        run(gimp, stitched, RESTITCH, stitched["group"])
        seen = gimp.projection(stitched["image"], "R'G'B'A u8")
        assert bool((seen[y : y + 3, x : x + 3] == [9, 8, 7, 255]).all()) == first
        seen[y : y + 3, x : x + 3] = 0
        tree = gimp.tree(image=stitched["image"])
        names = [one["name"] for one in tree["layers"]]
        lines = [gimp.strokes(path=path["id"]) for path in tree["paths"]]
        found.append((seen, names, lines, gimp.python(code=KEPT, number=stitched["group"])))
        assert not mask_of(gimp, upper)[row - 40 : row - 20, column + 20 - 900 : column + 50 - 900].any()
    np.testing.assert_array_equal(found[0][0], found[1][0])
    assert found[0][1:] == found[1][1:]


def test_strokes_on_gray_pictures_are_of_their_layer(gimp, image, samples):
    files = [samples / f"still_life_{side}.png" for side in ("left", "right")]
    loaded = image(files, offsets=[(0, 0), (310, 0)], gray=True)
    stitched = {**loaded, "group": succeeded(gimp.stitch(loaded))["layer"]}
    for number, box in ((0, (390, 60, 40, 40)), (1, (330, 300, 40, 40))):
        layer = copies(gimp, stitched)[number]
        strokes = run(gimp, stitched, HINTS, layer)
        code = """
image_of(image).select_rectangle(Gimp.ChannelOps.REPLACE, *box)
item(layer).edit_fill(Gimp.FillType.FOREGROUND)
Gimp.Selection.none(image_of(image))
"""
        gimp.python(code=code, image=stitched["image"], layer=strokes, box=box)
    run(gimp, stitched, RESTITCH, strokes)
    low, high = seen(gimp, stitched)
    assert (low[65:95, 395:425] == 255).all()
    assert (high[305:335, 25:55] == 255).all()


def test_layers_that_are_not_stitched_yet_are_stitched_first(gimp, image, samples):
    loaded = image(
        [samples / f"still_life_{side}.png" for side in ("left", "right")], offsets=[(0, 0), (310, 0)]
    )
    made = succeeded(gimp.run(procedure=HINTS, image=loaded["image"], layers=loaded["layers"]))
    layers = gimp.tree(image=loaded["image"])["layers"]
    names = [layer["name"] for layer in layers]
    assert names[:3] == ["How far layers reach", "Seam hints", "Stitched"]
    assert layers[1]["id"] == made["layer"]


def test_a_selected_part_is_a_patch_that_takes_strokes(gimp, image, samples):
    loaded = image([samples / f"grass_{name}.png" for name in "ab"])
    refused(gimp, {**loaded, "layers": loaded["layers"][1:]}, "Select a group", HINTS)
    code = "image_of(number).select_ellipse(Gimp.ChannelOps.REPLACE, 60, 50, 90, 80)"
    gimp.python(code=code, number=loaded["image"])
    succeeded(gimp.run(procedure=HINTS, image=loaded["image"], layers=loaded["layers"][1:]))
    names = [layer["name"] for layer in gimp.tree(image=loaded["image"])["layers"]]
    assert "Seam hints" in names
    assert any(name.startswith("Patch of ") for name in names)


#: Strokes of a pixel each, and the tiles that are found to have changed.
PIXELS = """
import sys
if plug_ins not in sys.path:
    sys.path.insert(0, plug_ins)
from toposeam_gimp.image import pixels
image = Gimp.Image.new_with_precision(*size, Gimp.ImageBaseType.RGB, getattr(Gimp.Precision, precision))
layer = Gimp.Layer.new(image, "strokes", *size, Gimp.ImageType.RGBA_IMAGE, 60, Gimp.LayerMode.NORMAL)
image.insert_layer(layer, None, 0)
answer = [pixels.tile_sums(layer)]
for x, y in points:
    before = pixels.tile_sums(layer)
    layer.get_buffer().set(Gegl.Rectangle.new(x, y, 1, 1), "R'G'B'A u8", bytes([51, 108, 222, 80]))
    layer.get_buffer().flush()
    layer.update(x, y, 1, 1)
    after = pixels.tile_sums(layer)
    answer.append([corner for corner in after if before.get(corner) != after[corner]])
image.delete()
"""


@pytest.mark.parametrize("precision", ["U8_NON_LINEAR", "FLOAT_LINEAR"])
@pytest.mark.parametrize("size", [(4608, 300), (4611, 519)])
def test_a_pixel_of_a_stroke_is_noticed_anywhere(gimp, size, precision):
    points = [(0, 0), (255, 255), (256, 256), (4095, 9), (4096, 8), (4607, 7), (size[0] - 1, size[1] - 1)]
    points = [(x, min(y, size[1] - 1)) for x, y in points]
    about = {"plug_ins": str(CHECKOUT / "plugin_gimp"), "size": size, "precision": precision}
    blank, *found = gimp.python(code=PIXELS, points=points, **about)
    assert blank == {}
    assert found == [[f"{x // 256 * 256},{y // 256 * 256}"] for x, y in points]
