"""Synthesize Texture, Make Seamless Tile and Heal Selection in a real GIMP."""

import numpy as np
import pytest
from inside import refused, succeeded
from pictures import photograph, write_png
from running import needs_gimp

import toposeam as ts

needs_gimp()

SYNTHESIZE, TILE, FILL = (f"plug-in-toposeam-{name}" for name in ("synthesize", "tile", "fill"))


@pytest.fixture
def sample(tmp_path):
    pixels = photograph(96, 120, seed=5)
    write_png(tmp_path / "sample.png", pixels)
    return pixels, tmp_path / "sample.png"


def test_a_texture_is_what_core_makes(gimp, image, sample):
    pixels, file = sample
    loaded = image([file])
    before = gimp.tree(image=loaded["image"])
    options = {"width": 150, "height": 110, "patch": 32, "tileable": "x", "seed": 4}
    result = succeeded(
        gimp.run(procedure=SYNTHESIZE, image=loaded["image"], layers=loaded["layers"], options=options)
    )
    made, _ = gimp.pixels(result["layer"], "R'G'B'A u8")
    expected = ts.synthesize(pixels, (110, 150), patch=32, seed=4, tileable="x").image
    np.testing.assert_array_equal(made[..., :3], expected)
    assert gimp.tree(image=loaded["image"]) == before
    number = gimp.python(code="answer = item(number).get_image().get_id()", number=result["layer"])
    assert gimp.tree(image=number)["size"] == [150, 110]
    gimp.delete(image=number)


@pytest.mark.parametrize(
    "options", [{"precision": "FLOAT_LINEAR"}, {"precision": "U16_NON_LINEAR"}, {"gray": True}]
)
def test_into_a_new_layer_of_the_same_kind(gimp, image, sample, options):
    loaded = image([sample[1]], **options)
    wanted = {"width": 140, "height": 100, "patch": 24, "destination": "layer"}
    result = succeeded(
        gimp.run(procedure=SYNTHESIZE, image=loaded["image"], layers=loaded["layers"], options=wanted)
    )
    after = gimp.tree(image=loaded["image"])
    assert [layer["id"] for layer in after["layers"]] == [result["layer"], *loaded["layers"]]
    made, _ = gimp.pixels(result["layer"], "R'G'B'A u8")
    assert made.shape[:2] == (100, 140)
    assert made[..., :3].std() > 10


def test_only_what_is_selected_is_copied(gimp, image, tmp_path):
    pixels = photograph(96, 120, seed=6) // 2
    pixels[:, 70:] = 250
    write_png(tmp_path / "sample.png", pixels)
    loaded = image([tmp_path / "sample.png"])
    gimp.python(
        code="image_of(number).select_ellipse(Gimp.ChannelOps.REPLACE, 2, 2, 66, 92)", number=loaded["image"]
    )
    options = {"width": 100, "height": 100, "patch": 20}
    result = succeeded(
        gimp.run(procedure=SYNTHESIZE, image=loaded["image"], layers=loaded["layers"], options=options)
    )
    made, _ = gimp.pixels(result["layer"], "R'G'B'A u8")
    assert made[..., :3].max() <= pixels[:, :68].max()


def test_a_tile_is_what_core_makes_and_the_layer_stays(gimp, image, sample):
    pixels, file = sample
    loaded = image([file])
    before = gimp.tree(image=loaded["image"])["layers"]
    result = succeeded(
        gimp.run(
            procedure=TILE, image=loaded["image"], layers=loaded["layers"], options={"band": 12, "seed": 2}
        )
    )
    made, _ = gimp.pixels(result["layer"], "R'G'B'A u8")
    np.testing.assert_array_equal(made[..., :3], ts.make_tileable(pixels, band=12, seed=2).image)
    assert gimp.tree(image=loaded["image"])["layers"][1:] == before


def test_a_selected_rectangle_becomes_a_tile_in_its_place(gimp, image, sample):
    loaded = image([sample[1]])
    gimp.python(
        code="image_of(number).select_rectangle(Gimp.ChannelOps.REPLACE, 20, 10, 80, 64)",
        number=loaded["image"],
    )
    result = succeeded(gimp.run(procedure=TILE, image=loaded["image"], layers=loaded["layers"]))
    made, offset = gimp.pixels(result["layer"], "R'G'B'A u8")
    assert (made.shape[:2], offset) == ((64, 80), (20, 10))


def test_a_selection_that_is_no_rectangle_makes_no_tile(gimp, image, sample):
    loaded = image([sample[1]])
    gimp.python(
        code="image_of(number).select_ellipse(Gimp.ChannelOps.REPLACE, 20, 10, 80, 64)",
        number=loaded["image"],
    )
    refused(gimp, loaded, "not a rectangle", TILE)


def test_a_filtered_layer_is_made_a_tile_as_it_is_seen(gimp, image, sample):
    pixels, file = sample
    loaded = image([file])
    code = (
        "layer = item(number); layer.append_filter(Gimp.DrawableFilter.new(layer, 'gegl:invert-gamma', 'i'))"
    )
    gimp.python(code=code, number=loaded["layers"][0])
    options = {"band": 12, "seed": 2}
    result = succeeded(
        gimp.run(procedure=TILE, image=loaded["image"], layers=loaded["layers"], options=options)
    )
    made, _ = gimp.pixels(result["layer"], "R'G'B'A u8")
    np.testing.assert_array_equal(made[..., :3], ts.make_tileable(255 - pixels, band=12, seed=2).image)


def test_a_hole_is_filled_like_in_core_and_nothing_else_covered(gimp, image, sample):
    pixels, file = sample
    loaded = image([file])
    code = """
image = image_of(number)
image.resize(140, 120, 7, 5)
image.select_ellipse(Gimp.ChannelOps.REPLACE, 50, 40, 30, 24)
box = Gegl.Rectangle.new(7, 5, 120, 96)
open(file, "wb").write(image.get_selection().get_buffer().get(box, 1.0, "Y u8", Gegl.AbyssPolicy.NONE))
"""
    file = gimp.folder / "selection.raw"
    gimp.python(code=code, number=loaded["image"], file=str(file))
    hole = np.fromfile(file, np.uint8).reshape(96, 120) >= 128
    result = succeeded(
        gimp.run(
            procedure=FILL, image=loaded["image"], layers=loaded["layers"], options={"patch": 20, "seed": 3}
        )
    )
    expected = ts.fill(pixels, hole, patch=20, seed=3).image
    shown = gimp.projection(loaded["image"], "R'G'B'A u8")
    np.testing.assert_array_equal(shown[5:101, 7:127, :3], expected)
    made, _ = gimp.pixels(result["layer"], "R'G'B'A u8")
    assert made.shape[0] < 60
    assert made.shape[1] < 80


SELECT = "image_of(number).select_rectangle(Gimp.ChannelOps.REPLACE, 40, 30, 24, 20)"


def test_a_hole_is_filled_from_around_it(gimp, image, tmp_path):
    pixels = photograph(120, 320, seed=5) // 2
    pixels[:, 160:] |= 128  # far from the hole
    write_png(tmp_path / "halves.png", pixels)
    loaded = image([tmp_path / "halves.png"])
    gimp.python(code=SELECT, number=loaded["image"])
    options = {"from": "around", "patch": 16, "seed": 1}
    result = succeeded(
        gimp.run(procedure=FILL, image=loaded["image"], layers=loaded["layers"], options=options)
    )
    filled = gimp.pixels(result["layer"], "R'G'B'A u8")[0]
    assert filled[filled[..., 3] > 0][:, :3].max() < 128
    hole = np.zeros((120, 320), bool)
    hole[30:50, 40:64] = True
    near = np.zeros_like(hole)
    near[: 50 + 48, : 64 + 48] = True
    expected = ts.fill(pixels, hole, source=near, patch=16, seed=1).image
    np.testing.assert_array_equal(gimp.projection(loaded["image"], "R'G'B'A u8")[..., :3], expected)


def test_a_hole_is_filled_from_another_layer(gimp, image, tmp_path):
    pixels = photograph(80, 100, seed=5) // 2
    write_png(tmp_path / "dark.png", pixels)
    write_png(tmp_path / "light.png", 128 + photograph(60, 70, seed=6) // 2)
    loaded = image([tmp_path / "dark.png", tmp_path / "light.png"], offsets=[[3, 2], [9, 9]])
    gimp.python(code=SELECT, number=loaded["image"])
    fill(gimp, loaded, loaded["layers"][1])
    filled = gimp.pixels(gimp.tree(image=loaded["image"])["layers"][1]["id"], "R'G'B'A u8")[0]
    assert filled[6:-6, 6:-6, :3].min() >= 128  # but for the band round the hole
    filled = filled[filled[..., 3] > 0]
    assert len(filled) >= 24 * 20


def test_a_hole_is_filled_from_where_a_mask_is_white(gimp, image, tmp_path):
    pixels = photograph(96, 120, seed=6) // 2
    pixels[:, 70:] |= 128
    write_png(tmp_path / "any.png", pixels)
    loaded = image([tmp_path / "any.png"])
    make = """
image, layer = image_of(number), item(layer)
image.select_rectangle(Gimp.ChannelOps.REPLACE, 70, 0, 50, 96)
if kind == "mask":
    mask = layer.create_mask(Gimp.AddMaskType.SELECTION)
    layer.add_mask(mask)
    layer.set_apply_mask(False)
else:
    mask = Gimp.Selection.save(image)
answer = mask.get_id()
"""
    for kind in ("channel", "mask"):
        mask = gimp.python(code=make, number=loaded["image"], layer=loaded["layers"][0], kind=kind)
        gimp.python(code=SELECT.replace("40, 30", "20, 30"), number=loaded["image"])
        fill(gimp, loaded, mask)
        filled = gimp.pixels(gimp.tree(image=loaded["image"])["layers"][0]["id"], "R'G'B'A u8")[0]
        assert filled[6:-6, 6:-6, :3].min() >= 128
        gimp.python(
            code="image_of(number).remove_layer(image_of(number).get_layers()[0])", number=loaded["image"]
        )


def fill(gimp, loaded, source):
    code = """
procedure = Gimp.get_pdb().lookup_procedure(name)
config = procedure.create_config()
config.set_property("image", image_of(number))
config.set_core_object_array("drawables", [item(layer)])
for key, value in (("from", "other"), ("source", item(source)), ("patch", 16)):
    config.set_property(key, value)
result = procedure.run(config)
answer = [result.index(0).value_nick, Gimp.get_pdb().get_last_error()]
"""
    asked = {"number": loaded["image"], "layer": loaded["layers"][0], "source": source}
    status, message = gimp.python(code=code, name=FILL, **asked)
    assert status == "success", message


def test_filling_from_another_layer_that_is_not_told(gimp, image, sample):
    loaded = image([sample[1]])
    gimp.python(code=SELECT, number=loaded["image"])
    refused(gimp, loaded, "Choose another layer", FILL, {"from": "other"})


def test_filling_without_a_selection(gimp, image, sample):
    refused(gimp, image([sample[1]]), "select what is to be replaced", FILL)


def test_a_selection_that_leaves_nothing_to_copy(gimp, image, sample):
    loaded = image([sample[1]])
    gimp.python(code="Gimp.Selection.all(image_of(number))", number=loaded["image"])
    refused(gimp, loaded, "; ", FILL)


def test_a_sample_smaller_than_a_patch(gimp, image, sample):
    refused(gimp, image([sample[1]]), "patch", SYNTHESIZE, {"patch": 400, "width": 800, "height": 800})


def test_a_layer_too_small_to_repeat(gimp, image, tmp_path):
    write_png(tmp_path / "small.png", photograph(20, 20))
    refused(gimp, image([tmp_path / "small.png"]), "at least", TILE)
