"""Paint Seam Hints, painted masks, and Re-stitch in a real GIMP."""

import numpy as np
import pytest
from inside import covers_once, mask_of, refused, shown, succeeded
from running import needs_gimp

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
