"""Stitch Layers in a real GIMP: layers of every kind and place, and what is refused."""

import numpy as np
from inside import STILL_LIFE, covers_once, refused, shown, succeeded
from pictures import photograph, write_png
from running import needs_gimp

import toposeam as ts

needs_gimp()


def test_a_hidden_layer_that_was_selected_takes_part(gimp, image, still_life):
    loaded = image(still_life, offsets=STILL_LIFE)
    gimp.python(code="item(number).set_visible(False)", number=loaded["layers"][0])
    succeeded(gimp.stitch(loaded))
    assert all(child["visible"] for child in gimp.tree(image=loaded["image"])["layers"][0]["children"])


def test_mode_and_opacity_of_layers_keep_the_result_opaque(gimp, image, still_life):
    plain = image(still_life, offsets=STILL_LIFE)
    succeeded(gimp.stitch(plain))
    expected = gimp.projection(plain["image"], "R'G'B'A u8")
    loaded = image(still_life, offsets=STILL_LIFE)
    code = """
low, high = (item(number) for number in layers)
low.set_mode(Gimp.LayerMode.DIFFERENCE)
high.set_opacity(50.0)
"""
    gimp.python(code=code, layers=loaded["layers"])
    succeeded(gimp.stitch(loaded))
    np.testing.assert_array_equal(gimp.projection(loaded["image"], "R'G'B'A u8"), expected)
    group, high, _low = gimp.tree(image=loaded["image"])["layers"]
    assert [child["opacity"] for child in group["children"]] == [100, 100]
    assert high["opacity"] == 50


FILTER = """
filter = Gimp.DrawableFilter.new(item(number), operation, "seen")
item(number).append_filter(filter)
filter.set_visible(visible)
"""


def test_filters_of_a_layer_are_seen(gimp, image, still_life):
    loaded = image(still_life, offsets=STILL_LIFE)
    for layer, operation, visible in zip(
        loaded["layers"], ("gegl:invert-gamma", "gegl:pixelize"), (True, False), strict=True
    ):
        gimp.python(code=FILTER, number=layer, operation=operation, visible=visible)
    inverted, _ = gimp.pixels(loaded["layers"][0], "R'G'B'A u8")
    inverted[..., :3] = 255 - inverted[..., :3]
    right, _ = gimp.pixels(loaded["layers"][1], "R'G'B'A u8")
    succeeded(gimp.stitch(loaded))
    group, *originals = gimp.tree(image=loaded["image"])["layers"]
    copies = [gimp.pixels(child["id"], "R'G'B'A u8")[0] for child in reversed(group["children"])]
    np.testing.assert_array_equal(copies[0], inverted)
    np.testing.assert_array_equal(copies[1], right)
    layers = [ts.Layer(inverted[..., :3]), ts.Layer(right[..., :3], at=(310, -6))]
    expected = ts.stitch(layers).masks[0]
    low, _high = shown(gimp, [child["id"] for child in reversed(group["children"])])
    np.testing.assert_array_equal(low > 0, expected[6 : 6 + low.shape[0], : low.shape[1]])
    count = "answer = len(item(number).get_filters())"
    assert [gimp.python(code=count, number=layer["id"]) for layer in originals] == [1, 1]


def test_a_filter_that_enlarges_a_layer_and_one_on_a_group(gimp, image, still_life):
    loaded = image(still_life, offsets=[(0, 0), (310, 0)])
    gimp.python(code=FILTER, number=loaded["layers"][1], operation="gegl:dropshadow", visible=True)
    code = """
image, layer = image_of(number), item(layer)
group = Gimp.GroupLayer.new(image, "pair")
image.insert_layer(group, None, 1)
image.reorder_item(layer, group, 0)
answer = group.get_id()
"""
    group = gimp.python(code=code, number=loaded["image"], layer=loaded["layers"][0])
    gimp.python(code=FILTER, number=group, operation="gegl:invert-gamma", visible=True)
    inside, _ = gimp.pixels(loaded["layers"][0], "R'G'B'A u8")
    succeeded(gimp.stitch({"image": loaded["image"], "layers": [group, loaded["layers"][1]]}))
    # GIMP 3.0 itself gives up when the pixels of a layer are read that a filter makes larger.
    code = """
high, low = image_of(number).get_layers()[0].get_children()
answer = [low.get_id(), low.is_group(), high.get_width(), item(original).get_width()]
"""
    low, is_group, width, narrow = gimp.python(
        code=code, number=loaded["image"], original=loaded["layers"][1]
    )
    assert not is_group
    assert width > narrow
    seen, _ = gimp.pixels(low, "R'G'B'A u8")
    np.testing.assert_array_equal(seen[..., :3], 255 - inside[..., :3])


def test_a_layer_group_is_joined_like_a_layer(gimp, image, still_life):
    loaded = image(still_life, offsets=STILL_LIFE)
    code = """
image, layer = image_of(number), item(layer)
group = Gimp.GroupLayer.new(image, "pair")
image.insert_layer(group, None, 0)
image.reorder_item(layer, group, 0)
answer = group.get_id()
"""
    group = gimp.python(code=code, number=loaded["image"], layer=loaded["layers"][1])
    both = {"image": loaded["image"], "layers": [loaded["layers"][0], group]}
    succeeded(gimp.stitch(both))
    stitched = gimp.tree(image=loaded["image"])["layers"][0]
    assert "children" in stitched["children"][0]
    low, high = shown(gimp, [child["id"] for child in reversed(stitched["children"])])
    assert covers_once(low, high, 310, 6)


def test_a_group_and_a_layer_inside_it_are_refused(gimp, image, still_life):
    loaded = image(still_life, offsets=STILL_LIFE)
    code = """
image, layer = image_of(number), item(layer)
group = Gimp.GroupLayer.new(image, "pair")
image.insert_layer(group, None, 0)
image.reorder_item(layer, group, 0)
answer = group.get_id()
"""
    group = gimp.python(code=code, number=loaded["image"], layer=loaded["layers"][1])
    refused(gimp, {"image": loaded["image"], "layers": [loaded["layers"][1], group]}, "select either of them")


def test_masked_pixels_do_not_take_part_and_the_mask_survives(gimp, image, still_life):
    loaded = image(still_life, offsets=[(0, 0), (310, 0)])
    code = """
layer = item(number)
mask = layer.create_mask(Gimp.AddMaskType.WHITE)
layer.add_mask(mask)
box = Gegl.Rectangle.new(0, 0, 60, layer.get_height())
mask.get_buffer().set(box, "Y u8", bytes(60 * layer.get_height()))
mask.get_buffer().flush()
"""
    gimp.python(code=code, number=loaded["layers"][1])
    masked = gimp.tree(image=loaded["image"])["layers"][0]
    succeeded(gimp.stitch(loaded))
    group, original, _ = gimp.tree(image=loaded["image"])["layers"]
    assert (original["pixels"], original["mask"]) == (masked["pixels"], masked["mask"])
    low, _high = shown(gimp, [child["id"] for child in reversed(group["children"])])
    assert (low[:, :370] == 255).all()  # what the upper layer's mask hides shows the lower one
    assert (low[:, 439] == 0).all()


def test_replacing_the_layers_and_merging(gimp, image, still_life):
    loaded = image(still_life, offsets=STILL_LIFE)
    succeeded(gimp.stitch(loaded))
    expected = gimp.projection(loaded["image"], "R'G'B'A u8")
    again = image(still_life, offsets=STILL_LIFE)
    result = succeeded(gimp.stitch(again, {"keep-layers": False, "merge": True}))
    after = gimp.tree(image=again["image"])
    assert [layer["id"] for layer in after["layers"]] == [result["layer"]]
    assert "children" not in after["layers"][0]
    assert [path["visible"] for path in after["paths"]] == [True]
    np.testing.assert_array_equal(gimp.projection(again["image"], "R'G'B'A u8"), expected)


def test_layers_that_do_not_overlap(gimp, image, still_life):
    refused(gimp, image(still_life, offsets=[(0, 0), (441, 0)]), "overlap")


def test_one_layer(gimp, image, still_life):
    loaded = image(still_life, offsets=STILL_LIFE)
    refused(gimp, {**loaded, "layers": loaded["layers"][:1]}, "Two or more layers are needed")


def test_an_indexed_image(gimp, image, still_life):
    loaded = image(still_life, offsets=STILL_LIFE)
    code = (
        "image_of(number).convert_indexed(Gimp.ConvertDitherType.NONE, Gimp.ConvertPaletteType.GENERATE, "
        "16, False, False, '')"
    )
    gimp.python(code=code, number=loaded["image"])
    refused(gimp, loaded, "Image → Mode → RGB")


def test_a_selection_that_leaves_no_way(gimp, image, still_life):
    loaded = image(still_life, offsets=[(0, 0), (310, 0)])
    gimp.python(
        code="image_of(number).select_rectangle(Gimp.ChannelOps.REPLACE, 0, 0, 20, 20)",
        number=loaded["image"],
    )
    refused(gimp, loaded, "leaves it no way through")


def test_nan_pixels(gimp, image, still_life):
    loaded = image(still_life, offsets=[(0, 0), (310, 0)], precision="FLOAT_NON_LINEAR")
    code = """
import struct
layer = item(number)
one = Gegl.Rectangle.new(50, 50, 1, 1)
layer.get_buffer().set(one, "R'G'B'A float", struct.pack("4f", float("nan"), 0.0, 0.0, 1.0))
"""
    gimp.python(code=code, number=loaded["layers"][1])
    refused(gimp, loaded, "holds pixels that are no numbers")


def test_layers_that_lie_anywhere_are_put_where_they_belong(gimp, image, tmp_path):
    whole = photograph(160, 300, seed=3)
    write_png(tmp_path / "left.png", whole[:, :180])
    write_png(tmp_path / "right.png", whole[8:, 120:])
    loaded = image([tmp_path / "left.png", tmp_path / "right.png"], offsets=[[0, 0], [4, 90]])
    gimp.python(code="image_of(number).resize(200, 200, 0, 0)", number=loaded["image"])
    result = succeeded(gimp.stitch(loaded, {"places": "anywhere"}))
    after = gimp.tree(image=loaded["image"])
    assert after["size"] == [300, 200]  # grown to the right, not cropped below
    group = next(layer for layer in after["layers"] if layer["id"] == result["layer"])
    assert [child["offsets"] for child in group["children"]] == [[120, 8], [0, 0]]
    seen = gimp.projection(loaded["image"], "R'G'B'A u8")
    np.testing.assert_array_equal(seen[8:160, :, :3], whole[8:])


def test_a_turned_layer_is_turned_back(gimp, image, tmp_path):
    whole = photograph(160, 300, seed=3)
    write_png(tmp_path / "left.png", whole[:, :180])
    write_png(tmp_path / "right.png", whole[:, 110:])
    loaded = image([tmp_path / "left.png", tmp_path / "right.png"])
    code = "item(number).transform_rotate(0.02, True, 0, 0)"
    gimp.python(code=code, number=loaded["layers"][1])
    succeeded(gimp.stitch(loaded, {"places": "anywhere"}))
    seen = gimp.projection(loaded["image"], "R'G'B'A u8")[10:150, 10:280, :3].astype(int)
    assert np.abs(seen - whole[10:150, 10:280]).mean() < 0.2 * whole.std()


def test_layers_that_have_nothing_in_common(gimp, image, tmp_path):
    for name, seed in (("a", 1), ("b", 2)):
        write_png(tmp_path / f"{name}.png", photograph(120, 150, seed=seed))
    loaded = image([tmp_path / "a.png", tmp_path / "b.png"])
    refused(gimp, loaded, "nothing that the other layers show", options={"places": "anywhere"})
    gimp.python(
        code="image_of(number).select_rectangle(Gimp.ChannelOps.REPLACE, 0, 0, 50, 50)",
        number=loaded["image"],
    )
    refused(gimp, loaded, "Select → None", options={"places": "anywhere"})
