"""Stitch Selection as Patch in a real GIMP."""

import numpy as np
import pytest
from inside import mask_of, refused, succeeded
from pictures import photograph, write_png
from running import needs_gimp

needs_gimp()

PATCH = "plug-in-toposeam-patch"


@pytest.fixture
def pictures(tmp_path):
    """Two pictures of 240 × 200 px that agree on a ring, and within it differ in the middle."""
    base, other = photograph(200, 240, seed=1), photograph(200, 240, seed=2)
    y, x = np.mgrid[:200, :240]
    far = np.hypot(y - 100, x - 120)
    above = np.where(((far > 45) & (far < 55) | (far > 90))[..., None], base, other)
    for name, pixels in (("base", base), ("above", above)):
        write_png(tmp_path / f"{name}.png", pixels)
    return base, above, [tmp_path / "base.png", tmp_path / "above.png"]


def ellipse(gimp, loaded, x, y, width, height):
    gimp.python(
        code="image_of(number).select_ellipse(Gimp.ChannelOps.REPLACE, *box)",
        number=loaded["image"],
        box=[x, y, width, height],
    )


def patch(gimp, loaded, layer, options=None):
    """Lay it with a hard cut, unless the options say otherwise."""
    return gimp.run(
        procedure=PATCH, image=loaded["image"], layers=[layer], options={"blend": "none", **(options or {})}
    )


def test_a_closed_seam_runs_where_the_pictures_agree(gimp, image, pictures):
    base, above, files = pictures
    loaded = image(files)
    ellipse(gimp, loaded, 50, 30, 140, 140)
    selection = gimp.tree(image=loaded["image"])["selection"]
    result = succeeded(patch(gimp, loaded, loaded["layers"][1]))
    after = gimp.tree(image=loaded["image"])
    assert after["selection"] == selection
    assert [layer["visible"] for layer in after["layers"]] == [True, False, True]
    assert after["layers"][0]["id"] == result["layer"]
    assert after["layers"][0]["offsets"] == [50, 30]
    (stroke,) = gimp.strokes(path=after["paths"][0]["id"])
    assert stroke["closed"]
    points = np.array(stroke["points"]).reshape(-1, 3, 2)[:, 1]
    assert (np.abs(np.hypot(*(points - [120, 100]).T) - 50) < 7).all()
    # Within the ring the patch shows, outside it the base, and on the ring both are the same.
    y, x = np.mgrid[:200, :240]
    expected = np.where((np.hypot(y - 100, x - 120) < 50)[..., None], above, base)
    np.testing.assert_array_equal(gimp.projection(loaded["image"], "R'G'B'A u8")[..., :3], expected)


def test_a_patch_is_laid_on_the_visible_layers_below_it(gimp, image, pictures):
    _, _, files = pictures
    loaded = image([files[0], files[1], files[1], files[0]])
    low, hidden, layer, upper = loaded["layers"]
    gimp.python(code="item(number).set_visible(False)", number=hidden)
    ellipse(gimp, loaded, 50, 30, 140, 140)
    result = succeeded(patch(gimp, loaded, layer))
    alone = image(files)
    ellipse(gimp, alone, 50, 30, 140, 140)
    expected = succeeded(patch(gimp, alone, alone["layers"][1]))
    np.testing.assert_array_equal(mask_of(gimp, result["layer"]), mask_of(gimp, expected["layer"]))
    order = [entry["id"] for entry in gimp.tree(image=loaded["image"])["layers"]]
    assert order == [upper, result["layer"], layer, hidden, low]


def test_without_a_selection_the_whole_layer_is_the_patch(gimp, image, pictures):
    _, _, files = pictures
    loaded = image(files)
    gimp.python(code="item(number).resize(140, 140, -50, -30)", number=loaded["layers"][1])
    result = succeeded(patch(gimp, loaded, loaded["layers"][1], {"core": 0.8, "show-seam": True}))
    mask = mask_of(gimp, result["layer"])
    assert mask.shape == (140, 140)
    assert (mask[60:80, 60:80] == 255).all()
    assert (mask[[0, -1]] == 0).all()
    assert gimp.tree(image=loaded["image"])["paths"][0]["visible"]


def test_a_floating_selection_becomes_a_layer(gimp, image, pictures):
    base, above, files = pictures
    loaded = image(files)
    ellipse(gimp, loaded, 50, 30, 140, 140)
    code = """
image = image_of(number)
Gimp.edit_copy([item(layer)])
floating = Gimp.edit_paste(item(base), False)[0]
answer = [floating.get_id(), floating.is_floating_sel()]
"""
    floating, floats = gimp.python(
        code=code, number=loaded["image"], layer=loaded["layers"][1], base=loaded["layers"][0]
    )
    assert floats
    gimp.python(code="item(number).set_visible(False)", number=loaded["layers"][1])
    result = succeeded(patch(gimp, loaded, floating))
    assert result["layer"] == floating
    y, x = np.mgrid[:200, :240]
    expected = np.where((np.hypot(y - 100, x - 120) < 50)[..., None], above, base)
    np.testing.assert_array_equal(gimp.projection(loaded["image"], "R'G'B'A u8")[..., :3], expected)


@pytest.mark.parametrize(
    "options", [{"precision": "FLOAT_LINEAR"}, {"precision": "U16_NON_LINEAR"}, {"gray": True}]
)
def test_other_precisions(gimp, image, pictures, options):
    _, _, files = pictures
    loaded = image(files, **options)
    ellipse(gimp, loaded, 50, 30, 140, 140)
    result = succeeded(patch(gimp, loaded, loaded["layers"][1]))
    mask = mask_of(gimp, result["layer"])
    assert mask[70, 70] == 255
    assert not mask[[0, -1]].any()


def test_nothing_below(gimp, image, pictures):
    _, _, files = pictures
    loaded = image(files)
    ellipse(gimp, loaded, 50, 30, 140, 140)
    refused(gimp, {**loaded, "layers": loaded["layers"][:1]}, "Nothing lies below this layer", PATCH)


def test_a_selection_beside_the_layer(gimp, image, pictures):
    _, _, files = pictures
    loaded = image(files, offsets=[(0, 0), (200, 0)])
    ellipse(gimp, loaded, 10, 10, 100, 100)
    refused(gimp, {**loaded, "layers": loaded["layers"][1:]}, "The selection lies outside the layer", PATCH)


def test_a_patch_follows_its_path(gimp, image, pictures):
    _, _, files = pictures
    loaded = image(files)
    ellipse(gimp, loaded, 50, 30, 140, 140)
    result = succeeded(patch(gimp, loaded, loaded["layers"][1]))
    found = mask_of(gimp, result["layer"])
    again = {"procedure": "plug-in-toposeam-restitch", "image": loaded["image"], "layers": [result["layer"]]}
    succeeded(gimp.run(**again))
    np.testing.assert_array_equal(mask_of(gimp, result["layer"]), found)
    code = """
path = image_of(number).get_paths()[0]
for stroke in path.get_strokes():
    path.remove_stroke(stroke)
controls = [float(value) for point in ((80, 60), (160, 60), (160, 140), (80, 140)) for value in point * 3]
path.stroke_new_from_points(Gimp.PathStrokeType.BEZIER, controls, True)
"""
    gimp.python(code=code, number=loaded["image"])
    succeeded(gimp.run(**again))
    mask = mask_of(gimp, result["layer"])
    expected = np.zeros_like(mask)
    expected[30:110, 30:110] = 255
    np.testing.assert_array_equal(mask, expected)


def test_a_filtered_patch_is_laid_as_it_is_seen(gimp, image, pictures):
    base, above, files = pictures
    write_png(files[1].with_name("inverted.png"), 255 - above)
    loaded = image([files[0], files[1].with_name("inverted.png")])
    code = (
        "layer = item(number); layer.append_filter(Gimp.DrawableFilter.new(layer, 'gegl:invert-gamma', 'i'))"
    )
    gimp.python(code=code, number=loaded["layers"][1])
    gimp.python(code="item(number).set_opacity(30.0)", number=loaded["layers"][1])
    ellipse(gimp, loaded, 50, 30, 140, 140)
    succeeded(patch(gimp, loaded, loaded["layers"][1]))
    y, x = np.mgrid[:200, :240]
    expected = np.where((np.hypot(y - 100, x - 120) < 50)[..., None], above, base)
    np.testing.assert_array_equal(gimp.projection(loaded["image"], "R'G'B'A u8")[..., :3], expected)
