"""Stitch Layers in a real GIMP: the pixels, in every precision, by every method."""

import json
import subprocess
from importlib.util import find_spec

import numpy as np
import pytest
from inside import STILL_LIFE, cli, covers_once, mask_of, refused, shown, succeeded
from pictures import crops, photograph
from running import needs_gimp

import toposeam as ts

needs_gimp()


@pytest.mark.parametrize(
    ("precision", "gray", "format_name"),
    [
        ("U8_NON_LINEAR", False, "R'G'B'A u8"),
        ("U16_NON_LINEAR", False, "R'G'B'A u16"),
        ("U8_NON_LINEAR", True, "Y'A u8"),
    ],
)
def test_pixels_equal_the_command_line_s_on_exported_layers(
    gimp, image, still_life, tmp_path, precision, gray, format_name
):
    loaded = image(still_life, offsets=STILL_LIFE, precision=precision, gray=gray)
    files = [tmp_path / "a.png", tmp_path / "b.png"]
    for layer, file in zip(loaded["layers"], files, strict=True):
        assert gimp.export_layer(layer=layer, file=str(file))
    succeeded(gimp.stitch(loaded))
    seen = gimp.projection(loaded["image"], format_name)
    cli("stitch", *files, "--offset", "310,-6", "-o", tmp_path / "joined.png")
    joined = image([tmp_path / "joined.png"], alpha=True)
    expected, _ = gimp.pixels(joined["layers"][0], format_name)
    assert seen.shape == expected.shape
    covered = expected[..., -1] > 0
    np.testing.assert_array_equal(seen[..., -1], expected[..., -1])
    np.testing.assert_array_equal(seen[covered], expected[covered])


@pytest.mark.parametrize(
    "options",
    [
        {"precision": "U8_LINEAR"},
        {"precision": "FLOAT_LINEAR", "gray": True},
        *(
            pytest.param({"precision": precision}, marks=pytest.mark.slow)
            for precision in (
                "U16_LINEAR",
                "U32_NON_LINEAR",
                "HALF_NON_LINEAR",
                "FLOAT_LINEAR",
                "FLOAT_NON_LINEAR",
                "U8_PERCEPTUAL",
                "DOUBLE_LINEAR",
            )
        ),
    ],
    ids=lambda options: "-".join(str(value) for value in options.values()),
)
def test_any_precision_keeps_every_layer_bit_for_bit(gimp, image, still_life, options):
    loaded = image(still_life, offsets=STILL_LIFE, **options)
    before = {layer["id"]: layer["pixels"] for layer in gimp.tree(image=loaded["image"])["layers"]}
    succeeded(gimp.stitch(loaded))
    group, *originals = gimp.tree(image=loaded["image"])["layers"]
    assert (
        [layer["pixels"] for layer in group["children"]]
        == [before[layer["id"]] for layer in originals]
        == list(before.values())
    )
    low, high = shown(gimp, [child["id"] for child in reversed(group["children"])])
    assert covers_once(low, high, 310, 6)


def test_an_adobe_rgb_image_is_cut_in_its_own_space(gimp, image, still_life):
    loaded = image(still_life, offsets=STILL_LIFE)
    gimp.python(
        code="image_of(number).set_color_profile(Gimp.ColorProfile.new_rgb_adobe())", number=loaded["image"]
    )
    plain = image(still_life, offsets=STILL_LIFE)
    masks = []
    for one in (loaded, plain):
        succeeded(gimp.stitch(one))
        group = gimp.tree(image=one["image"])["layers"][0]
        masks.append([mask_of(gimp, child["id"]) for child in group["children"]])
        profile = gimp.python(
            code="answer = image_of(number).get_effective_color_profile().get_label()", number=one["image"]
        )
        assert ("Adobe" in profile) == (one is loaded)
    # The same numbers in another space are the same picture to a seam.
    for adobe, srgb in zip(*masks, strict=True):
        np.testing.assert_array_equal(adobe, srgb)


def test_four_layers_become_a_masked_group_with_a_path_per_seam(gimp, image, tmp_path):
    files, offsets = crops(
        tmp_path, photograph(300, 340), [(0, 0), (150, 10), (20, 130), (140, 120)], 180, 160
    )
    loaded = image(files, offsets=offsets)
    expected = gimp.projection(loaded["image"], "R'G'B'A u8")
    result = succeeded(gimp.stitch(loaded))
    after = gimp.tree(image=loaded["image"])
    assert after["layers"][0]["id"] == result["layer"]
    assert [child["offsets"] for child in reversed(after["layers"][0]["children"])] == [
        list(offset) for offset in offsets
    ]
    assert not any(layer["visible"] for layer in after["layers"][1:])
    assert len(after["paths"]) >= 3
    assert all(path["visible"] for path in after["paths"])
    # The crops come from one photograph, so any tiling without hole or double cover shows the photograph.
    np.testing.assert_array_equal(gimp.projection(loaded["image"], "R'G'B'A u8"), expected)
    canvas = np.zeros((340, 400), int)
    children = after["layers"][0]["children"][::-1]
    for child, mask in zip(children, shown(gimp, [child["id"] for child in children]), strict=True):
        x, y = child["offsets"]
        canvas[y : y + mask.shape[0], x : x + mask.shape[1]] += mask
    covered = expected[..., 3] > 0
    assert (canvas[: covered.shape[0], : covered.shape[1]][covered] == 255).all()


def test_transparent_parts_do_not_take_part(gimp, image, samples):
    loaded = image([samples / "sky_a.png", samples / "sky_b.png"], offsets=[(0, 0), (60, 60)])
    succeeded(gimp.stitch(loaded))
    group = gimp.tree(image=loaded["image"])["layers"][0]
    seen = gimp.projection(loaded["image"], "R'G'B'A u8")
    below, _ = gimp.pixels(group["children"][1]["id"], "R'G'B'A u8")
    hole = below[60:220, 60:220, 3] == 0
    assert hole.any()
    assert (seen[60:220, 60:220, 3][hole] == 255).all()  # what only the upper layer covers is shown


def test_the_seam_stays_within_a_selection_that_is_no_rectangle(gimp, image, still_life):
    loaded = image(still_life, offsets=[(0, 0), (310, 0)])
    code = """
image = image_of(number)
image.select_polygon(Gimp.ChannelOps.REPLACE,
    [350.0, 0.0, 400.0, 0.0, 430.0, 250.0, 390.0, 500.0, 340.0, 500.0, 380.0, 250.0])
selection = image.get_selection()
box = Gegl.Rectangle.new(0, 0, image.get_width(), image.get_height())
open(file, "wb").write(selection.get_buffer().get(box, 1.0, "Y u8", Gegl.AbyssPolicy.NONE))
answer = [image.get_width(), image.get_height()]
"""
    file = gimp.folder / "selection.raw"
    width, height = gimp.python(code=code, number=loaded["image"], file=str(file))
    selected = np.fromfile(file, np.uint8).reshape(height, width) >= 128
    succeeded(gimp.stitch(loaded))
    group = gimp.tree(image=loaded["image"])["layers"][0]
    mask = mask_of(gimp, group["children"][0]["id"])[:, : 440 - 310]  # the right layer, within the overlap
    edges = np.argwhere(mask[:, 1:] != mask[:, :-1])
    assert len(edges) >= 500
    touched = [selected[y, 310 + x] and selected[y, 311 + x] for y, x in edges]
    assert all(touched)
    np.testing.assert_array_equal(np.fromfile(file, np.uint8).reshape(height, width) >= 128, selected)


@pytest.mark.parametrize(
    "options",
    [
        {"blend": "feather", "blend-width": 12.0},
        {"blend": "multiband"},
        {"blend": "gradient"},
        {"blend": "soft"},
        {"blend": "feather", "match-shading": True},
    ],
)
@pytest.mark.parametrize("precision", ["U8_NON_LINEAR", pytest.param("FLOAT_LINEAR", marks=pytest.mark.slow)])
def test_blending_and_tones_as_core_does_them(gimp, image, still_life, options, precision):
    loaded = image(still_life, offsets=[(0, 0), (310, 0)], precision=precision)
    code = """
layer = item(number)
Gimp.context_set_foreground(Gegl.Color.new("black"))
layer.levels(Gimp.HistogramChannel.VALUE, 0.0, 1.0, False, 1.0, 0.0, 0.8, False)
"""
    gimp.python(code=code, number=loaded["layers"][1])
    format_name = "R'G'B'A u8" if precision == "U8_NON_LINEAR" else "R'G'B'A float"
    pixels = [gimp.pixels(layer, format_name)[0] for layer in loaded["layers"]]
    succeeded(gimp.stitch(loaded, {**options, "match-tones": True}))
    seen = gimp.projection(loaded["image"], format_name)
    layers = [ts.Layer(image=array[..., :3], at=(x, 0)) for array, x in zip(pixels, (0, 310), strict=True)]
    named = {name.replace("-", "_"): value for name, value in options.items()}
    expected = ts.stitch(layers, match_tones=True, **named)
    tolerance = 0 if format_name.endswith("u8") else 1e-4
    np.testing.assert_allclose(seen[..., :3], expected.image, atol=tolerance, rtol=0)
    group, *originals = gimp.tree(image=loaded["image"])["layers"]
    assert [child["name"].removesuffix(" (stitched)") for child in group["children"]] == [
        "Blended seams",
        "still_life_right.png",
        "Background",
    ]
    np.testing.assert_array_equal(gimp.pixels(originals[0]["id"], format_name)[0], pixels[1])


@pytest.mark.slow
@pytest.mark.parametrize("method", ["heat", "shortest-path", "dp", "graph-cut"])
def test_every_method(gimp, image, samples, method):
    loaded = image([samples / "grass_a.png", samples / "grass_b.png"], offsets=[(0, 0), (120, 0)])
    if method == "graph-cut" and find_spec("maxflow") is None:
        refused(gimp, loaded, "PyMaxflow", options={"method": method})
        return
    succeeded(gimp.stitch(loaded, {"method": method, "law": "colour"}))
    group = gimp.tree(image=loaded["image"])["layers"][0]
    assert covers_once(*shown(gimp, [child["id"] for child in reversed(group["children"])]), 120, 0)


def test_from_script_fu(gimp, real_gimp, still_life, tmp_path):
    out = tmp_path / "joined.xcf"
    script = f"""
(script-fu-use-v3)
(let* ((image (gimp-file-load RUN-NONINTERACTIVE "{still_life[0]}"))
       (layer (gimp-file-load-layer RUN-NONINTERACTIVE image "{still_life[1]}")))
  (gimp-image-insert-layer image layer 0 0)
  (gimp-layer-set-offsets layer 310 -6)
  (gimp-image-resize-to-layers image)
  (plug-in-toposeam-stitch #:run-mode RUN-NONINTERACTIVE #:image image
                           #:drawables (gimp-image-get-layers image)
                           #:method "shortest-path" #:show-seam #t)
  (gimp-xcf-save RUN-NONINTERACTIVE image "{out}"))
"""
    command = [real_gimp, "-nidfs", "--batch-interpreter=plug-in-script-fu-eval", "-b", script, "--quit"]
    ended = subprocess.run(
        command,
        env={**gimp.environment, "TOPOSEAM_TEST_SOCKET": ""},
        capture_output=True,
        timeout=120,
        stdin=subprocess.DEVNULL,
    )
    assert ended.returncode == 0, ended.stderr.decode()
    number = gimp.python(
        code="answer = Gimp.file_load(Gimp.RunMode.NONINTERACTIVE, Gio.File.new_for_path(file)).get_id()",
        file=str(out),
    )
    after = gimp.tree(image=number)
    assert len(after["layers"][0]["children"]) == 2
    assert after["paths"][0]["visible"]
    gimp.delete(image=number)


def test_a_stitched_file_is_saved_with_its_seams(gimp, image, still_life, tmp_path):
    loaded = image(still_life, offsets=STILL_LIFE)
    group = succeeded(gimp.stitch(loaded))["layer"]
    code = "answer = bytes(item(number).get_parasite('toposeam-seam').get_data()).decode()"
    memory = json.loads(gimp.python(code=code, number=group))
    assert len(memory["layers"]) == 2
    line = memory["seams"][0]["lines"][0]
    exact = np.array([number for piece in line["pieces"] for number in piece]).reshape(-1, 2)
    assert (exact[1:-1] == np.round(exact[1:-1])).mean() > 0.8  # corners of pixels, but where curves meet
    assert len(exact) > len(line["stroke"]) / 6 > 2


KEEP_AWAY = """
procedure = Gimp.get_pdb().lookup_procedure("plug-in-toposeam-stitch")
image = image_of(number)
image.select_rectangle(Gimp.ChannelOps.REPLACE, 215, 0, 100, 200)
channel = Gimp.Selection.save(image)
Gimp.Selection.none(image)
config = procedure.create_config()
config.set_property("image", image)
config.set_core_object_array("drawables", [item(layer) for layer in layers])
config.set_property("avoid", channel)
result = procedure.run(config)
answer = [result.index(0).value_nick, Gimp.get_pdb().get_last_error()]
"""


def test_no_seam_runs_where_a_channel_is_white(gimp, image, tmp_path):
    files, places = crops(tmp_path, photograph(200, 400), [(0, 0), (140, 0)], 260, 200)
    loaded = image(files, offsets=places)
    asked = {"number": loaded["image"], "layers": loaded["layers"]}
    status, message = gimp.python(code=KEEP_AWAY, **asked)
    assert status == "success", message
    group = gimp.tree(image=loaded["image"])["layers"][0]
    upper = next(child for child in group["children"] if "crop1" in child["name"])
    mask = mask_of(gimp, upper["id"])
    avoided = mask[:, 215 - 140 : 260 - 140]  # what both show of the channel
    assert avoided.shape == (200, 45)
    assert len(np.unique(avoided)) == 1
    assert set(np.unique(mask)) == {0, 255}
